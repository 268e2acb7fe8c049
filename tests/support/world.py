"""A simulated bus with gate and simulator, and operations run one step at a time.

This file alone knows the engine (`motorbus.bus`). Every other helper and every test of the net takes a bus from
`make_bus`, and what no public property of a bus offers from the functions below it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any, Protocol, cast

from motorbus.bus.aio import AsyncBus
from motorbus.bus.attempt import Attempt
from motorbus.bus.base import BaseBus
from motorbus.bus.blocking import Bus
from motorbus.bus.engine import Engine
from motorbus.bus.interlock import DeviceLimits
from motorbus.bus.stop_socket import StopOutcome
from motorbus.bus.tasks import Tree
from motorbus.bus.trace import Subscription, TraceRecord
from motorbus.core.family import AxisDriver, BusDriver, Family
from motorbus.core.register import Register, RegisterMap
from motorbus.core.request import Data, Effect, Notification, Request, Step
from motorbus.core.steps import Exclusive, Gather, Runnable, Shielded, catch, discard, gather
from motorbus.errors import RequestError
from motorbus.link.base import Line, Link
from motorbus.link.memory import MemoryLink
from tests.support.subjects import possible, tables_of, vectors

__all__ = ["AsyncBus", "Bus", "StopOutcome", "Subscription", "TraceRecord"]

RETRIES = 2
"""How often a bus repeats a request that may be repeated."""

Notify = Callable[[object], None]


def make_bus(
    link: Link,
    driver: BusDriver,
    *,
    gate: bool = True,
    report: Notify | None = None,
    journal: Notify | None = None,
) -> Bus:
    """A blocking bus around a link that the test has made, with a gate that admits motion unless `gate` is off."""
    return Bus(link, driver, interlock=DeviceLimits() if gate else None, report=report, journal=journal)


def make_async_bus(
    link: Link, driver: BusDriver, *, report: Notify | None = None, journal: Notify | None = None
) -> AsyncBus:
    """An async bus around a link that the test has made."""
    return AsyncBus(link, driver, interlock=DeviceLimits(), report=report, journal=journal)


def is_stopping(bus: BaseBus) -> bool:
    """An emergency stop is being sent."""
    return bus.engine.stopping


class Queue:
    """Requests that wait on a bus, sent only by `turn`. `outcomes`: value or error of each, None while it waits."""

    def __init__(self, bus: BaseBus, requests: Sequence[Request[Any]]) -> None:
        self.bus = bus
        self.outcomes: list[Any] = [None] * len(requests)
        procedures = [self._carry_out(*one) for one in enumerate(requests)]
        self.tree: Tree[Any] = Tree(bus.engine, gather(*procedures), now=bus.link.now)

    async def _carry_out(self, number: int, request: Request[Any]) -> None:
        self.outcomes[number] = await catch(request)

    def turn(self, seconds: float) -> None:
        """Send what may be sent, and receive for at most so long."""
        bus, trees = self.bus, (self.tree,)
        self.tree.advance()
        bus.send(trees)
        bus.receive(bus.link.now() + seconds, trees)
        self.tree.advance()


class Interrupting(MemoryLink):
    """Raises KeyboardInterrupt at one call of `read` or `write`, before or after it; data of that `read` are lost."""

    countdown = 0
    after = False
    pressed = False

    def write(self, data: Data) -> None:
        self._count(False)
        super().write(data)
        self._count(True)

    def read(self, until: float) -> list[Data]:
        self._count(False)
        arrived = super().read(until)
        self._count(True)
        return arrived

    def _count(self, after: bool) -> None:
        if after is self.after and self.countdown:
            self.countdown -= 1
            if not self.countdown:
                self.pressed = True
                raise KeyboardInterrupt


class Tries:
    """The first try of each request, without a link: it is sent, these data arrive, and then silence."""

    SOON = 0.001
    """s from the request to its reply."""

    def __init__(self, family: Family, rate: int) -> None:
        self.engine = Engine(family.open(), rate=rate)

    def answered(self, request: Request[Any], data: list[Data]) -> tuple[Any, str]:
        """The answer, None where it failed, and the kind of failure of what is missing: `silence`, `checksum` …"""
        attempt = Attempt(request)
        self.engine.begin(attempt, 0.0)
        self.engine.written(attempt)
        self.engine.feed(data, self.SOON)
        self.engine.expire(attempt.deadline)
        return attempt.accepted, attempt.failure()


IDS = (1, 2, 3)
"""The devices of a world, where a line holds so many; a world knows its `ids`."""


class Memory(Protocol):
    """The raw value of every row of a simulated device."""

    def __getitem__(self, name: str, /) -> int: ...


class World:
    """A simulated bus of one family. `events` are what operations reported."""

    def __init__(
        self,
        family: Family,
        *,
        ids: tuple[int, ...] = IDS,
        line: Line | None = None,
        link: type[MemoryLink] = MemoryLink,
        rate: int = 0,
    ) -> None:
        self.family = family
        self.ids = possible(family, ids)
        self.simulator = family.simulator(self.ids)
        self.link = link(self.simulator, rate=rate or family.link.rate, line=line)
        self.events: list[object] = []
        self.bus = make_bus(self.link, family.open(), report=self.events.append)

    def async_bus(self) -> AsyncBus:
        """An async bus on the same link; use only one of the two at a time."""
        return make_async_bus(self.link, self.family.open(), report=self.events.append)

    def device(self, node: int) -> Any:
        """The device object of one id."""
        return self.family.devices.blocking(self.bus, node)

    def memory(self, node: int) -> Memory:
        """What the simulated device holds."""
        return cast("Memory", cast("Any", self.simulator.nodes[node]).memory)

    def table(self, node: int) -> RegisterMap:
        """The register table of the device."""
        return self.family.registers[self.bus.run(self.family.open().identify(node)).table]

    def settings(self) -> dict[int, dict[str, int]]:
        """All writable rows of all devices."""
        tables = tables_of(self.family)
        return {
            node: {
                name: held for table in tables for name in _writable(table) for held in self._held(node, name)
            }
            for node in self.simulator.nodes
        }

    def _held(self, node: int, name: str) -> list[int]:
        """The value of this row; [] where the table of the device has no such row."""
        try:
            return [self.memory(node)[name]]
        except (KeyError, RequestError):
            if len(tables_of(self.family)) == 1:
                raise
            return []

    def close(self) -> None:
        """Close the bus."""
        self.bus.close()


def _writable(table: RegisterMap) -> list[str]:
    return [row.name for row in table.values() if row.writable]


@contextmanager
def world(family: Family, **options: Any) -> Iterator[World]:
    """A world, closed at the end."""
    made = World(family, **options)
    try:
        yield made
    finally:
        made.close()


@contextmanager
def sent(bus: Bus) -> Iterator[list[Data]]:
    """Collect the data that the bus sends inside the block."""
    frames: list[Data] = []
    subscription = bus.trace.subscribe(limit=1_000_000)
    try:
        yield frames
    finally:
        bus.trace.unsubscribe(subscription)
        frames += [record.data for record in subscription if record.direction == "tx"]


def said(device: Any, verb: str, *arguments: object, **named: object) -> Runnable[Any]:
    """The operation of a verb of a device, not started."""
    return cast("Runnable[Any]", getattr(type(device), verb).function(device, *arguments, **named))


def has(family: Family, verb: str) -> bool:
    """Devices of this family have this verb."""
    return hasattr(family.devices.blocking, verb)


def moves(family: Family) -> bool:
    """Devices of this family can be moved."""
    return has(family, "move")


def has_torque_switch(family: Family) -> bool:
    """Whether the torque of devices that move can be switched off; some hold whenever they have power."""
    return moves(family) and has(family, "enable_torque")


def abilities(family: Family) -> AxisDriver:
    """The axis functions that the family offers for the model of its simulated device."""
    return _abilities(cast("Any", family))


@cache
def _abilities(family: Any) -> AxisDriver:
    with world(family) as there:
        found: AxisDriver = family.open().axis(there.device(there.ids[0]).identify())
        return found


def leads(family: Family) -> bool:
    """Whether a control loop can drive devices of this family."""
    return "stream" in abilities(family)


def switch_on(device: Any) -> None:
    """Switch torque on where the device has a switch for it."""
    if hasattr(device, "enable_torque"):
        device.enable_torque()


def reports(family: Family) -> list[Notification]:
    """The notices that devices of this family send without a request."""
    told = [vector.data for vector in vectors(family.name) if vector.direction == "status"]
    events = [event for data in told for event in family.open().receiver().feed(data)]
    return [event for event in events if isinstance(event, Notification)]


def locks(family: Family) -> list[Register]:
    """The rows named `lock`: what a guarded sequence opens and must close. Their choices say which is which."""
    return [table["lock"] for table in family.registers.values() if "lock" in table]


def closed(lock: Register) -> int:
    """The value that a lock has when it is closed."""
    values = [value for value, meaning in lock.choices.items() if meaning.startswith("closed")]
    assert len(values) == 1, "the choices of a lock say which value is closed"
    return values[0]


def plain(table: RegisterMap) -> list[Register]:
    """Rows that can be read and written in RAM without any effect."""
    rows = [row for row in table.values() if row.writable and row.readable and not row.protected]
    return [row for row in rows if row.effect is Effect.NONE]


def kept(table: RegisterMap) -> list[Register]:
    """The rows that a plain write by name keeps in EEPROM, by a guarded sequence."""
    rows = [row for row in table.values() if row.writable and not row.protected and row.name != "lock"]
    return [row for row in rows if row.effect is Effect.PERSISTENT]


def samples(row: Register) -> list[int]:
    """In-range raw values: both ends, what is next to them, what is next to 0, and some between."""
    span = row.high - row.low
    wanted = {
        row.low,
        row.low + 1,
        row.low + span // 3,
        row.low + span // 2,
        row.high - 1,
        row.high,
        -1,
        0,
        1,
    }
    if row.choices:
        wanted &= set(row.choices) or wanted
    return sorted(raw for raw in wanted if row.low <= raw <= row.high)


class Cut(BaseException):
    """An interruption of a type that the product does not know."""


class Steps:
    """Runs an operation step by step on the bus, and can cut it at any step.

    `cut_at` counts steps from 0; `before` cuts in place of the step, else when it has been carried out and its
    result is lost. `exchanges` are all that were carried out, `seen` is called after each step.
    """

    def __init__(
        self,
        bus: Bus,
        *,
        cut_at: int | None = None,
        before: bool = True,
        error: Callable[[], BaseException] = Cut,
        seen: Callable[[], None] = lambda: None,
    ) -> None:
        self.bus = bus
        self.cut_at = cut_at
        self.before = before
        self.error = error
        self.seen = seen
        self.count = 0
        self.cuts = 0
        self.requests: list[Request[Any]] = []

    def run(self, operation: Runnable[Any]) -> Any:
        """The value of the operation; raises what it raises."""
        generator = operation.__await__() if isinstance(operation, Step) else operation
        value: Any = None
        failure: BaseException | None = None
        while True:
            try:
                step = generator.send(value) if failure is None else generator.throw(failure)
            except StopIteration as end:
                return end.value
            value, failure = None, None
            try:
                value = self._carried_out(step)
            except BaseException as error:  # it is the operation's to deal with
                failure = error
                discard(step)

    def _carried_out(self, step: Step[Any]) -> Any:
        if isinstance(step, Exclusive):
            return self.run(step.runnable)
        if isinstance(step, Shielded):
            return self._run_shielded(step)
        if isinstance(step, Gather):
            return [self.run(operation) for operation in step.runnables]
        number, self.count = self.count, self.count + 1
        cuts = number == self.cut_at
        if cuts and self.before:
            raise self._cut()
        if isinstance(step, Request):
            self.requests.append(step)
        value = self.bus.run(step)
        self.seen()
        if cuts:
            raise self._cut()
        return value

    def _run_shielded(self, step: Shielded[Any]) -> Any:
        """Carry out the end of a guard; a cancellation in it is raised when it has ended."""
        cut_at, begun = self.cut_at, self.count
        if isinstance(self.error(), Exception):
            return self.run(step.runnable)
        self.cut_at = None
        value = self.run(step.runnable)
        self.cut_at = cut_at
        if cut_at is not None and begun <= cut_at < self.count:
            raise self._cut()
        return value

    def _cut(self) -> BaseException:
        self.cuts += 1
        return self.error()
