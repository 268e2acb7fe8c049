"""KST CAN servos, and the makers that share their protocol: an expedited subset of CANopen SDO.

`Servo` and `AsyncServo` are one servo each; the functions serve a whole bus. No servo reports its maker, so a bus is
opened with a profile (`kst:PORT,profile=xqpower`).
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
from motorbus.core.guarantees import Guarantee, Guarantees, Level
from motorbus.core.recording import RecordingReceiver
from motorbus.core.register import RegisterMap
from motorbus.core.request import Request, Response
from motorbus.core.scan import Skipped
from motorbus.core.steps import Procedure, Runnable
from motorbus.errors import RequestError
from motorbus.families.kst.driver import bus, feedback, identity, motion, stream
from motorbus.families.kst.driver.broadcast import (
    broadcast_bit_rate,
    broadcast_node_id,
    broadcast_position,
    broadcast_read,
    broadcast_save,
)
from motorbus.families.kst.driver.feedback import RawStatus, Status
from motorbus.families.kst.driver.motion import Promise, Started
from motorbus.families.kst.driver.node import DEFAULT, ID_FORMATS, NMT, SIZED, BusSettings, Node
from motorbus.families.kst.driver.provisioning import PowerCycleNeeded, Provisioned
from motorbus.families.kst.driver.scan import BitRates, LineActivity, Suspicion, scan, scan_bit_rates
from motorbus.families.kst.driver.servo import AsyncServo, Servo, settings_of
from motorbus.families.kst.notifications import BusState, FrameReceiver
from motorbus.families.kst.profiles import DEFAULT_RATE, PROFILES, RATES, TABLES

__all__ = [
    "FAMILY",
    "AsyncServo",
    "BitRates",
    "BusSettings",
    "Kst",
    "LineActivity",
    "Node",
    "PowerCycleNeeded",
    "Promise",
    "Provisioned",
    "RawStatus",
    "Servo",
    "Skipped",
    "Started",
    "Status",
    "Suspicion",
    "broadcast_bit_rate",
    "broadcast_node_id",
    "broadcast_position",
    "broadcast_read",
    "broadcast_save",
    "scan",
    "scan_bit_rates",
    "settings_of",
]

_SETTINGS: Final = (
    Option("profile", str, "kst", f"the make of the servos: {', '.join(PROFILES)}; no servo reports it"),
    Option("id_format", str, "std", "identifiers of 11 bits (std) or 29 (ext)", ID_FORMATS),
    Option("sized", str, "no", "whether writes state their length", SIZED),
    Option("nmt", str, "profile", "form of start and stop: profile, none, vendor or standard", NMT),
)

GUARANTEES: Final = Guarantees(
    measured=Guarantee(Level.YES, "it tells it when it is asked"),
    limits=Guarantee(
        Level.PARTLY, "the range of its make, as the bus is configured: no servo tells its make"
    ),
    stop=Guarantee(Level.PARTLY, Promise.HOLD_REQUESTED.value),
    estops={"hold": Guarantee(Level.PARTLY, Promise.HOLD_REQUESTED.value)},
    alone=Guarantee(
        Level.PARTLY,
        "in a loop, it moves to its last goal, one cycle ahead, and holds; in a move of its own, it moves to its goal",
    ),
    ends=Guarantee(Level.YES, "every goal is a position"),
    torque=Guarantee(Level.NO, "none: it holds with full force while it has its supply"),
    restart=Guarantee(
        Level.PARTLY,
        "a boot-up message of CANopen is a fault; no sheet promises that message, and a lost frame is not seen",
    ),
    strain=Guarantee(
        Level.PARTLY,
        "current and temperature, where its make reports them; off its goal for too long counts as stalled in any case",
    ),
    watchdog=Guarantee(Level.NO, "none: it moves to its last goal and holds"),
    led=True,
)
"""Source: the CAN protocol sheets of the makers: a target position, and no stop, torque switch or heartbeat."""

_AXIS: Final[Mapping[str, Callable[..., Runnable[Any]]]] = {
    "state": feedback.telemetry,
    "position": feedback.position,
    "health": feedback.health,
    "move": motion.move,
    "stop": motion.stop,
    "limits": motion.limits,
    "travel": motion.travel,
    "train": stream.open_stream,
}


class Kst:
    """The family of KST CAN servos; see `core.family.Family` for each member."""

    name: Final = "kst"
    tables: Final[Mapping[str, RegisterMap]] = TABLES
    devices: Final = Devices(Servo, AsyncServo, GUARANTEES)

    def __init__(self, settings: BusSettings = DEFAULT) -> None:
        self._settings = settings

    @cached_property
    def link(self) -> LinkNeeds:
        from motorbus.families.kst.simulator import OPTIONS

        return LinkNeeds(
            "frames",
            DEFAULT_RATE,
            RATES,
            OPTIONS,
            _SETTINGS,
            bus.WINDOW,
            stops=("hold",),
        )

    def configured(self, **settings: object) -> Kst:
        unknown = settings.keys() - {option.name for option in _SETTINGS}
        if unknown:
            raise RequestError(
                f"a kst bus has no setting {min(unknown)!r}",
                expected=f"one of {', '.join(option.name for option in _SETTINGS)}",
            )
        return Kst(self._settings.replace(state=BusState(), **settings))

    def lane(self, node: int) -> int:
        return node

    def air_time(self, request: Request[Any], rate: int) -> float:
        return bus.air_time(request, rate)

    def turnaround(self, request: Request[Any]) -> float:
        return bus.response_delay(request, self._settings.profile.flash_wait)

    def quiet_time(self, rate: int) -> float:
        return bus.quiet_time(rate)

    def echo_test(self) -> None:
        return None  # a CAN controller does not receive its own frames

    def explain(self, data: bytes) -> list[Explanation]:
        from motorbus.families.kst.decode import decode

        return decode(data, self._settings.profile)

    def receiver(self) -> Receiver:
        return FrameReceiver(self._settings.extended, self._settings.state)

    def recording_receiver(self, direction: str) -> RecordingReceiver:
        from motorbus.families.kst.recording import Recording

        return Recording()

    def probe(self, node: int, attempt: int) -> Request[bool]:
        return bus.probe(Node(node, self._settings), attempt)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        return bus.stop(nodes, self._settings)

    def identify(self, node: int) -> Runnable[Identity]:
        return identity.identify(Node(node, self._settings))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        return scan(ids, rates, self._settings)

    def axis(self, model: str) -> Mapping[str, Callable[..., Runnable[Any]]]:
        for profile in PROFILES.values():
            if model in (profile.name, profile.title):
                if profile.status_row is None:
                    return _AXIS
                return {**_AXIS, "current": feedback.current, "temperature": feedback.temperature}
        return {}

    def simulator(self, ids: tuple[int, ...], model: str = "", **options: object) -> Simulator:
        from motorbus.families.kst.simulator import simulate

        if not model:
            options.setdefault("profile", self._settings.profile.name)
        return simulate(ids, model, **options)


FAMILY: Final = Kst()
