"""The driver of one open bus: times, probe, stop, and what the controller can do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any, ClassVar, Final

from motorbus.core import units
from motorbus.core.family import AxisDriver, Explanation, Family, Identity, Receiver, Stop
from motorbus.core.half_duplex import BITS, HalfDuplexSerial
from motorbus.core.request import Request, Response, TimeoutClass
from motorbus.core.steps import Runnable
from motorbus.errors import NoReply, RequestError
from motorbus.families.stepper import protocol
from motorbus.families.stepper.driver import manual, run, stop
from motorbus.families.stepper.driver.node import STOPS, BusState, Node, command, ignore
from motorbus.families.stepper.driver.projects import dump_once
from motorbus.families.stepper.execution.ramp import TICK_MS
from motorbus.families.stepper.parameters import PROJECTS, checked_order

MODEL: Final = "stepper controller"
UNKNOWN: Final = "unknown"  # it reports no version
DUMP_END: Final = 0.6  # s from a request to the end of its dump, at 9600 baud # assumption
GAP: Final = 0.05  # s within an old reply # assumption

_AXIS: Final = AxisDriver(
    jog=manual.jog,
    home=manual.home,
    plan_move=manual.plan_move,
    run=run.run,
    stop=stop.stop,
)


class StepperDriver(HalfDuplexSerial):
    """A stepper controller on one open bus; see `core.family.BusDriver`. `state` is what was sent and read on it."""

    full_duplex = True  # a stop does not wait for the end of a dump
    probe_after = 0  # its probe takes 0.24 s; that no reply comes twice is an assumption
    ids: ClassVar[Sequence[int]] = (protocol.ONLY,)
    delays: ClassVar[Mapping[TimeoutClass, float]] = {
        TimeoutClass.REPLY: 0.2,
        TimeoutClass.SCAN: 0.2,
        TimeoutClass.STORE: 1.0,
    }  # assumption
    longest_reply: ClassVar[int] = protocol.DUMP_LENGTH
    longest_delay: ClassVar[float] = GAP

    def __init__(
        self,
        family: Family,
        motor: object = protocol.MOTOR,
        dump_order: object = "little",
        ramp_tick_ms: object = TICK_MS,
    ) -> None:
        super().__init__(family)
        try:
            number, self.tick_ms = units.whole(str(motor)), units.real(str(ramp_tick_ms))
        except ValueError:
            raise RequestError(f"motor={motor},ramp_tick_ms={ramp_tick_ms}: a number is needed") from None
        self.motor: Final = protocol.checked_motor(number)
        if not 1e-3 <= self.tick_ms <= 1e4:
            raise RequestError(f"ramp_tick_ms={ramp_tick_ms} is not possible", expected="0.001 to 10000")
        self.order: Final = checked_order(dump_order)
        self.state = BusState()

    def __copy__(self) -> StepperDriver:
        """A copy with a state of its own: what a dry run sends is not remembered."""
        copied = StepperDriver(self.family, self.motor, self.order, self.tick_ms)
        copied.state = deepcopy(self.state)
        return copied

    def node(self, node: int = protocol.ONLY) -> Node:
        """The controller of this bus. Raises RequestError for another id than 1."""
        return Node(node, self.motor, self.order, self.tick_ms, self.state)

    def turnaround(self, request: Request[Any]) -> float:
        expected = request.expected
        if isinstance(expected, tuple) and any(one.length == protocol.DUMP_LENGTH for one in expected):
            return DUMP_END - protocol.DUMP_LENGTH * BITS / protocol.RATE
        return super().turnaround(request)

    def receiver(self) -> Receiver:
        return protocol.Receiver()

    def probe(self, node: int, attempt: int) -> Request[bool]:
        """Read a project, in turn: the bus doubts the last replies, so what is known is forgotten.

        A frame that begins with a motor number or with 00 would write registers of an inertial sensor with this header.
        """
        self.state.projects.clear()
        self.state.selected = None
        number = attempt % PROJECTS + 1
        return dump_once(self.node(node), number).convert(
            lambda data: data[protocol.REPLY_LENGTH] in (0, number)
        )

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        """Both stop commands; without waiting for a reply if the controller has not replied yet."""
        requests = [command(self.node(), name, ignore) for name in STOPS]
        blind = [
            Request[Response](one.wire, (), priority=one.priority, effect=one.effect, repeatable=True)
            for one in requests
        ]
        return Stop(tuple(requests if nodes else blind), stop.Promise.STOP_ACCEPTED.value)

    def identify(self, node: int) -> Runnable[Identity]:
        return identify(self.node(node))

    def axis(self, identity: Identity) -> AxisDriver:
        return _AXIS if identity.model == MODEL else AxisDriver()

    def decode(self, data: bytes) -> list[Explanation]:
        from motorbus.families.stepper.decode import explain

        return explain(data, self.order)


async def ping(node: Node) -> bool:
    """Whether it replies with a dump of project 1; silence gives False."""
    try:
        await dump_once(node, 1)
    except NoReply:
        return False
    return True


async def identify(node: Node) -> Identity:
    """A controller that replies with a dump; it reports no model, version or number."""
    await dump_once(node, 1)
    return Identity(node.node, MODEL, UNKNOWN, node.table.name, {"motor": node.motor, "projects": PROJECTS})
