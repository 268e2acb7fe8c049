"""The guarded write: unlock, torque off, write, read back, lock; and the lock is closed whatever happens."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.core.request import Effect, Priority, TimeoutClass
from motorbus.core.steps import Sleep
from motorbus.errors import ChecksumError, MotorbusError, NoReply, OutcomeUnknown, VerificationFailed
from motorbus.families.feetech.driver import write
from motorbus.families.feetech.table import Mode
from tests.families.feetech.driver_script import (
    REG_WRITE,
    Line,
    Played,
    looked,
    packet,
    play,
    prepared,
    prepares,
    reads,
    unheard,
    watch,
    writes,
)
from tests.families.feetech.maps import simulated

OFF, UNLOCK, LOCK, LOCKED = writes(3, 40, 0), writes(3, 55, 0), writes(3, 55, 1), reads(3, 55, 1)
IDLE = reads(3, 64, 0)
STILL_OPEN = reads(3, 55, 0)
WRITES = (writes(3, 20, 5, 33), reads(3, 20, 5, 33))
GIVEN_UP = (OFF, LOCK, LOCKED)
BEGUN = (OFF, STILL_OPEN, LOCK, LOCKED)
LOOK = looked(WRITES[0])
WHOLE = (*LOOK, UNLOCK, OFF, IDLE, *WRITES, STILL_OPEN, LOCK, LOCKED)


def test_the_sequence_and_nobody_else_on_the_bus_meanwhile() -> None:
    played = watch(write(prepared(), position_p=33, led_mask=5), *WHOLE)
    assert played.alone == 1
    stores = [one for one in played.requests if one.reply_within is TimeoutClass.STORE]
    assert stores == [played.requests[0], played.requests[2], *played.requests[4:]]
    assert [request.effect for request in played.requests] == [
        Effect.NONE,
        Effect.NONE,
        Effect.PERSISTENT,
        Effect.TORQUE,
        Effect.NONE,
        Effect.PERSISTENT,
        Effect.NONE,
        Effect.NONE,
        Effect.PERSISTENT,
        Effect.NONE,
    ]
    assert played.requests[3].priority is Priority.STOP


def test_several_runs_of_registers_are_one_guarded_sequence_and_ram_follows() -> None:
    play(
        write(prepared(), position_p=33, max_temperature=65, torque_limit=0.5),
        *looked(writes(3, 13, 65), writes(3, 21, 33)),
        *(UNLOCK, OFF, IDLE, writes(3, 13, 65), reads(3, 13, 65), writes(3, 21, 33), reads(3, 21, 33)),
        *(STILL_OPEN, LOCK, LOCKED, writes(3, 48, 0xF4, 1)),
    )


def test_a_servo_that_is_limp_cannot_be_moved_by_its_mode() -> None:
    played = watch(
        write(prepared(), operating_mode=1),
        *(
            *looked(writes(3, 33, 1)),
            UNLOCK,
            OFF,
            IDLE,
            STILL_OPEN,
            writes(3, 33, 1),
            reads(3, 33, 1),
            STILL_OPEN,
            LOCK,
            LOCKED,
        ),
    )
    assert max(request.effect for request in played.requests) is Effect.TORQUE


def test_a_reg_write_that_waits_is_replaced_by_one_that_moves_nothing() -> None:
    harmless = Line(packet(3, REG_WRITE, 40, 0), packet(3, 0))
    played = watch(
        write(prepared(), position_p=33, led_mask=5), *(*WHOLE[:4], reads(3, 64, 1), harmless, *WHOLE[5:])
    )
    assert played.requests[5].effect is Effect.NONE


def test_settings_are_read_again_afterwards() -> None:
    node = prepared()
    play(
        write(node, operating_mode=1),
        *(
            *looked(writes(3, 33, 1)),
            UNLOCK,
            OFF,
            IDLE,
            STILL_OPEN,
            writes(3, 33, 1),
            reads(3, 33, 1),
            STILL_OPEN,
            LOCK,
            LOCKED,
        ),
    )
    assert node.settings is None
    play(write(node, torque_enable=0), prepares(at_33=1), OFF)
    assert node.known_mode is Mode.VELOCITY


def test_reading_back_different_is_an_error_and_the_lock_is_closed() -> None:
    played = Played([*LOOK, UNLOCK, OFF, IDLE, WRITES[0], reads(3, 20, 5, 32), *BEGUN])
    with pytest.raises(VerificationFailed, match="register 20 to 21"):
        played.run(write(prepared(), position_p=33, led_mask=5))
    assert played.script == []


def test_a_lock_that_stays_open_is_tried_again() -> None:
    play(write(prepared(), position_p=33, led_mask=5), *WHOLE[:-1], reads(3, 55, 0), LOCK, LOCKED)


def test_a_lock_that_stays_open_for_good_is_an_error() -> None:
    with pytest.raises(VerificationFailed, match="register 55"):
        play(
            write(prepared(), position_p=33, led_mask=5),
            *(*WHOLE[:-1], reads(3, 55, 0), LOCK, reads(3, 55, 0)),
        )


STEPS = range(len(LOOK), len(WHOLE))
"""All but the look, before which and in which nothing is open yet."""


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("failure", [NoReply("n"), ChecksumError("c"), OutcomeUnknown("o")])
def test_d6_an_error_at_any_step_ends_with_the_lock(step: int, failure: MotorbusError) -> None:
    played = Played([*WHOLE[:step], *(Line(line.sent, failure) for line in failing(step)), *given_up(step)])
    if step <= WHOLE.index(STILL_OPEN):
        unread = (
            type(failure) if WHOLE[step] is IDLE else OutcomeUnknown
        )  # all others ask for what was written before
        with pytest.raises(unread):
            played.run(write(prepared(), position_p=33, led_mask=5))
    else:  # everything is written, and the second attempt closes the lock
        played.run(write(prepared(), position_p=33, led_mask=5))
    assert played.script == []


def given_up(step: int) -> tuple[Line, ...]:
    """How it ends when this step fails: until all is done, with torque off once more; and once something has been
    written, with a look whether it was written behind a lock that has closed by itself."""
    if WHOLE.index(WRITES[0]) <= step <= WHOLE.index(STILL_OPEN):
        return BEGUN
    return GIVEN_UP if step <= WHOLE.index(STILL_OPEN) else GIVEN_UP[1:]


def failing(step: int) -> list[Line]:
    """What is asked when this step fails, before it is given up."""
    line = WHOLE[step]
    if line is OFF:
        return [OFF, OFF, OFF, reads(3, 40, 0)]
    read_back = {UNLOCK: reads(3, 55, 0), WRITES[0]: WRITES[1], LOCK: LOCKED}
    return [line, read_back[line]] if line in read_back else [line]


def test_a_lock_that_cannot_be_closed_is_told_with_the_error() -> None:
    silent = [unheard(LOCK), unheard(LOCKED)] * 2
    with pytest.raises(VerificationFailed, match="register 20 to 21") as caught:
        play(
            write(prepared(), position_p=33, led_mask=5),
            *(*LOOK, UNLOCK, OFF, IDLE, WRITES[0], reads(3, 20, 0, 0), OFF, STILL_OPEN, *silent),
        )
    assert "EEPROM lock of node 3 may still be open" in caught.value.__notes__[0]


def test_a_servo_that_acknowledges_nothing_is_read_back_at_every_step() -> None:
    play(
        write(prepared(at_8=0), led_mask=5),
        *(*looked(writes(3, 20, 5)), unheard(UNLOCK), reads(3, 55, 0), unheard(OFF), reads(3, 40, 0), IDLE),
        *(unheard(writes(3, 20, 5)), reads(3, 20, 5), reads(3, 20, 5)),
        *(STILL_OPEN, unheard(LOCK), LOCKED, LOCKED),
    )


def test_a_servo_told_to_acknowledge_nothing_more_is_still_locked() -> None:
    play(
        write(prepared(), status_return_level=0),
        *(
            *looked(writes(3, 8, 0)),
            UNLOCK,
            OFF,
            IDLE,
            unheard(writes(3, 8, 0)),
            reads(3, 8, 0),
            reads(3, 8, 0),
        ),
        *(STILL_OPEN, unheard(LOCK), LOCKED, LOCKED),
    )


CHANGES: dict[str, Callable[[Any], object]] = {
    "a mode": lambda servo: servo.set_mode("velocity"),
    "limits": lambda servo: servo.write(min_position_limit=1.0),
    "a zero": lambda servo: servo.calibrate(),
    "many turns": lambda servo: servo.set_many_turns(True),
}


MOVING = (9, 18, 31, 33)
"""Where the writes begin that would move a servo with torque; 128 to the torque switch is another."""


@pytest.mark.parametrize("at", range(16))
@pytest.mark.parametrize("change", CHANGES)
def test_a_servo_that_restarts_with_its_torque_on_is_not_moved_by_a_setting(change: str, at: int) -> None:
    """Whichever packet its supply fails in front of, but the very one that would move it: nothing is written that would
    move a servo with torque, it is made limp again, and it stands where it stood."""
    with simulated("sts", torque_at_power_up="yes") as (real, servo):
        servo.prepare()
        line, write, packets = servo.bus.link, servo.bus.link.write, []
        torque: list[int] = []

        def wrote(data: bytes) -> None:
            packets.append(data)
            if len(packets) == at + 1:
                real.power_cycle()
            elif data[4] == 3 and (data[5] in MOVING or data[5:7] == b"\x28\x80"):
                torque.append(real.memory["torque_enable"])
            write(data)

        line.write = wrote
        stood = real.motion.position(real._now())
        failure: MotorbusError | None = None
        try:
            CHANGES[change](servo)
        except MotorbusError as error:
            failure = error
        line.write = write
        begun = next(n for n, data in enumerate(packets) if data[4:7] in (b"\x03\x37\0", b"\x03\x28\0"))
        closed = next(n for n, data in enumerate(packets) if data[4:7] == bytes((3, 55, 1)))
        assert not any(torque)
        if begun < at < closed - 1:
            assert failure is not None
            assert real.memory["torque_enable"] == 0
        servo.bus.run(Sleep(2.0))
        assert real.motion.position(real._now()) == pytest.approx(stood, abs=1)
