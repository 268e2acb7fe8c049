"""A programmable controller for one stepper motor: 27 commands, four stored projects of up to ten steps.

It answers with an acknowledgement, a project dump, the level of one input, and one message of its own: a project that
was started has ended. There is no position, no state and no error to ask for, so what a host shows while the motor
turns is a model. That model is `execution`, a pure function; `program` makes it a file that can be checked and timed
before a motor turns, and `simulator` makes it a device.

    Program      a project as a file, an image or frames: read, checked, timed, planned
    Conditions   what a project is judged against
    Behaviour    how a controller carries a project out where nobody knows
    Controller   a real one: read, write, run, jog, home, switch, watch, stop
    Difference   what writing a program would change and `Cost`, `Written` what came of it and, as `Proof`, how far
                 that is known
    Ran          what came of a run, as one `Outcome` of four; `Estimated` is its progress, which nobody tells
    Moved        what came of a jog or a move, `Homed` of homing, `Watched` of watching inputs
    Backup       what it had stored, as a file

`FAMILY` is what the rest of motorbus knows of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, Final

from motorbus.core.family import (
    AxisDriver,
    DeviceTypes,
    Explanation,
    Family,
    Found,
    Identity,
    LinkSpec,
    Option,
    Receiver,
    Stop,
)
from motorbus.core.request import Request, Response
from motorbus.core.steps import Procedure, Runnable
from motorbus.families.stepper import driver, wire
from motorbus.families.stepper.driver import (
    AsyncController,
    Controller,
    Cost,
    Difference,
    EditsLost,
    Estimated,
    Homed,
    InputChanged,
    Moved,
    Outcome,
    Planned,
    Promise,
    Proof,
    Ran,
    Sends,
    Slowing,
    Unrecorded,
    Watched,
    Written,
    line,
    presence,
    stopping,
)
from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.program import Conditions, Estimate, Finding, Plan, Program
from motorbus.families.stepper.program.backups import Backup
from motorbus.families.stepper.table import RATE, TABLES, checked_order

__all__ = [
    "FAMILY",
    "AsyncController",
    "Backup",
    "Behaviour",
    "Conditions",
    "Controller",
    "Cost",
    "Difference",
    "EditsLost",
    "Estimate",
    "Estimated",
    "Finding",
    "Homed",
    "InputChanged",
    "Moved",
    "Outcome",
    "Plan",
    "Planned",
    "Program",
    "Promise",
    "Proof",
    "Ran",
    "Sends",
    "Slowing",
    "StepperDriver",
    "Unrecorded",
    "Watched",
    "Written",
]

_SETTINGS: Final = (
    Option("motor", int, wire.MOTOR, "the number that motor commands name; the manual knows 3 only"),
    Option(
        "dump_order", str, "little", "which byte of a number comes first in a dump, the lowest or the highest",
        ("little", "big"),
        "stepper controller serial protocol manual has the lowest first in requests and says nothing of the dump",
    ),
)  # fmt: skip


_AXIS: Final = AxisDriver(
    move_by=driver.move_by,
    jog=driver.jog,
    home=driver.home,
    keep_time=driver.keep_time,
    run=driver.run,
    stop=driver.stop,
)
"""The controller reports no position, so it has no move to one."""


class StepperDriver:
    """A stepper controller on one open bus; see `core.family.BusDriver`. `memory` keeps what was sent on it."""

    window = 1
    full_duplex = True
    probe_after = 0  # assumption: a controller sends no reply twice; its probe takes 0.24 s

    def __init__(self, family: Family, motor: object = wire.MOTOR, dump_order: object = "little") -> None:
        self.family = family
        self.motor = driver.checked_motor(motor)
        self.order = checked_order(dump_order)
        self.memory = driver.Memory()

    def __copy__(self) -> StepperDriver:
        """A copy with a memory of its own: what a dry run sends is not remembered."""
        copied = StepperDriver(self.family, self.motor, self.order)
        copied.memory = deepcopy(self.memory)
        return copied

    def _node(self, node: int = wire.ONLY) -> driver.Node:
        return driver.Node(node, self.motor, self.order, self.memory)

    def air_time(self, request: Request[Any], rate: int) -> float:
        return line.air_time(request, rate)

    def turnaround(self, request: Request[Any]) -> float:
        return line.turnaround(request)

    def quiet_time(self, rate: int) -> float:
        return line.quiet_time(rate)

    def echo_test(self) -> Request[bytes]:
        return driver.dump_once(self._node(), 1)

    def receiver(self) -> Receiver:
        return wire.Receiver()

    def probe(self, node: int, attempt: int) -> Request[bool]:
        return presence.probe(self._node(node), attempt)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        return stopping.stop_all(nodes, self.motor)

    def identify(self, node: int) -> Runnable[Identity]:
        return driver.identify(self._node(node))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        return driver.scan(ids, rates, self.motor)

    def axis(self, identity: Identity) -> AxisDriver:
        return _AXIS if identity.model == presence.MODEL else AxisDriver()

    def decode(self, data: bytes) -> list[Explanation]:
        from motorbus.families.stepper.explain import explain

        return explain(data, self.order)


FAMILY: Final = Family(
    name="stepper",
    link=LinkSpec("bytes", RATE, (RATE,), _SETTINGS, only=wire.ONLY),
    registers=TABLES,
    devices=DeviceTypes(Controller, AsyncController),
    driver=StepperDriver,
    simulator_module="motorbus.families.stepper.simulator",
    recording_module="motorbus.families.stepper.wire.recording",
    cli="motorbus.cli.stepper",
)
