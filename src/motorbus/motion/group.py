"""What several axes of a machine do together: each is a function of a `Body` that gives the work on each bus."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from motorbus.core.family import State
from motorbus.core.operation import Operation, Together
from motorbus.motion import axis as one
from motorbus.motion.abreast import Abreast, settled
from motorbus.motion.axis import AxisVerbs
from motorbus.motion.body import Body


def states(body: Body, names: str | Iterable[str] | None = None) -> Abreast[dict[str, State]]:
    """One sample of each that tells one, by name."""
    axes = {name: axis for name, axis in body.chosen(names).items() if "state" in axis.able}

    def of(there: list[AxisVerbs]) -> Operation[list[State]]:
        return (yield from Together([one.state(axis) for axis in there]))

    parts = body.by_bus(axes)

    def combine(results: Mapping[str, Any]) -> dict[str, State]:
        told = settled(results)
        found = {
            axis.name: s for bus, there in parts.items() for axis, s in zip(there, told[bus], strict=True)
        }
        return {name: found[name] for name in axes}

    return Abreast({bus: of(there) for bus, there in parts.items()}, combine)
