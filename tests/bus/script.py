"""An open gate, for tests that are not about the gate."""

from __future__ import annotations

from typing import Any

from motorbus.core.operation import Exchange


def admit_all(exchange: Exchange[Any]) -> None:
    """Refuse nothing."""
