"""What a loop would load each bus with, and how fast it can be: known before anything moves.

A cycle of a loop is the requests of a family's `PositionStream`: what they ask, which replies they expect, and so how
long they are on the wire. The wire limits the rate; the time that devices take before they reply lowers it.
Nothing here knows a family.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, Final

from motorbus.bus.base import BaseBus
from motorbus.core.family import BusDriver, PositionStream
from motorbus.core.request import ANY, Request
from motorbus.errors import RequestError
from motorbus.motion import limits
from motorbus.motion.body import Body
from motorbus.motion.capabilities import AxisVerbs
from motorbus.motion.loop.cycle import train_of
from motorbus.motion.parallel import Parallel, settled

ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True)
class BusBudget:
    """What one cycle of a loop costs on one bus.

    `axes`        who is in the loop, by name, or by id where there is no name
    `bit_rate`    bit/s
    `exchanges`   goals and questions that are sent each cycle
    `replies`     that are due to them
    `wire`        s that all of it is on the wire each cycle
    `turnaround`  s that a device was taken to think before each of its replies
    `waits`       s of each cycle that the wire stands still for that; 0 where exchanges overlap
    """

    axes: tuple[str, ...]
    bit_rate: int
    requests: int
    replies: int
    wire: float
    turnaround: float
    waits: float

    @property
    def highest_rate(self) -> float:
        """Cycles per second that this bus carries at most."""
        return 1 / (self.wire + self.waits)

    def load(self, rate: float) -> float:
        """Fraction of the time of the bus that a loop of `rate` (Hz) takes; above 1 is impossible."""
        return rate * (self.wire + self.waits)


@dataclass(frozen=True, slots=True)
class RobotBudget:
    """What a loop of `rate` (Hz; 0: none was asked about) costs on each bus of a machine, by its name.

    `without` are the axes that cannot be in a loop, because nobody can lead their device.
    """

    rate: float
    buses: Mapping[str, BusBudget]
    without: tuple[str, ...] = ()

    @property
    def highest_rate(self) -> float:
        """Cycles per second that every bus carries: the loop waits for the slowest. Infinite where nobody is in it."""
        return min((bus.highest_rate for bus in self.buses.values()), default=inf)

    @property
    def slowest(self) -> str:
        """The name of the bus that limits it; "" where there is none."""
        return min(self.buses, key=lambda name: self.buses[name].highest_rate, default="")

    def fits(self) -> bool:
        """Whether every bus carries that rate."""
        return self.rate <= self.highest_rate * (1 + ROUNDING)


def budget(
    body: Body, rate: float = 0.0, axes: str | Iterable[str] | None = None, *, turnaround: float = 0.0
) -> Parallel[RobotBudget]:
    """What a loop over these axes would load each bus with, and the highest rate (Hz) it could have.

    `turnaround` is how long (s) each device thinks before it answers; it counts where one exchange follows the other.
    Devices whose settings are not known yet are asked for them; nothing is written. Raises RequestError for a rate or a
    time that cannot be.
    """
    check_figures(rate, turnaround)
    chosen = body.chosen(axes)
    led, without = divided(chosen)

    async def of(bus: str, there: list[AxisVerbs]) -> BusBudget:
        face = body.buses[bus]
        train = await train_of(face, there)
        angles = await some_angles(there)
        return bus_budget(face, train, [axis.name for axis in there], angles, turnaround)

    def combine(results: Mapping[str, Any]) -> RobotBudget:
        return RobotBudget(rate, settled(results), without)

    return Parallel({bus: of(bus, there) for bus, there in body.by_bus(led).items()}, combine)


def divided(axes: Mapping[str, AxisVerbs]) -> tuple[dict[str, AxisVerbs], tuple[str, ...]]:
    """Those that can be led in a loop, and the names of those that cannot."""
    led = {name: axis for name, axis in axes.items() if "stream" in axis.able}
    return led, tuple(name for name in axes if name not in led)


async def some_angles(axes: Iterable[AxisVerbs]) -> dict[int, float]:
    """By id, an angle (rad) that each device can be told: all goals are as long, so any will do to count."""
    found = {}
    for axis in axes:
        device = await limits.of_device(axis)
        low, high = device or (-inf, inf)
        found[axis.spec.node] = min(max(0.0, low), high)
    return found


def bus_budget(
    bus: BaseBus,
    train: PositionStream,
    names: Sequence[str],
    angles: Mapping[int, float],
    turnaround: float = 0.0,
) -> BusBudget:
    """What a cycle of this train costs on its bus, with goals at these `angles` (rad, by id)."""
    return counted(bus.driver, bus.rate, (*train.goals(angles), *train.positions), names, turnaround)


def counted(
    driver: BusDriver,
    bit_rate: int,
    cycle: Sequence[Request[Any]],
    names: Sequence[str],
    turnaround: float = 0.0,
) -> BusBudget:
    """What a cycle of these exchanges costs at `bit_rate` (bit/s)."""
    replies = [0 if one.expected is ANY else len(one.expected) for one in cycle]
    overlap = len({one.lane for one in cycle}) > 1 and driver.window > 1
    return BusBudget(
        axes=tuple(names),
        bit_rate=bit_rate,
        requests=len(cycle),
        replies=sum(replies),
        wire=sum(driver.air_time(one, bit_rate) for one in cycle),
        turnaround=turnaround,
        waits=0.0 if overlap else turnaround * sum(replies),
    )


def refuse_above(found: RobotBudget) -> None:
    """Raise RequestError for a rate that a bus cannot carry, with the highest one."""
    if found.fits():
        return
    highest, bus = found.highest_rate, found.slowest
    raise RequestError(
        f"a loop of {found.rate:g} Hz cannot be: {bus} carries {highest:.1f} Hz at most",
        expected=f"{highest:.1f} Hz or less",
        cause=f"a cycle is {found.buses[bus].wire * 1e3:.3f} ms on the wire of {bus} at "
        f"{found.buses[bus].bit_rate} bit/s",
        advice="choose a lower rate, fewer axes or a faster bus; nothing moved, and no torque was switched",
    )


def check_figures(rate: float, turnaround: float = 0.0) -> None:
    """Raise RequestError for a rate (Hz) or a time (s) that cannot be."""
    for what, figure in (("rate", rate), ("turnaround", turnaround)):
        limits.check_number(what, figure)
        if not (isfinite(figure) and figure >= 0):
            raise RequestError(
                f"{what} is {figure}", expected="a finite number, 0 or more", advice="nothing was sent"
            )
