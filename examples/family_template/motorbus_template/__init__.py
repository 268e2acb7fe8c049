"""THE FAMILY: what motorbus knows of it. Here belong `FAMILY`, the device classes, and figures of the wire's timing.

Everything else is in the four rooms: `wire` (what the frames mean), `table` (what can be addressed), `driver` (what
to say to get a thing done), `simulator` (how a real one behaves). A family imports motorbus.core and
motorbus.errors only; driver and simulator never import each other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.device import AsyncDevice, AsyncRunner, BlockingDevice, BlockingRunner, device_method
from motorbus.core.family import (
    Devices,
    Explanation,
    Found,
    Identity,
    LinkNeeds,
    Option,
    Receiver,
    Simulator,
    Stop,
)
from motorbus.core.register import RegisterMap
from motorbus.core.request import ANY, Request, Response, TimeoutClass
from motorbus.core.steps import Procedure, Runnable

from . import driver, wire
from .scanning import scan
from .simulator import Metronomes
from .table import TABLE
from .train import train

RATE: Final = 500_000
TURNAROUND: Final = {TimeoutClass.REPLY: 0.005, TimeoutClass.SCAN: 0.002, TimeoutClass.STORE: 0.05}
"""s that a servo may take to answer."""


class _Methods(driver.Node):
    ping = device_method(driver.ping)
    identify = device_method(driver.identify)
    read = device_method(driver.read)
    write = device_method(driver.write)
    set_node_id = device_method(driver.set_node_id)
    position = device_method(driver.position)
    telemetry = device_method(driver.telemetry)
    move = device_method(driver.move)
    enable_torque = device_method(driver.enable_torque)
    disable_torque = device_method(driver.disable_torque)
    stop = device_method(driver.stop)


class Servo(_Methods, BlockingDevice):
    """A Metronome on a blocking bus."""

    def __init__(self, bus: BlockingRunner, node: int) -> None:
        driver.Node.__init__(self, node)
        BlockingDevice.__init__(self, bus)


class AsyncServo(_Methods, AsyncDevice):
    """A Metronome on an async bus."""

    def __init__(self, bus: AsyncRunner, node: int) -> None:
        driver.Node.__init__(self, node)
        AsyncDevice.__init__(self, bus)


_AXIS: Final[Mapping[str, Callable[..., Runnable[Any]]]] = {
    "state": driver.telemetry,
    "position": driver.position,
    "health": driver.health,
    "move": driver.move,
    "stop": driver.stop,
    "enable_torque": driver.enable_torque,
    "disable_torque": driver.disable_torque,
    "limits": driver.limits,
    "train": train,
}


class Template:
    """Fulfils `motorbus.core.family.Family`; no state."""

    name = "template"
    link = LinkNeeds(
        "frames",
        RATE,
        (RATE, 250_000),
        (Option("temperature", float, 25.0, "of the simulated servos, in °C; an alarm above 80"),),
        window=2,
    )
    tables: Mapping[str, RegisterMap] = {TABLE.name: TABLE}
    devices = Devices(Servo, AsyncServo)

    def configured(self, **settings: object) -> Template:
        """Every bus speaks it the same."""
        return self

    def lane(self, node: int) -> int:
        """Each node has a lane of its own."""
        return node

    def air_time(self, exchange: Request[Any], rate: int) -> float:
        """Seconds for the frames, each with the most stuff bits it can have."""
        due = () if exchange.expected is ANY else exchange.expected
        request = len(exchange.wire.data if isinstance(exchange.wire, CanFrame) else exchange.wire)
        return sum(_bits(length) for length in (request, *(one.length for one in due))) / rate

    def turnaround(self, exchange: Request[Any]) -> float:
        """A servo answers within `TURNAROUND`."""
        return TURNAROUND[exchange.reply_within]

    def quiet_time(self, rate: int) -> float:
        """A servo that is late is so by one EEPROM page at most."""
        return 0.02

    def echo_test(self) -> Request[Any] | None:
        """A CAN controller does not hear itself."""
        return None

    def explain(self, data: bytes) -> list[Explanation]:
        """Every frame in a run of bytes; see `wire.HEAD` for how frames stand in it."""
        return wire.explain(data)

    def receiver(self) -> Receiver:
        """Answers, reports, noise."""
        return wire.FrameReceiver()

    def probe(self, node: int, attempt: int) -> Request[bool]:
        """256 objects whose values are known."""
        return driver.proof(driver.Node(node), attempt)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        """They brake by themselves, so where they last were does not matter."""
        return driver.stop_all(tuple(nodes))

    def identify(self, node: int) -> Runnable[Identity]:
        """Model and firmware."""
        return driver.identify(driver.Node(node))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        """Every id, or these."""
        return scan(ids, rates)

    def axis(self, model: str) -> Mapping[str, Callable[..., Runnable[Any]]]:
        """Driver functions in SI units, by capability; what a model cannot do is absent."""
        return _AXIS if model == "metronome" else {}

    def simulator(self, ids: tuple[int, ...], model: str = "", **options: object) -> Simulator:
        """Raises RequestError for ids, models and options that do not exist."""
        return Metronomes(ids, model, **options)


def _bits(data: int) -> int:
    """Bits of a frame with an 11-bit identifier and so many data bytes, space and stuff bits included."""
    return 47 + 8 * data + (34 + 8 * data - 1) // 4


FAMILY = Template()
