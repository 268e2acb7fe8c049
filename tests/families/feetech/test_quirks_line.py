"""Quirks of the wire and of what hangs on it: lost and late replies, echoes of old ones, adapters, interruptions.

Each test is named after its number in docs/reference/feetech-quirks.md, and says what real servos were seen to do and
who saw it.
"""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus.core.request import Data
from motorbus.errors import NoReply, OutcomeUnknown, WireError
from motorbus.families.feetech import FAMILY, sync_read, sync_read_positions
from motorbus.families.feetech.simulator import simulate
from motorbus.families.feetech.table import BAUD_CODES
from motorbus.link import usb_adapters
from motorbus.link.base import PerfectLine
from motorbus.simulation.faults import FaultyLine
from motorbus.simulation.mount import Mount
from motorbus.simulation.pty import PtyMaster
from tests.families.feetech.quirk_bus import Busy, Lossy, bench, instruction
from tests.support.mounts import served
from tests.support.world import Interrupting, world

COUNT = 2 * 3.141592653589793 / 4096
PING, READ, WRITE, REG_WRITE, SYNC_READ = 1, 2, 3, 4, 0x82


def is_acknowledgement(data: bytes) -> bool:
    return len(data) == 6


def test_quirk_01_a_reply_that_is_lost_or_garbled_is_asked_for_again_and_counted() -> None:
    """Under load a status packet is now and then corrupt or missing; without retries the control loop dies.

    huggingface/lerobot#3131, #3888, #4207, #4282, #1252; Feetech-tuna#1.
    """
    with bench() as there:
        servo = there.servo()
        servo.prepare()
        for script in ("exchange 1 byte 4: corrupt 40", "exchange 1 byte 0: truncate"):
            before = there.bus.statistics.of(1).retries
            there.simulation.line = FaultyLine(script)
            assert servo.position() == pytest.approx(2048 * COUNT)
            assert there.bus.statistics.of(1).retries == before + 1
        there.simulation.line = silent = Lossy(lambda reply: True)
        with pytest.raises(NoReply):
            servo.position()
        assert 2 <= len(silent.lost) <= 4  # retries are bounded


def test_quirk_02_what_would_move_twice_is_never_sent_twice() -> None:
    """Retrying a WRITE of the goal in step mode, or a REG WRITE, can move twice: follows from what these do.

    Manual V1.01, 1.3.4; STS3215 memory table V3.6, operating mode 3.
    """
    with bench() as there:
        servo = there.servo()
        servo.write(min_position_limit=0, max_position_limit=0, operating_mode=3)
        servo.prepare()
        start = there.simulated().raw_position
        for order, code in ((servo.write, WRITE), (servo.reg_write, REG_WRITE)):
            there.simulation.line = Lossy(is_acknowledgement)
            with there.traffic() as sent, pytest.raises(OutcomeUnknown):
                order(goal_position=100 * COUNT)
            assert [instruction(one) for one in sent if instruction(one) in (WRITE, REG_WRITE)] == [code]
            there.simulation.line = PerfectLine()
        there.wait(3.0)
        assert there.simulated().raw_position == start + 100


def test_quirk_07_every_acknowledgement_is_consumed() -> None:
    """Acknowledgements nobody reads desynchronise the next read: six servos leave 36 stale bytes.

    strands-labs/robots#3398, #3407; andymai/stackchan-kai#39.
    """
    with bench("1-6") as there:
        servos = [there.servo(id) for id in range(1, 7)]
        for servo in servos:
            servo.prepare()
        for number, servo in enumerate(servos):
            there.simulated(number + 1).raw_position = 1000 + number
            servo.write(acceleration=0)
        assert [round(servo.position() / COUNT) for servo in servos] == [1000, 1001, 1002, 1003, 1004, 1005]
        assert sum(ledger.retries for ledger in there.bus.statistics.nodes.values()) == 0
        assert not there.bus.statistics.other


def test_quirk_07_an_acknowledgement_that_comes_too_late_is_no_answer_to_the_next_question() -> None:
    """The same stale bytes where it was not forgotten but late: thrown away, and the next value is a true one."""
    with bench() as there:
        servo = there.servo()
        servo.prepare()
        there.simulation.line = FaultyLine("exchange 1 byte 0: delay 0.03")
        servo.write(acceleration=0)
        there.simulated().raw_position = 1234
        assert servo.ping() is True
        assert servo.position() == pytest.approx(1234 * COUNT)


def test_quirk_17_a_scan_asks_id_by_id_at_every_rate() -> None:
    """A broadcast PING finds nothing on some boards and at some rates: huggingface/lerobot#1244, #3394."""
    with bench("7", broadcast_ping="collide") as there:
        there.simulated(7).memory["baud_rate"] = 5
        assert there.bus.run(FAMILY.open().scan((7,))) == []
        with there.traffic() as sent:
            found = there.bus.run(FAMILY.open().scan((6, 7), FAMILY.link.rates))
        assert [(one.node, one.rate) for one in found] == [(7, 76_800)]
        assert [one for one in sent if one[2] == 254] == []  # nothing was broadcast
        assert set(FAMILY.link.rates) == set(BAUD_CODES.values())


def test_quirk_18_many_servos_are_read_at_the_price_of_one_question(tmp_path: Path) -> None:
    """The rate of reading is bounded by the adapter, and by libraries that wait too long.

    huggingface/lerobot#1166, #532; ROBOTIS-GIT/DynamixelSDK#330 for the latency timer.
    """
    with bench("1-6") as there:
        servos = [there.servo(id) for id in range(1, 7)]
        there.bus.run(motorbus.feetech.prepare_all(servos))
        with there.traffic() as sent:
            read: Any = there.bus.run(sync_read_positions(servos))
        assert [instruction(one) for one in sent] == [SYNC_READ]
        assert len(read.values) == 6
        assert sum(there.bus.statistics.of(3).latency) == there.bus.statistics.of(3).ok  # how long each took
    timer = tmp_path / "class" / "tty" / "ttyUSB0" / "device" / "latency_timer"
    timer.parent.mkdir(parents=True)
    timer.write_text("16\n")
    latency, (warning,) = usb_adapters.device_latency("/dev/ttyUSB0", tmp_path)
    assert latency == pytest.approx(0.019)
    assert "16 ms" in warning


def test_quirk_21_servos_without_sync_read_are_read_one_by_one() -> None:
    """An SCS0009 lacks SYNC READ: a library that knows nothing else reads no such servo at all.

    lerobot, feetech.py; strands-labs/robots#3393.
    """
    with bench("1-4", model="sts3215+scs0009+sts3215+scs0009") as there:
        for id in range(1, 5):
            there.simulated(id).raw_position = 500 + id
        servos = [there.servo(id) for id in range(1, 5)]
        there.bus.run(motorbus.feetech.prepare_all(servos))
        with there.traffic() as sent:
            read = there.bus.run(sync_read(["present_position"], servos))
        assert read.errors == {}
        rows = [servo.table["present_position"] for servo in servos]
        raws = [row.to_raw(read.values[id]["present_position"]) for id, row in enumerate(rows, 1)]
        assert raws == [501, 502, 503, 504]
        assert [(instruction(one), one[2]) for one in sent if one[4] == READ] == [(READ, 2), (READ, 4)]
        assert [one[7:-1] for one in sent if one[4] == SYNC_READ] == [bytes((1, 3))]


def test_quirk_22_ctrl_c_inside_an_exchange_leaves_the_port_usable() -> None:
    """After Ctrl-C inside a call an SDK says "port in use" for ever: servolab, `_ready()`."""
    for number in range(1, 8):
        for after in (False, True):
            with world(FAMILY, ids=(1,), link=Interrupting) as there:
                servo = there.device(1)
                servo.prepare()
                link: Any = there.link
                link.after, link.countdown = after, number
                try:
                    for _ in range(5):
                        servo.position()
                except KeyboardInterrupt:
                    assert link.pressed
                there.simulator.nodes[1].raw_position = 1234  # type: ignore[attr-defined]
                assert link.pressed
                assert servo.position() == pytest.approx(1234 * COUNT)


def test_quirk_22_on_a_real_port(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same on a pseudo-terminal, where there is a port to be in use: it is used on, and opened again."""
    with closing(PtyMaster()) as master, served(Mount(simulate((1,), position=1234), master)):
        address = f"feetech:{master.slave_name}"
        with motorbus.open(address) as bus:
            servo = motorbus.feetech.Servo(bus, 1)
            assert servo.ping() is True

            def pressed(until: float) -> list[Data]:
                monkeypatch.undo()
                raise KeyboardInterrupt

            monkeypatch.setattr(bus.link, "read", pressed)
            with pytest.raises(KeyboardInterrupt):
                servo.position()
            assert servo.position() == pytest.approx(1234 * COUNT)
        with motorbus.open(address) as bus:
            assert motorbus.feetech.Servo(bus, 1).ping() is True


def test_quirk_23_a_burst_of_old_answers_is_never_taken_for_new_ones() -> None:
    """A servo that comes back from flash work answers all that was asked meanwhile in one burst.

    feetech-cli, SETTLE_QUIET_TIME.
    """
    with bench() as there:
        servo = there.servo()
        servo.prepare()
        there.simulation.line = Busy(there.bus.link.now() + 0.25)
        values: list[float] = []
        for raw in range(1000, 1060):
            there.simulated().raw_position = raw
            try:
                values.append(servo.position() / COUNT - raw)
            except (NoReply, WireError):
                continue
        assert len(values) > 40
        assert values == pytest.approx([0.0] * len(values))
