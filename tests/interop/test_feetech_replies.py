"""What strangers' libraries and motorbus make of the same answers: many alarms at once, undefined bits, real moves."""

from __future__ import annotations

import select
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, TypeVar

import pytest

import motorbus
from motorbus import feetech
from motorbus.core.request import Reply
from motorbus.families.feetech import protocol
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS
from motorbus.simulation.pty import PtyMaster
from tests.interop.feetech import sdk
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, RUSTYPOT, Library, Peer
from tests.interop.feetech.sdk import ALARMS, BOTH, CORRUPT, MODE, POSITION, SUCCESS, TIMEOUT, TORQUE, Sdk
from tests.interop.feetech.steps import TRIES
from tests.interop.feetech.twin import HLS, KINDS, SCS, STS, Kind, Twin

T = TypeVar("T")

SDKS = [OLD_SDK, NEW_SDK]
UNDEFINED = 0x80


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A place for ports, with nothing of ours kept elsewhere."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path


@pytest.fixture
def terminal() -> Iterator[PtyMaster]:
    """A pseudo-terminal whose other end is this test: so a servo can say what no simulator says."""
    with closing(PtyMaster()) as master:
        yield master


def answer(terminal: PtyMaster, data: bytes) -> None:
    """Wait until a client has asked something, and say this."""
    assert select.select([terminal], [], [], 10.0)[0]
    assert terminal.read()
    terminal.write(data)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.model)
def test_we_name_every_alarm_where_they_name_the_first(kind: Kind, folder: Path) -> None:
    """Supply and temperature both beyond their limits: byte 0x05 in every answer."""
    with Twin(folder, kind) as twin:
        for (node, address), data in ALARMS.items():
            twin.write(node, address, data)
        assert twin.alarm(1) == BOTH
        for library in SDKS:
            with Peer(library) as peer:
                sdk.prepare(peer, Sdk(library, kind), twin.port)
                text = peer.call("handler", "getRxPacketError", twin.alarm(1))
                assert "voltage" in text
                assert "heat" not in text
        assert twin.status()[1]["alarm"] == ["voltage", "temperature"]
        with motorbus.open(f"feetech:{twin.port}") as line:
            told = patiently(feetech.Servo(line, 1).alarms)
    assert [text.split(":")[0] for text in told] == ["voltage", "temperature"]


@pytest.mark.parametrize("library", SDKS, ids=lambda library: library.name)
def test_an_error_byte_above_0x7f_is_noise_to_them(library: Library, terminal: PtyMaster) -> None:
    packet = protocol.frame(1, UNDEFINED, b"\x02")
    with Peer(library) as peer:
        one = Sdk(library, STS)
        sdk.prepare(peer, one, terminal.slave_name)
        call = one.call("read1ByteTxRx", 1, 21)
        peer.send("call", "handler", call.name, list(call.arguments))
        answer(terminal, packet)
        assert peer.receive()[1] in (TIMEOUT, CORRUPT)
    assert protocol.receiver().feed(packet) == [Reply(0, 1, packet)]
    assert protocol.decode(packet) == (1, UNDEFINED, b"\x02")


def test_rustypot_takes_an_error_byte_above_0x7f(terminal: PtyMaster) -> None:
    with Peer(RUSTYPOT) as peer:
        peer.new("controller", "Sts3215PyController", terminal.slave_name, 1_000_000, 10.0)
        peer.send("call", "controller", "read_raw_data_with_error", [1, 21, 1])
        answer(terminal, protocol.frame(1, UNDEFINED, b"\x02"))
        assert peer.receive() == [[2], UNDEFINED]


@pytest.mark.parametrize("kind", [SCS, STS], ids=lambda kind: kind.model)
def test_the_newer_sdk_moves_a_servo_to_its_goal(kind: Kind, folder: Path) -> None:
    goal = kind.middle + 30
    own, order = (
        ("scscl", ("WritePos", 1, goal, 0, 200))
        if kind is SCS
        else ("sms_sts", ("WritePosEx", 1, goal, 800, 0))
    )
    with Twin(folder, kind) as twin, Peer(NEW_SDK) as peer:
        sdk.prepare(peer, Sdk(NEW_SDK, kind), twin.port)
        done(twin, peer, "handler", "write1ByteTxRx", 1, TORQUE, 1)
        done(twin, peer, own, *order)
        stand_still(twin)
        assert kind.number_of(twin.read(1, POSITION, 2)) == pytest.approx(goal, abs=2)
        assert done(twin, peer, own, "ReadPos", 1)[0] == kind.number_of(twin.read(1, POSITION, 2))


def test_an_hls_moves_for_whoever_gives_it_a_torque(folder: Path) -> None:
    """The class for STS writes 0 there and it stays; the same burst with a current in it moves it."""
    goal = HLS.middle + 100
    assert TRAITS["hls"].current == "goal_torque"
    row = TABLES["hls"]["goal_torque"]
    with Twin(folder, HLS) as twin, Peer(NEW_SDK) as peer:
        sdk.prepare(peer, Sdk(NEW_SDK, HLS), twin.port)
        done(twin, peer, "handler", "write1ByteTxRx", 1, TORQUE, 1)
        done(twin, peer, "sms_sts", "WritePosEx", 1, goal, 50, 50)
        assert twin.read(1, row.address, 2) == [0, 0]
        stand_still(twin)
        assert HLS.number_of(twin.read(1, POSITION, 2)) == HLS.middle
        burst = [50, *HLS.word(goal), *HLS.word(500), *HLS.word(50)]
        done(twin, peer, "handler", "writeTxRx", 1, 41, len(burst), burst)
        stand_still(twin)
        assert HLS.number_of(twin.read(1, POSITION, 2)) == pytest.approx(goal, abs=2)


def test_what_they_leave_unlocked_lasts_and_what_they_lock_does_not(folder: Path) -> None:
    with Twin(folder, STS) as twin, Peer(NEW_SDK) as peer:
        sdk.prepare(peer, Sdk(NEW_SDK, STS), twin.port)
        for lock, mode in (("LockEprom", 0), ("unLockEprom", 1)):
            done(twin, peer, "sms_sts", lock, 1)
            done(twin, peer, "sms_sts", "WheelMode", 1)
            assert twin.read(1, MODE, 1) == [1]
            twin.order("power-cycle")
            assert twin.read(1, MODE, 1) == [mode]


def patiently(ask: Callable[[], T]) -> T:
    """Ask again, a few times: a busy machine may wake the simulator later than we wait."""
    for _ in range(5):
        with suppress(motorbus.NoReply):
            return ask()
    return ask()


def done(twin: Twin, peer: Peer, owner: str, name: str, *arguments: Any) -> list[Any]:
    """Call until it succeeds, with the line quiet before each new try: 50 ms are little on a busy machine."""
    for _ in range(TRIES):
        gave: list[Any] = peer.call(owner, name, *arguments)
        if gave[-2:] == [SUCCESS, 0]:
            return gave
        twin.drain()
    raise AssertionError(f"{name}{arguments} gave {gave}")


def stand_still(twin: Twin) -> None:
    """Ask until the servo says that it does not move; the test's own time limit ends it."""
    while twin.read(1, 66, 1)[0] & 1:
        pass
