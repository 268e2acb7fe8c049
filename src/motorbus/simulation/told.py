"""The ids of simulated devices, as whoever is to choose one of them writes them.

On CAN they are part of identifiers, which everyone writes in hex, and so these are told both ways.
"""

from __future__ import annotations

from collections.abc import Iterable

from motorbus.core.family import Simulator


def told(simulator: Simulator, ids: Iterable[int]) -> str:
    """Ids in order: `1, 2` on a serial line, `0x25 (37), 0x26 (38)` on CAN."""
    on_can = hasattr(simulator, "audience")
    return ", ".join(f"0x{id:02X} ({id})" if on_can else str(id) for id in sorted(ids))
