"""Carries out a driver's operation without a bus: each step goes to whoever plays the other side."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from motorbus.core.request import Step
from motorbus.core.steps import Runnable

T = TypeVar("T")


def played(runnable: Runnable[T], carry_out: Callable[[Any], Any]) -> T:
    """The value of the operation; what `carry_out` raises at a step is thrown into it there."""
    operation = runnable.__await__() if isinstance(runnable, Step) else runnable
    value: Any = None
    error: BaseException | None = None
    while True:
        try:
            step = operation.throw(error) if error is not None else operation.send(value)
        except StopIteration as end:
            result: T = end.value
            return result
        value, error = None, None
        try:
            value = carry_out(step)
        except BaseException as raised:
            error = raised
