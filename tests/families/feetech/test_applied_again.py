"""Row D9: a configuration that is applied again wears no cell; and what only looks applied is applied all the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.errors import OutcomeUnknown, VerificationFailed
from motorbus.families.feetech import Servo
from motorbus.families.feetech.driver import set_mode, write
from motorbus.families.feetech.driver.exchanges import Block, confirmed
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.driver_script import Played, looks, play, prepared, prepares, reads, writes
from tests.families.feetech.maps import simulated

OFF, UNLOCK, LOCK, LOCKED = writes(3, 40, 0), writes(3, 55, 0), writes(3, 55, 1), reads(3, 55, 1)
IDLE, OPEN, LIMP = reads(3, 64, 0), reads(3, 55, 0), reads(3, 40, 0)

APPLIED: dict[str, Callable[[Any], object]] = {
    "registers": lambda servo: servo.write(max_temperature=61, led_mask=5, min_position_limit=1.0),
    "gains": lambda servo: servo.write(position_p=16, position_d=20),
    "protection": lambda servo: servo.write(max_temperature=60, unload_mask=32),
    "torque limit": lambda servo: servo.write(max_torque=0.4),
    "mode": lambda servo: servo.set_mode("velocity" if servo.identify().table == "hls" else "pwm"),
}


def worn(real: Any) -> int:
    return int(real.memory.wear.total())


@pytest.mark.parametrize("what", APPLIED)
@pytest.mark.parametrize("name", TABLES)
def test_d9_the_same_configuration_again_writes_no_cell(name: str, what: str) -> None:
    """Neither by the same servo nor by another program, which knows nothing of the first."""
    with simulated(name) as (real, servo):
        APPLIED[what](servo)
        once = worn(real)
        assert once > 0
        APPLIED[what](servo)
        APPLIED[what](Servo(servo.bus, 3))
        assert worn(real) == once
        assert real.memory["lock"] == 1


@pytest.mark.parametrize("what", ["registers", "gains", "protection"])
def test_d9_a_servo_that_holds_goes_on_holding_when_nothing_is_to_be_written(what: str) -> None:
    with simulated("sts") as (real, servo):
        APPLIED[what](servo)
        servo.enable_torque()
        APPLIED[what](servo)
        assert real.memory["torque_enable"] == 1


def test_d9_the_cells_are_read_and_the_lock_is_seen_closed_and_that_is_all() -> None:
    node = prepared()
    settings = node.settings
    play(write(node, position_p=33, led_mask=5), reads(3, 20, 5, 33), LOCKED)
    assert node.settings is settings


def test_d9_a_lock_that_others_left_open_is_closed() -> None:
    play(write(prepared(), led_mask=5), reads(3, 20, 5), OPEN, LOCK, LOCKED)
    with pytest.raises(VerificationFailed, match="register 55"):
        play(write(prepared(), led_mask=5), reads(3, 20, 5), OPEN, *[LOCK, OPEN] * 2)


def test_d9_only_registers_that_differ_are_written_and_whole() -> None:
    """Both bytes of a limit go together, and what lies between two that differ stays as it is."""
    play(
        write(prepared(), max_temperature=65, max_voltage=8.0, min_voltage=5.0, max_torque=0.5),
        *(reads(3, 13, 70, 80, 40, 0xE8, 1), LIMP, UNLOCK, OFF, IDLE),
        *(writes(3, 13, 65), reads(3, 13, 65)),
        *(writes(3, 15, 50, 0xF4, 1), reads(3, 15, 50, 0xF4, 1), OPEN, LOCK, LOCKED),
    )


def test_d9_the_mode_it_has_is_not_written_and_it_is_limp_all_the_same() -> None:
    same = (prepares(), reads(3, 33, 0), LOCKED, OFF, prepares())
    play(set_mode(prepared(), "position"), *same)


# -- what reads as set and is not kept -----------------------------------------------------------------------


def behind_a_closed_lock(servo: Any, led: int) -> None:
    """As another program does it that does not know of the lock."""
    servo.bus.run(confirmed(servo, Block(20, bytes((led,)))))


def test_d9_what_others_wrote_behind_a_closed_lock_cannot_be_seen_and_rewrite_keeps_it() -> None:
    with simulated("sts") as (real, servo):
        servo.prepare()
        behind_a_closed_lock(servo, 5)
        servo.write(led_mask=5)
        assert worn(real) == 0
        real.power_cycle()
        assert real.memory["led_mask"] != 5, "which no host can know: it reads the same"
        behind_a_closed_lock(servo, 5)
        servo.rewrite(led_mask=5)
        real.power_cycle()
        assert real.memory["led_mask"] == 5


@pytest.mark.parametrize("stranger", [False, True])
@pytest.mark.parametrize("at", range(4, 8))
def test_d9_what_a_lost_supply_let_vanish_is_written_again_by_anybody(at: int, stranger: bool) -> None:
    """The supply dips before the write, or after it: the write lands behind a lock that has closed by itself."""
    with simulated("sts") as (real, servo):
        servo.prepare()
        line, send, packets = servo.bus.link, servo.bus.link.write, []

        def wrote(data: bytes) -> None:
            packets.append(data)
            if len(packets) == at:
                real.power_cycle()
            send(data)

        line.write = wrote
        with pytest.raises(OutcomeUnknown, match="closed its EEPROM lock by itself"):
            servo.write(led_mask=5)
        line.write = send
        assert len(packets) > at
        again = Servo(servo.bus, 3) if stranger else servo
        again.write(led_mask=5)
        real.power_cycle()
        assert real.memory["led_mask"] == 5


def test_d9_what_this_node_wrote_in_a_sequence_that_failed_is_written_whatever_it_reads() -> None:
    node, one = prepared(), (writes(3, 20, 5), reads(3, 20, 5))
    failed = Played([*looks(one[0]), LIMP, UNLOCK, OFF, IDLE, *one, reads(3, 55, 1), OFF, reads(3, 55, 1)])
    failed.script += [writes(3, 20, 4), LOCK, LOCKED]
    with pytest.raises(OutcomeUnknown):
        failed.run(write(node, led_mask=5))
    assert failed.script == []
    assert node.unsure == {20}
    whole = (reads(3, 20, 5), LIMP, UNLOCK, OFF, IDLE, *one, OPEN, LOCK, LOCKED)
    play(write(node, led_mask=5), prepares(), *whole)
    assert node.unsure == set()
    play(write(node, led_mask=5), prepares(), reads(3, 20, 5), LOCKED)
