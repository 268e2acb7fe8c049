"""KST CAN servos, and the makers who share their protocol: an expedited subset of CANopen SDO.

`Servo` and `AsyncServo` are one servo each; the functions serve a whole bus. `FAMILY` is what the rest of motorbus
knows of these servos. No servo tells its make: a bus is configured (`kst:PORT,profile=xqpower`).
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
from motorbus.core.register import RegisterMap
from motorbus.core.request import Request, Response
from motorbus.core.steps import Procedure, Runnable
from motorbus.errors import RequestError
from motorbus.families.kst import driver, wire
from motorbus.families.kst.driver import (
    AsyncServo,
    BitRates,
    Dialect,
    Heard,
    Memory,
    Node,
    PowerCycleNeeded,
    Promise,
    Provisioned,
    RawStatus,
    Servo,
    Skipped,
    Started,
    Status,
    Suspicion,
    broadcast_bit_rate,
    broadcast_node_id,
    broadcast_position,
    broadcast_read,
    broadcast_save,
    dialect_of,
    line,
    scan,
    scan_bit_rates,
)
from motorbus.families.kst.driver.assured import ASSURANCE
from motorbus.families.kst.table import DEFAULT_RATE, PROFILES, RATES, TABLES

__all__ = [
    "FAMILY",
    "AsyncServo",
    "BitRates",
    "Dialect",
    "Heard",
    "Kst",
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
    "dialect_of",
    "scan",
    "scan_bit_rates",
]

_AXIS: Final[Mapping[str, Callable[..., Runnable[Any]]]] = {
    "state": driver.telemetry,
    "position": driver.position,
    "health": driver.health,
    "move": driver.move,
    "stop": driver.stop,
    "limits": driver.limits,
    "travel": driver.travel,
    "train": driver.train,
}
_FELT: Final[Mapping[str, Callable[..., Runnable[Any]]]] = {
    "current": driver.current,
    "temperature": driver.temperature,
}
_SETTINGS: Final = (
    Option("profile", str, "kst", f"the make of the servos: {', '.join(PROFILES)}; no servo tells it"),
    Option(
        "id_format", str, "std", "identifiers of 11 bits (std) or 29 (ext); auto asks each node in both once"
    ),
    Option(
        "sized",
        str,
        "auto",
        "whether writes state their length: no, yes, or auto (only where a node insists)",
    ),
    Option("nmt", str, "profile", "form of start and stop: profile, none, vendor or standard"),
    Option("window", int, driver.WINDOW, "nodes in flight at once, 1 to 127"),
)


class Kst:
    """The family of KST CAN servos; see `motorbus.core.family.Family` for each member.

    A `configured` one serves one open bus and keeps what that has taught it; `FAMILY` keeps nothing.
    """

    name: Final = "kst"
    tables: Final[Mapping[str, RegisterMap]] = TABLES
    devices: Final = Devices(Servo, AsyncServo, ASSURANCE)

    def __init__(self, dialect: Dialect = driver.PLAIN, window: int = driver.WINDOW) -> None:
        self._dialect = dialect
        self._window = window

    @cached_property
    def link(self) -> LinkNeeds:
        from motorbus.families.kst.simulator import OPTIONS
        from motorbus.families.kst.wire.recording import CAPTURES

        return LinkNeeds(
            "frames",
            DEFAULT_RATE,
            RATES,
            OPTIONS,
            _SETTINGS,
            self._window,
            stops=("hold",),
            captures=CAPTURES,
        )

    def configured(self, **settings: object) -> Kst:
        unknown = settings.keys() - {option.name for option in _SETTINGS}
        if unknown:
            raise RequestError(
                f"a kst bus has no setting {min(unknown)!r}",
                expected=f"one of {', '.join(option.name for option in _SETTINGS)}",
            )
        window = driver.window(settings.pop("window", self._window))
        old = self._dialect
        kept: dict[str, object] = {
            "profile": old.profile.name,
            "id_format": old.id_format,
            "sized": old.sized,
            "nmt": old.wanted_nmt,
        }
        return Kst(Dialect(**(kept | settings), memory=Memory()), window)

    def lane(self, node: int) -> int:
        return node

    def air_time(self, request: Request[Any], rate: int) -> float:
        return line.air_time(request, rate)

    def turnaround(self, request: Request[Any]) -> float:
        return line.turnaround(request, self._dialect.profile.flash_wait)

    def quiet_time(self, rate: int) -> float:
        return line.quiet_time(rate)

    def echo_test(self) -> None:
        return None  # a CAN controller does not hear itself

    def explain(self, data: bytes) -> list[Explanation]:
        from motorbus.families.kst.explain import explain

        return explain(data, self._dialect.profile)

    def receiver(self) -> Receiver:
        dialect = self._dialect
        if dialect.memory is None:
            return wire.FrameReceiver(dialect.formats)
        return driver.Ear(dialect.formats, dialect.memory)

    def probe(self, node: int, attempt: int) -> Request[bool]:
        return line.probe(Node(node, self._dialect), attempt)

    def stop(self, nodes: Mapping[int, Response | None]) -> Stop:
        return line.stop(nodes, self._dialect)

    def identify(self, node: int) -> Runnable[Identity]:
        return driver.identify(Node(node, self._dialect))

    def scan(self, ids: tuple[int, ...] = (), rates: tuple[int, ...] = ()) -> Procedure[list[Found]]:
        return scan(ids, rates, self._dialect)

    def axis(self, model: str) -> Mapping[str, Callable[..., Runnable[Any]]]:
        for profile in PROFILES.values():
            if model in (profile.name, profile.title):
                return _AXIS if profile.status_row is None else {**_AXIS, **_FELT}
        return {}

    def simulator(self, ids: tuple[int, ...], model: str = "", **options: object) -> Simulator:
        from motorbus.families.kst.simulator import simulate

        if not model:
            options.setdefault("profile", self._dialect.profile.name)
        return simulate(ids, model, **options)


FAMILY: Final = Kst()
