"""FEETECH SCS, SMS, STS and HLS servos on a half-duplex serial bus: all six register maps.

`Servo` and `AsyncServo` are one servo each; the functions serve several at once, or are kept for a loop. `FAMILY`
is what the rest of motorbus knows of these servos.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, Final

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
from motorbus.core.recording import RecordingReceiver
from motorbus.core.register import RegisterMap
from motorbus.core.request import Request, Response
from motorbus.core.steps import Procedure, Runnable
from motorbus.errors import RequestError
from motorbus.families.feetech import driver, wire
from motorbus.families.feetech.driver import (
    AsyncServo,
    Calibration,
    Gains,
    GroupResult,
    Node,
    Positions,
    Promise,
    Protection,
    Recovery,
    Servo,
    States,
    SyncWriter,
    TorqueLimit,
    Zero,
    action_all,
    copyable,
    disable_torque_all,
    holding,
    line,
    prepare_all,
    read_positions,
    reg_write_all,
    scan,
    sync_read,
    sync_read_positions,
    sync_read_raw,
    sync_read_states,
    sync_write,
    sync_write_positions,
    sync_writer,
)
from motorbus.families.feetech.driver.assured import ASSURANCE
from motorbus.families.feetech.table import BAUD_CODES, CONTROL, MODELS, TABLES

__all__ = [
    "FAMILY",
    "AsyncServo",
    "Calibration",
    "Feetech",
    "Gains",
    "GroupResult",
    "Node",
    "Positions",
    "Promise",
    "Protection",
    "Recovery",
    "Servo",
    "States",
    "SyncWriter",
    "TorqueLimit",
    "Zero",
    "action_all",
    "copyable",
    "disable_torque_all",
    "prepare_all",
    "read_positions",
    "reg_write_all",
    "scan",
    "sync_read",
    "sync_read_positions",
    "sync_read_raw",
    "sync_read_states",
    "sync_write",
    "sync_write_positions",
    "sync_writer",
]

_AXIS: Final[Mapping[str, Callable[..., Runnable[Any]]]] = {
    "state": driver.telemetry,
    "position": driver.position,
    "velocity": driver.velocity,
    "load": driver.load,
    "current": driver.current,
    "voltage": driver.voltage,
    "temperature": driver.temperature,
    "health": driver.health,
    "enable_torque": driver.enable_torque,
    "disable_torque": driver.disable_torque,
    "move": driver.move,
    "stop": driver.stop,
    "limits": driver.limits,
    "travel": driver.travel,
    "cap_torque": driver.cap_torque,
    "cap_current": driver.cap_current,
    "train": driver.train,
}
_ONLY_WHERE: Final[Mapping[str, Callable[[str], object]]] = {
    "current": lambda register_map: TABLES[register_map]["present_current"].unit,
    "cap_torque": lambda register_map: CONTROL[register_map].limit,
    "cap_current": lambda register_map: CONTROL[register_map].current,
}
"""What only servos of some maps can, and which maps these are."""

_SETTINGS: Final = (
    Option(
        "estop_hold",
        str,
        "",
        "ids of servos that an emergency stop holds where they are, as 1+4, instead of letting them go",
    ),
)


class Feetech:
    """The family of FEETECH servos; see `motorbus.core.family.Family` for each member."""

    name: Final = "feetech"
    tables: Final[Mapping[str, RegisterMap]] = TABLES
    devices: Final = Devices(Servo, AsyncServo, ASSURANCE)

    def __init__(self, hold: frozenset[int] = frozenset()) -> None:
        self._hold: Final = hold

    @cached_property
    def link(self) -> LinkNeeds:
        from motorbus.families.feetech.simulator import OPTIONS

        usual = BAUD_CODES[0]
        options = (
            Option(
                "baud", int, usual, "rate of the bus in bit/s; servos of the STS series ship with 1000000"
            ),
            Option("ids", str, "1", "ids of the simulated servos, as 1-6 or 1+4+7"),
            Option("model", str, "sts3215", "model of the simulated servos, or one for each joined by +"),
        )
        return LinkNeeds(
            "bytes",
            usual,
            tuple(BAUD_CODES.values()),
            (*options, *OPTIONS),
            _SETTINGS,
            stops=("torque_off", "hold"),
        )

    def configured(self, **settings: object) -> Feetech:
        unknown = settings.keys() - {option.name for option in _SETTINGS}
        if unknown:
            raise RequestError(
                f"a feetech bus has no setting {min(unknown)!r}",
                expected=f"one of {', '.join(option.name for option in _SETTINGS)}",
            )
        said: Any = settings.get("estop_hold")
        return self if said is None else Feetech(holding.held_ids(said))

    def lane(self, node: int) -> int:
        return 0

    def air_time(self, request: Request[Any], rate: int) -> float:
        return line.air_time(request, rate)

    def turnaround(self, request: Request[Any]) -> float:
        return line.turnaround(request)

    def quiet_time(self, rate: int) -> float:
        return line.quiet_time(rate)

    def echo_test(self) -> Request[Any]:
        return line.echo_test()

    def explain(self, data: bytes) -> list[Explanation]:
        from motorbus.families.feetech.explain import explain

        return explain(data)

    def receiver(self) -> Receiver:
        return wire.StatusReceiver()

    def recording_receiver(self, direction: str) -> RecordingReceiver:
        from motorbus.families.feetech.wire.recording import Recording

        return Recording(direction)

    def probe(self, node: int, attempt: int) -> Request[bool]:
        return line.probe(node, attempt)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        return line.stop(nodes, self._hold)

    def identify(self, node: int) -> Runnable[Identity]:
        return driver.identify(Node(node))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        return scan(ids, rates, polls=driver.GLANCE)

    def axis(self, model: str) -> Mapping[str, Callable[..., Runnable[Any]]]:
        maps = {name for known in MODELS.values() if known.name == model.upper() for name in known.maps}
        lacks = {name for name, does in _ONLY_WHERE.items() if not all(map(does, maps))}
        return {name: one for name, one in _AXIS.items() if name not in lacks} if maps else {}

    def simulator(self, ids: tuple[int, ...], model: str = "", **options: object) -> Simulator:
        from motorbus.families.feetech.simulator import simulate

        return simulate(ids, model, **options)


FAMILY: Final = Feetech()
