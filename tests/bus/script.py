"""An interlock of one function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from motorbus.core.request import Request


class Check:
    """An interlock that calls this function with each request; `stops` are the nodes of every stop."""

    def __init__(self, check: Callable[[Any], None]) -> None:
        self._check = check
        self.stops: list[tuple[int, ...]] = []

    def check(self, request: Request[Any], now: float) -> None:
        self._check(request)

    def stopped(self, nodes: Sequence[int]) -> None:
        self.stops.append(tuple(nodes))


ADMIT_ALL = Check(lambda request: None)
