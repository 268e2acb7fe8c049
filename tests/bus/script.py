"""An interlock of one function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from motorbus.core.operation import Exchange


class Check:
    """An interlock that calls this function with each request."""

    def __init__(self, check: Callable[[Any], None]) -> None:
        self._check = check

    def check(self, request: Exchange[Any], now: float) -> None:
        self._check(request)

    def required_reads(self, request: Exchange[Any]) -> Sequence[Any]:
        return ()

    def stopped(self, nodes: Sequence[int]) -> None:
        pass


ADMIT_ALL = Check(lambda request: None)
