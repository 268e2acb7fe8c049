"""motorbus before the same fault, in virtual time: a million calls of each family take minutes.

The simulators are those of the tests. A read is asked for as a program would, so quiet times, probes and new tries are
part of the call. The stepper controller tells no position: there a project is read, which differs after each request.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from bench.late.device import (
    DELAY,
    ECHOES,
    ID,
    NOBODY,
    POSITION,
    SHARE,
    SOON,
    Lateness,
    Tally,
    forged,
    place,
    tally,
)
from motorbus import feetech, kst, stepper
from motorbus.bus.blocking import Bus
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import SimulatedNode, Simulator
from motorbus.core.request import Data
from motorbus.core.steps import Runnable
from motorbus.errors import MotorbusError
from motorbus.families.feetech.driver.exchanges import read_block
from motorbus.families.stepper.driver.reading import dump_once
from motorbus.link.base import Delivery, Side
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate

TAIL = 2
"""Last bytes of a project, which tell one from another."""


class Turning:
    """A simulator that is elsewhere after each request; `turn` puts it there."""

    def __init__(self, there: Simulator, turn: Callable[[int], None]) -> None:
        self.there = there
        self.turn = turn
        self.heard = 0

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        return self.there.nodes

    def receive(self, data: Data, at: float) -> None:
        self.heard += 1
        self.turn(self.heard)
        self.there.receive(data, at)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        return list(self.there.advance(to))

    def due(self) -> float | None:
        return self.there.due()

    def tune(self, rate: int) -> None:
        self.there.tune(rate)


class Line:
    """The wire of `device.Servo`: what is late comes just after the next request, and all may come back as an echo."""

    def __init__(self, lateness: Lateness, echo: bool) -> None:
        self.lateness = lateness
        self.echo = echo

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.DEVICE:
            return [] if self.lateness.is_late(data) else [Delivery(at + DELAY, Side.HOST, data)]
        heard = [Delivery(at, Side.DEVICE, data)]
        echo = [Delivery(at, Side.HOST, data)] if self.echo else []
        late = self.lateness.kept_back()
        return (
            heard
            + echo
            + [Delivery(at + SOON, Side.HOST, one) for one in late if isinstance(one, bytes | CanFrame)]
        )


class Reader(NamedTuple):
    """A family on such a line: how one of its devices is read (None for an error), and what is true when.

    `write` gives it an order that is safe, torque off or stop; None where the family has none.
    """

    bus: Bus
    servos: Turning
    read: Callable[[int], int | None]
    write: Callable[[int], bool] | None
    where: Callable[[int], int]


def reader(name: str, lateness: Lateness, echo: bool = False) -> Reader:
    """One device of this family, its bus opened as `motorbus.open` does it."""
    return {"feetech": _feetech, "kst": _kst, "stepper": _stepper}[name](Line(lateness, echo))


def _opened(bus: Bus) -> Bus:
    """The test of the echo, where the family has one."""
    test = bus.driver.echo_test()
    if test is not None:
        bus.expect_echo(test)
        with suppress(MotorbusError):
            bus.run(test)
    return bus


def _value(bus: Bus, operation: Runnable[Any]) -> Any:
    try:
        return bus.run(operation)
    except MotorbusError:
        return None


def _done(bus: Bus, operation: Runnable[Any]) -> bool:
    try:
        bus.run(operation)
    except MotorbusError:
        return False
    return True


def _feetech(line: Line) -> Reader:
    there: Any = feetech.FAMILY.simulator((ID,))

    def turn(heard: int) -> None:
        there.nodes[ID].raw_position = place(heard)

    servos = Turning(there, turn)
    bus = _opened(Bus(MemoryLink(servos, line=line), feetech.FAMILY.open(), interlock=Gate()))
    devices = {node: feetech.Servo(bus, node) for node in (ID, NOBODY)}

    def read(node: int) -> int | None:
        block = read_block(devices[node], POSITION, 2, lambda data: int.from_bytes(data, "little"))
        value: int | None = _value(bus, block)
        return value

    def write(node: int) -> bool:
        return _done(bus, feetech.Servo.disable_torque.function(devices[node]))

    return Reader(bus, servos, read, write, place)


def _kst(line: Line) -> Reader:
    there: Any = kst.FAMILY.simulator((ID,))

    def where(heard: int) -> int:
        return heard % 1801 - 900

    def turn(heard: int) -> None:
        there.nodes[ID].raw_position = where(heard)

    servos = Turning(there, turn)
    bus = Bus(MemoryLink(servos, rate=500_000, line=line, pace=True), kst.FAMILY.open(), interlock=Gate())
    devices = {node: kst.Servo(bus, node) for node in (ID, NOBODY)}

    def read(node: int) -> int | None:
        device = devices[node]
        value = _value(bus, kst.Servo.position.function(device))
        return None if value is None else device.table["present_position"].to_raw(value)

    return Reader(bus, servos, read, None, where)


def _stepper(line: Line) -> Reader:
    there: Any = stepper.FAMILY.simulator((ID,))
    store = there.nodes[ID].store
    image = store.image(1)

    def where(heard: int) -> int:
        return heard % (1 << 8 * TAIL)

    def turn(heard: int) -> None:
        store.stored[1] = store.working = image[:-TAIL] + where(heard).to_bytes(TAIL, "little")

    servos = Turning(there, turn)
    bus = _opened(
        Bus(MemoryLink(servos, rate=9600, line=line, pace=True), stepper.FAMILY.open(), interlock=Gate())
    )
    device = stepper.Controller(bus)

    def read(node: int) -> int | None:
        data = _value(bus, dump_once(device, 1))
        return None if data is None else int.from_bytes(data[-TAIL:], "little")

    def write(node: int) -> bool:
        return _done(bus, stepper.Controller.stop.function(device))

    return Reader(bus, servos, read, write, where)


def late(name: str, seed: int, count: int) -> Tally:
    """So many reads, 1 % of the replies late."""
    lateness = Lateness(seed, SHARE)
    one = reader(name, lateness)
    found = tally(lambda: one.read(ID), lambda: one.servos.heard, count, one.where)
    return found._replace(late=lateness.late)


def echo(name: str, seed: int, count: int = ECHOES) -> dict[str, Tally]:
    """Reads of who is there, and orders to nobody, on a line that echoes."""
    one = reader(name, Lateness(seed, 0.0), echo=True)
    found = {"read": tally(lambda: one.read(ID), lambda: one.servos.heard, count, one.where)}
    silent = reader(name, Lateness(seed, 1.0), echo=True)
    silent.servos.there = Nobody(silent.servos.there)
    found["read nobody"] = forged(lambda: silent.read(NOBODY) is not None, count)
    write = silent.write
    if write is not None:
        found["write nobody"] = forged(lambda: write(NOBODY), count)
    return found


class Nobody:
    """A simulator whose devices have gone."""

    def __init__(self, there: Simulator) -> None:
        self.nodes = there.nodes

    def receive(self, data: Data, at: float) -> None:
        """Nobody hears it."""

    def advance(self, to: float) -> list[tuple[float, Data]]:
        return []

    def due(self) -> float | None:
        return None

    def tune(self, rate: int) -> None:
        """Nobody has a rate."""
