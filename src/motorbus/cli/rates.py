"""What `--rate` says: every command that takes one refuses the same figures, in the same words."""

from __future__ import annotations

from typing import Final

from motorbus.errors import RequestError

HIGHEST: Final = 1e6
"""Hz; on the quickest bus there is one byte takes longer than such a cycle."""
LOWEST: Final = 1e-6
"""Hz; a cycle in eleven days."""


def check_rate(rate: float) -> None:
    """Raise RequestError for a rate (Hz) at which nobody can do anything. Nothing was sent."""
    if not LOWEST <= rate <= HIGHEST:
        raise RequestError(
            f"--rate {rate:g}: it cannot be done so often",
            expected=f"cycles per second: {LOWEST:g} to {HIGHEST:g}",
            advice="nothing was sent",
        )
