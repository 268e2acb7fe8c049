"""FEETECH SCS, SMS, STS and HLS servos on a half-duplex serial bus: all six register maps.

`Servo` and `AsyncServo` are one servo each; the functions serve several at once, or are kept for a loop. `FAMILY`
is what the rest of motorbus knows of these servos.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from motorbus.core.half_duplex import HalfDuplexSerial
from motorbus.core.request import Request, Response
from motorbus.core.steps import Procedure, Runnable
from motorbus.families.feetech import driver, wire
from motorbus.families.feetech.driver import (
    AsyncServo,
    Calibration,
    GroupResult,
    Node,
    Positions,
    Promise,
    Recovery,
    Servo,
    States,
    SyncWriter,
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
from motorbus.families.feetech.table import BAUD_CODES, CONTROL, MODELS, TABLES

__all__ = [
    "FAMILY",
    "AsyncServo",
    "Calibration",
    "FeetechDriver",
    "GroupResult",
    "Node",
    "Positions",
    "Promise",
    "Recovery",
    "Servo",
    "States",
    "SyncWriter",
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

_AXIS: Final = AxisDriver(
    state=driver.telemetry,
    position=driver.position,
    velocity=driver.velocity,
    load=driver.load,
    current=driver.current,
    voltage=driver.voltage,
    temperature=driver.temperature,
    health=driver.health,
    enable_torque=driver.enable_torque,
    disable_torque=driver.disable_torque,
    move=driver.move,
    stop=driver.stop,
    limits=driver.limits,
    travel=driver.travel,
    cap_torque=driver.cap_torque,
    cap_current=driver.cap_current,
    stream=driver.train,
)
_ONLY_WHERE: Final[Mapping[str, Callable[[str], object]]] = {
    "current": lambda register_map: TABLES[register_map]["present_current"].unit,
    "cap_torque": lambda register_map: CONTROL[register_map].limit,
    "cap_current": lambda register_map: CONTROL[register_map].current,
}
"""Capabilities of servos of some maps only, and which maps these are."""


class FeetechDriver(HalfDuplexSerial):
    """FEETECH servos on one open bus; see `core.family.BusDriver`. `estop_hold`: ids that an emergency stop holds."""

    delays = line.DELAYS
    delay_per_reply = line.RETURN_DELAY
    broadcast_delay = line.COLLISION
    broadcast_bytes = line.BROADCAST_BYTES
    longest_reply = line.LONGEST
    longest_gap = line.LONGEST_GAP

    def __init__(self, family: Family, estop_hold: Any = None) -> None:
        super().__init__(family)
        self._hold: Final = frozenset() if estop_hold is None else holding.held_ids(estop_hold)

    def echo_test(self) -> Request[Any]:
        return line.echo_test()

    def receiver(self) -> Receiver:
        return wire.StatusReceiver()

    def probe(self, node: int, attempt: int) -> Request[bool]:
        return line.probe(node, attempt)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        return line.stop(nodes, self._hold)

    def identify(self, node: int) -> Runnable[Identity]:
        return driver.identify(Node(node))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        return scan(ids, rates, polls=driver.GLANCE)

    def axis(self, identity: Identity) -> AxisDriver:
        maps = {identity.table} & TABLES.keys()
        if not maps:  # a known model with firmware of an unknown map is read and stopped
            maps = {name for known in MODELS.values() if known.name == identity.model for name in known.maps}
        lacks = {name for name, does in _ONLY_WHERE.items() if not all(map(does, maps))}
        return AxisDriver(**{name: getattr(_AXIS, name) for name in _AXIS.names - lacks if maps})

    def decode(self, data: bytes) -> list[Explanation]:
        from motorbus.families.feetech.explain import explain

        return explain(data)


_ESTOP_HOLD: Final = Option(
    "estop_hold",
    str,
    "",
    "ids of servos that an emergency stop holds where they are, as 1+4, instead of letting them go",
)


FAMILY: Final = Family(
    name="feetech",
    link=LinkSpec(
        "bytes",
        BAUD_CODES[0],
        tuple(BAUD_CODES.values()),
        (_ESTOP_HOLD,),
        stops=("torque_off", "hold"),
    ),
    registers=TABLES,
    devices=DeviceTypes(Servo, AsyncServo),
    driver=FeetechDriver,
    simulator_module="motorbus.families.feetech.simulator",
    recording_module="motorbus.families.feetech.wire.recording",
    cli="motorbus.cli.feetech",
)
