"""rustypot's other calls: what a controller has beside its registers, its bus of mixed servos, its definitions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from motorbus.families.feetech.traits import TRAITS
from tests.interop.feetech.peer import Peer, kept
from tests.interop.feetech.steps import Anything, Call, Held, Raised, Step
from tests.interop.feetech.twin import ABSENT, HLS, IDS, SCS, STS, Kind

CONTROLLERS: Final = ("Sts3215", "Scs0009", "Scs0043")
TIMEOUT: Final = 0.05
NODES: Final = [1, 2]
GAIN, GOAL = 21, 42
ALARMS: Final = {(1, 14): [30], (1, 13): [20]}
BUS: Final = (STS, SCS, HLS)


def prepare(peer: Peer, controller: str, port: str) -> None:
    """Open the port with this controller and keep its definition."""
    peer.new("controller", f"{controller}PyController", port, 1_000_000, TIMEOUT)


def talks(controller: str, kind: Kind) -> Iterator[Step]:
    """What it says to servos beside registers by their generated calls."""
    yield Step((Call("controller", "ping", (1,), True), Call("controller", "ping", (253,), True)))
    yield Step((Call("controller", "ping", (ABSENT,), False),))
    yield Step((Call("controller", "ping", (1,), True),), before=ALARMS)
    yield from _scans(controller, kind)
    yield from _raw(kind)
    yield from _named(controller, kind)
    yield Step((Call("controller", "reboot", (1,), False),), why="reboot-is-bootloader")
    yield Step((Call("controller", "factory_reset", (1,), Raised("not supported")),), why="reset-keeping")
    yield Step(
        (Call("controller", "factory_reset", (1, False, False)),),
        before={(1, GAIN): [99]},
        why="factory-reset",
        status={"id": 1},
    )
    yield from _port()


def _scans(controller: str, kind: Kind) -> Iterator[Step]:
    little = controller != "Scs0009"
    if controller == "Scs0043":
        for name in ("scan", "broadcast_scan"):
            yield Step(
                (Call("controller", name, ([1],), Raised("no register named")),), why="scan-without-number"
            )
        return
    number = (
        kind.number if little == (kind.order == "little") else kind.number >> 8 | (kind.number & 255) << 8
    )
    why = "" if number == kind.number else "number-swapped"
    found = [[1, number], [2, number], [253, number]]
    yield Step((Call("controller", "scan", ([1, 2, ABSENT, 253],), found),), why=why)
    alone = ("unplug 2", "unplug 253")
    if not TRAITS[kind.map].broadcast_ping and controller == "Sts3215":
        yield Step((Call("controller", "broadcast_scan", ([1, 2, 253],), []),), why="no-broadcast-ping")
        return
    if controller != "Sts3215":
        yield Step(
            (Call("controller", "broadcast_scan", ([1],), Raised("broadcast ping")),), why="no-broadcast-ping"
        )
        return
    yield Step((Call("controller", "broadcast_scan", ([1],), [[1, number]]),), orders=alone, why=why)
    yield Step(
        (Call("controller", "broadcast_scan", ([1, 2, 253],), Anything("garbled")),), why="broadcast-collides"
    )


def _raw(kind: Kind) -> Iterator[Step]:
    def call(name: str, *arguments: Any, gives: Any = None, **more: Any) -> Step:
        return Step((Call("controller", name, arguments, gives),), **more)

    one, both = Held(1, 0, 5, True), [Held(node, 0, 5, True) for node in NODES]
    yield call("read_raw_data", 1, 0, 5, gives=one)
    yield call("read_raw_data_with_error", 1, 0, 5, gives=[one, 0])
    yield call("read_raw_data_with_error", 1, 0, 5, gives=[one, 5], before=ALARMS)
    yield call("read_raw_data", ABSENT, 0, 5, gives=Raised("timed out"))
    wrote = {(1, GAIN): [33, 31]}
    yield call("write_raw_data", 1, GAIN, [33, 31], after=wrote)
    yield call("write_raw_data_with_error", 1, GAIN, [33, 31], gives=0, after=wrote)
    yield call("write_raw_data_with_error", 1, GAIN, [33, 31], gives=5, before=ALARMS, after=wrote)
    twice = {(node, GAIN): [33, 31] for node in NODES}
    yield call("sync_write_raw_data", NODES, GAIN, [[33, 31]] * 2, after=twice)
    if TRAITS[kind.map].sync_read:
        yield call("sync_read_raw_data", NODES, 0, 5, gives=both)
        yield call("sync_read_raw_data_with_error", NODES, 0, 5, gives=[[one, 0] for one in both])
        lost = Raised(f"motor {ABSENT}")
        yield call("sync_read_raw_data", [1, ABSENT, 2], 0, 5, gives=lost, why="all-or-nothing")
        return
    for name in ("sync_read_raw_data", "sync_read_raw_data_with_error"):
        yield call(name, NODES, 0, 5, gives=Raised("timed out"), why="no-sync-read")


def _named(controller: str, kind: Kind) -> Iterator[Step]:
    """Registers by name, encoded by the definition and not by the units of the generated calls."""
    little = controller != "Scs0009"
    goal = 300

    def data(value: int) -> list[int]:
        return list(value.to_bytes(2, "little" if little else "big"))

    why = "" if little == (kind.order == "little") else "other-order"
    before = {(node, GOAL): data(goal) for node in NODES}
    one, both = (1, "goal_position"), (NODES, "goal_position")
    gives: Any
    for name, gives in (("read_register", goal), ("read_register_with_error", [goal, 0])):
        yield Step((Call("controller", name, one, gives),), before=before, why=why)
    # The definition decides whether it asks all at once; a servo that does not know SYNC READ then stays silent.
    asks_all = controller != "Scs0009"
    silent = asks_all and not TRAITS[kind.map].sync_read
    for name, gives in (
        ("sync_read_register", [goal] * 2),
        ("sync_read_register_with_error", [[goal, 0]] * 2),
    ):
        wanted = Raised("timed out") if silent else gives
        more = f"{why} no-sync-read".strip() if silent else why
        yield Step((Call("controller", name, both, wanted),), before=before, why=more)
    for name, gives in (("write_register", None), ("write_register_with_error", 0)):
        yield Step((Call("controller", name, (*one, goal), gives),), after={(1, GOAL): data(goal)}, why=why)
    yield Step((Call("controller", "sync_write_register", (*both, [goal, goal])),), after=before, why=why)
    if controller == "Sts3215" and kind.order == "little":
        signed = {(1, GOAL): kind.signed("goal_position", -300)}
        yield Step((Call("controller", "write_register", (*one, -300)),), after=signed)
        yield Step((Call("controller", "read_register", one, -300),), before=signed)
    yield Step((Call("controller", "read_register", (1, "none"), Raised("none")),))


def _port() -> Iterator[Step]:
    yield Step(
        (
            Call("controller", "set_baudrate", (500_000,)),
            Call("controller", "ping", (1,), False),
            Call("controller", "set_baudrate", (1_000_000,)),
            Call("controller", "ping", (1,), True),
        )
    )
    yield Step(
        (
            Call("controller", "set_timeout", (TIMEOUT,)),
            Call("controller", "set_timeout", (-1.0,), Raised("")),
        )
    )
    yield Step((Call("controller", "is_open", (), True),))


def closing() -> Iterator[Step]:
    """The last: afterwards it is of no use."""
    end = Call("controller", "close", ())
    yield Step(
        (end, Call("controller", "is_open", (), False), Call("controller", "ping", (1,), Raised("")), end)
    )


def prepare_bus(peer: Peer, port: str) -> None:
    """One bus with three kinds: an STS, an SCS, and an HLS that is told to be an STS, for it knows no HLS."""
    for name in CONTROLLERS:
        peer.new(name, f"{name}PyController.definition")
    motors = [[1, kept("Sts3215")], [2, kept("Scs0009")], [253, kept("Sts3215")]]
    peer.new("bus", "Bus", port, 1_000_000, TIMEOUT, {"pairs": motors})


def bus() -> Iterator[Step]:
    """Every call of its bus, on servos of three kinds at once."""

    def call(name: str, *arguments: Any, gives: Any = None, **more: Any) -> Step:
        return Step((Call("bus", name, arguments, gives),), **more)

    ids = list(IDS)
    goals = {(1, GOAL): [0x2C, 1], (2, GOAL): [1, 0x2C], (253, GOAL): [0x2C, 1]}
    yield call("read_register", 2, "goal_position", gives=300, before=goals)
    yield call("read_register_with_error", 1, "goal_position", gives=[300, 0], before=goals)
    yield call("sync_read_register", ids, "goal_position", gives=[300] * 3, before=goals)
    yield call("sync_read_register_with_error", ids, "goal_position", gives=[[300, 0]] * 3, before=goals)
    yield call("write_register", 2, "goal_position", 300, after={(2, GOAL): [1, 0x2C]})
    yield call(
        "write_register", 1, "goal_position", -300, after={(1, GOAL): STS.signed("goal_position", -300)}
    )
    yield call(
        "write_register_with_error", 253, "goal_position", 300, gives=0, after={(253, GOAL): [0x2C, 1]}
    )
    yield call("sync_write_register", ids, "goal_position", [300] * 3, after=goals)
    on = {(1, 40): [1], (1, 55): [1], (2, 40): [1], (2, 48): [1]}
    off = {(1, 40): [0], (1, 55): [0], (2, 40): [0], (2, 48): [0]}
    yield call("set_torque", ids, True, gives=[], after=on, why="lock-follows-torque")
    yield call("set_torque", ids, False, gives=[], after=off, why="lock-follows-torque")
    failed = [[ABSENT, f"no motor with id {ABSENT} on this bus"]]
    yield call("set_torque", [1, ABSENT], True, gives=failed, after={(1, 40): [1]})
    yield call("scan", kept("Sts3215"), [1, ABSENT], gives=[[1, 777]])
    yield call("scan", kept("Scs0009"), [2], gives=[[2, 1284]])
    alone = tuple(f"unplug {node}" for node in IDS if node != 1)
    yield call("broadcast_scan", kept("Sts3215"), [1], gives=[[1, 777]], orders=alone)
    yield Step((Call("bus", "set_baudrate", (1_000_000,)), Call("bus", "set_timeout", (TIMEOUT,))))
    yield Step(
        (Call("bus", "__enter__", (), Anything("itself")), Call("bus", "__exit__", (None, None, None)))
    )
    yield call("close")
