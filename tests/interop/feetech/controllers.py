"""rustypot: a controller of each kind, and its bus of mixed servos."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from motorbus.families.feetech.traits import TRAITS
from tests.interop.feetech.peer import Peer, kept
from tests.interop.feetech.steps import Call, Held, Raised, Step
from tests.interop.feetech.twin import ABSENT, HLS, IDS, SCS, STS, Kind

CONTROLLERS: Final = ("Sts3215", "Scs0009", "Scs0043")
TIMEOUT: Final = 0.05
NODES: Final = [1, 2]
GAIN, GOAL = 21, 42
ALARMS: Final = {(1, 14): [30], (1, 13): [20]}
BUS: Final = (STS, SCS, HLS)


def _step(name: str, *arguments: Any, gives: Any = None, owner: str = "controller", **more: Any) -> Step:
    return Step((Call(owner, name, arguments, gives),), **more)


def prepare(peer: Peer, controller: str, port: str) -> None:
    """Open the port with this controller."""
    peer.new("controller", f"{controller}PyController", port, 1_000_000, TIMEOUT)


def steps(controller: str, kind: Kind) -> Iterator[Step]:
    """Ping, scan, raw and named registers, reset."""
    for node in (1, 253, ABSENT):
        yield _step("ping", node, gives=node != ABSENT)
    yield _step("ping", 1, gives=True, before=ALARMS)
    yield from _scans(controller, kind)
    yield from _raw(kind)
    yield from _named(controller, kind)
    yield _step("reboot", 1, gives=False)  # the instruction starts the bootloader; the servo ignores it
    yield _step("factory_reset", 1, False, False, before={(1, GAIN): [99]}, status={"id": 1})


def _scans(controller: str, kind: Kind) -> Iterator[Step]:
    if controller == "Scs0043":
        yield _step("scan", [1], gives=Raised("no register named"))
        return
    is_swapped = (controller == "Scs0009") != (kind.order == "big")
    number = kind.number >> 8 | (kind.number & 255) << 8 if is_swapped else kind.number
    yield _step("scan", [1, 2, ABSENT, 253], gives=[[1, number], [2, number], [253, number]])
    if controller == "Scs0009":
        yield _step("broadcast_scan", [1], gives=Raised("broadcast ping"))
    elif not TRAITS[kind.map].broadcast_ping:
        yield _step("broadcast_scan", [1, 2, 253], gives=[])
    else:
        orders = ("unplug 2", "unplug 253")
        yield _step("broadcast_scan", [1], gives=[[1, number]], orders=orders)


def _raw(kind: Kind) -> Iterator[Step]:
    one, both = Held(1, 0, 5, True), [Held(node, 0, 5, True) for node in NODES]
    yield _step("read_raw_data", 1, 0, 5, gives=one)
    yield _step("read_raw_data_with_error", 1, 0, 5, gives=[one, 5], before=ALARMS)
    yield _step("read_raw_data", ABSENT, 0, 5, gives=Raised("timed out"))
    after = {(1, GAIN): [33, 31]}
    yield _step("write_raw_data", 1, GAIN, [33, 31], after=after)
    yield _step("write_raw_data_with_error", 1, GAIN, [33, 31], gives=5, before=ALARMS, after=after)
    twice = {(node, GAIN): [33, 31] for node in NODES}
    yield _step("sync_write_raw_data", NODES, GAIN, [[33, 31]] * 2, after=twice)
    name = "sync_read_raw_data"
    if TRAITS[kind.map].sync_read:
        yield _step(name, NODES, 0, 5, gives=both)
        yield _step(f"{name}_with_error", NODES, 0, 5, gives=[[one, 0] for one in both])
        yield _step(name, [1, ABSENT, 2], 0, 5, gives=Raised(f"motor {ABSENT}"))
    else:
        yield _step(name, NODES, 0, 5, gives=Raised("timed out"))


def _named(controller: str, kind: Kind) -> Iterator[Step]:
    """Registers by name, in the byte order of the controller."""
    goal, one, both = 300, (1, "goal_position"), (NODES, "goal_position")
    data = list(goal.to_bytes(2, "big" if controller == "Scs0009" else "little"))
    held = {(node, GOAL): data for node in NODES}
    yield _step("read_register", *one, gives=goal, before=held)
    yield _step("read_register_with_error", *one, gives=[goal, 0], before=held)
    # The controller for SCS reads one servo after the other; the others send SYNC READ.
    is_silent = controller != "Scs0009" and not TRAITS[kind.map].sync_read
    gives: Any = Raised("timed out") if is_silent else [goal] * 2
    yield _step("sync_read_register", *both, gives=gives, before=held)
    yield _step("write_register", *one, goal, after={(1, GOAL): data})
    yield _step("write_register_with_error", *one, goal, gives=0, after={(1, GOAL): data})
    yield _step("sync_write_register", *both, [goal, goal], after=held)
    if controller == "Sts3215" and kind.order == "little":
        signed = {(1, GOAL): kind.signed("goal_position", -300)}
        yield _step("write_register", *one, -300, after=signed)
        yield _step("read_register", *one, gives=-300, before=signed)


def prepare_bus(peer: Peer, port: str) -> None:
    """One bus with an STS, an SCS, and an HLS as an STS: the library has no HLS."""
    for name in CONTROLLERS:
        peer.new(name, f"{name}PyController.definition")
    motors = [[1, kept("Sts3215")], [2, kept("Scs0009")], [253, kept("Sts3215")]]
    peer.new("bus", "Bus", port, 1_000_000, TIMEOUT, {"pairs": motors})


def bus_steps() -> Iterator[Step]:
    """The bus, with servos of three kinds at once."""
    ids, name = list(IDS), "goal_position"
    goals = {(1, GOAL): [0x2C, 1], (2, GOAL): [1, 0x2C], (253, GOAL): [0x2C, 1]}
    on = {(1, 40): [1], (1, 55): [1], (2, 40): [1], (2, 48): [1]}
    off = {(1, 40): [0], (1, 55): [0], (2, 40): [0], (2, 48): [0]}
    negative = {(1, GOAL): STS.signed(name, -300)}
    yield _step("read_register", 2, name, gives=300, before=goals, owner="bus")
    yield _step("sync_read_register", ids, name, gives=[300] * 3, before=goals, owner="bus")
    yield _step("write_register", 2, name, 300, after={(2, GOAL): [1, 0x2C]}, owner="bus")
    yield _step("write_register", 1, name, -300, after=negative, owner="bus")
    yield _step("sync_write_register", ids, name, [300] * 3, after=goals, owner="bus")
    yield _step("set_torque", ids, True, gives=[], after=on, owner="bus")
    yield _step("set_torque", ids, False, gives=[], after=off, owner="bus")
    yield _step("scan", kept("Sts3215"), [1, ABSENT], gives=[[1, 777]], owner="bus")
    yield _step("scan", kept("Scs0009"), [2], gives=[[2, 1284]], owner="bus")
