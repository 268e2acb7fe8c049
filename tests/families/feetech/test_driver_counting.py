"""Goals and position count over many turns together; one bit of the phase register changes, and nothing else of it."""

from __future__ import annotations

import math

import pytest

from motorbus.core.request import Effect, Priority
from motorbus.errors import (
    DeviceError,
    LimitExceeded,
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    RequestError,
    VerificationFailed,
)
from motorbus.families.feetech.driver import Node, many_turns, set_many_turns
from motorbus.families.feetech.driver.motion import Promise
from motorbus.families.feetech.table import CONTROL, TABLES
from tests.families.feetech.driver_script import Line, Played, low_high, play, reads, unheard, watch, writes
from tests.families.feetech.maps import eeprom, prepares_as, simulated

COUNT = math.tau / 4096
FAR = 30719 * COUNT
MAPS = [name for name in TABLES if CONTROL[name].many_turns]
OFF, OPEN, CLOSED = writes(3, 40, 0), writes(3, 55, 0), (writes(3, 55, 1), reads(3, 55, 1))
IDLE = reads(3, 64, 0)
STILL = reads(3, 55, 0)
"""Before every write that would move a servo with torque."""
GIVEN_UP = (OFF, *CLOSED)
STILL_OPEN = 2 * (reads(3, 55, 0),)
"""Before what was done counts as done, and before the lock is closed."""
ZEROES = {"min_position_limit": 0, "max_position_limit": 0}


def at(position: int) -> Line:
    return reads(3, 56, *low_high(position))


def again(name: str, **values: int) -> Line:
    """Both limits and the phase register, with what lies between, once more."""
    return reads(3, 9, *eeprom(name, **values)[9:19])


def stored(address: int, *data: int) -> tuple[Line, Line]:
    return writes(3, address, *data), reads(3, address, *data)


def turned_on(name: str, phase: int) -> list[Line]:
    """All that is said to a servo as shipped but for its phase register, of which only bit 4 may change."""
    return [
        *(prepares_as(name, phase=phase), at(808), OPEN, OFF, IDLE, again(name, phase=phase)),
        *(STILL, *stored(18, phase | 16), STILL, *stored(9, 0, 0, 0, 0), *STILL_OPEN, *CLOSED),
        *(prepares_as(name, phase=phase | 16, **ZEROES), at(808)),
    ]


@pytest.mark.parametrize("phase", [0, 12, 0xEF, 16, 28])
@pytest.mark.parametrize("name", MAPS)
def test_limits_become_0_and_one_bit_is_set(name: str, phase: int) -> None:
    played = Played(turned_on(name, phase))
    told = played.run(set_many_turns(Node(3), True))
    assert played.script == []
    assert played.alone == 1
    assert (told.before.goals, told.before.told, told.before.raw_phase) == (False, bool(phase & 16), phase)
    assert (told.after.on, told.after.raw_phase) == (True, phase | 16)
    assert told.after.limits == pytest.approx((-FAR, FAR))
    assert told.before.position == told.after.position == pytest.approx(808 * COUNT)
    assert "forgets its turns" in told.note
    kept = [one for one in played.requests if bytes(one.wire)[4:6] in (b"\x03\x12", b"\x03\x09")]  # type: ignore[arg-type]
    assert [(one.effect, one.priority) for one in kept] == [(Effect.PERSISTENT, Priority.CONFIGURATION)] * 2


def test_off_limits_come_before_the_bit_is_cleared() -> None:
    script = [
        *(
            prepares_as("sts", phase=28, **ZEROES),
            at(9000),
            OPEN,
            OFF,
            IDLE,
            again("sts", phase=28, **ZEROES),
        ),
        *(STILL, *stored(9, 100, 0, 0xB8, 0x0B), STILL, *stored(18, 12), *STILL_OPEN, *CLOSED),
        *(prepares_as("sts", phase=12, min_position_limit=100, max_position_limit=3000), at(808)),
    ]
    told = play(set_many_turns(Node(3), False, (100 * COUNT, 3000 * COUNT)), *script)
    assert (told.before.on, told.after.off) == (True, True)
    assert told.after.limits == pytest.approx((100 * COUNT, 3000 * COUNT))
    assert (told.before.position, told.after.position) == pytest.approx((9000 * COUNT, 808 * COUNT))


def test_off_keeps_limits_that_there_are() -> None:
    """As found: limits of one turn, and a position over many (lerobot#3373)."""
    script = [
        *(prepares_as("sts", phase=28), at(6015), OPEN, OFF, IDLE, again("sts", phase=28)),
        *(STILL, *stored(9, 0, 0, 0xFF, 0x0F), STILL, *stored(18, 12), *STILL_OPEN, *CLOSED),
        *(prepares_as("sts"), at(1919)),
    ]
    assert play(set_many_turns(Node(3), False), *script).after.off


def test_limits_count_as_goals_do() -> None:
    """With an angular resolution of 2 a count is twice as far."""
    found = {"phase": 28, "angular_resolution": 2, **ZEROES}
    script = [
        *(prepares_as("sts", **found), at(0), OPEN, OFF, IDLE, again("sts", **found)),
        *(STILL, *stored(9, 10, 0, 0xD0, 0x07), STILL, *stored(18, 12), *STILL_OPEN, *CLOSED),
        *(prepares_as("sts", angular_resolution=2, min_position_limit=10, max_position_limit=2000), at(0)),
    ]
    told = play(set_many_turns(Node(3), False, (20 * COUNT, 4000 * COUNT)), *script)
    assert told.after.limits == pytest.approx((20 * COUNT, 4000 * COUNT))


def test_it_is_told_and_nothing_is_changed() -> None:
    told = play(many_turns(Node(3)), prepares_as("hls", phase=16), at(-3000))
    assert (told.goals, told.told, told.on, told.off) == (False, True, False, False)
    assert told.position == pytest.approx(-3000 * COUNT)
    assert told.limits == pytest.approx((0, 4095 * COUNT))


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name in TABLES if name not in MAPS])
def test_a_map_of_one_turn_is_refused(name: str) -> None:
    for operation in (many_turns(Node(3)), set_many_turns(Node(3), True)):
        with pytest.raises(RequestError, match=f"register map {name} is known to count more") as caught:
            play(operation, prepares_as(name))
        assert caught.value.expected.endswith("sts, smbl, hls")


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_it_is_for_position_mode(mode: int) -> None:
    with pytest.raises(RequestError, match="in operating mode"):
        play(set_many_turns(Node(3), True), prepares_as("sts", operating_mode=mode))


def test_a_stranger_is_refused() -> None:
    stranger = bytes((9, 9)) + eeprom("sts")[2:]
    for operation in (many_turns(Node(3)), set_many_turns(Node(3), True)):
        with pytest.raises(DeviceError, match="not described"):
            play(operation, reads(3, 0, *stranger))


@pytest.mark.parametrize("on", ["off", 1, None])
def test_a_word_is_no_yes(on: object) -> None:
    with pytest.raises(RequestError, match="neither True nor False"):
        play(set_many_turns(Node(3), on))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("on", "limits", "words"),
    [
        (True, (0.0, 1.0), "can have no others"),
        (False, None, "nobody here knows which"),
        (False, (1.0, 1.0), "are none"),
        (False, (2.0, 1.0), "are none"),
        (False, (0.0, 0.0), "are none"),
        (False, (-0.1, 1.0), "are none"),
        (False, (0.0, math.tau), "are none"),
        (False, (0.0, math.inf), "not a finite number"),
        (False, (math.nan, 1.0), "not a finite number"),
    ],
)
def test_limits_it_cannot_have_change_nothing(
    on: bool, limits: tuple[float, float] | None, words: str
) -> None:
    with pytest.raises(RequestError, match=words) as caught:
        play(set_many_turns(Node(3), on, limits), prepares_as("sts", phase=28, **ZEROES), at(0))
    if words != "can have no others" and "finite" not in words:
        assert "shipped are 0 to 6.282" in caught.value.expected


def test_where_nobody_knows_what_ships_the_widest_limits_are_named() -> None:
    with pytest.raises(RequestError) as caught:
        play(set_many_turns(Node(3), False), prepares_as("hls", phase=16, **ZEROES), at(0))
    assert "the widest are 0 to 6.282" in caught.value.expected


# --- what goes wrong ----------------------------------------------------------------------------------------

BEGIN = (prepares_as("sts"), at(808), OPEN, OFF, IDLE, again("sts"))
BACK_18 = (OPEN, OFF, *stored(18, 12))
BACK_9 = (OPEN, OFF, *stored(9, 0, 0, 0xFF, 0x0F))


def failing(error: type[MotorbusError], *lines: Line) -> MotorbusError:
    with pytest.raises(error) as caught:
        watch(set_many_turns(Node(3), True), *BEGIN, *lines)
    return caught.value


def test_a_register_that_reads_different_twice_is_not_written() -> None:
    with pytest.raises(VerificationFailed, match="different the second time"):
        watch(set_many_turns(Node(3), True), *BEGIN[:-1], again("sts", phase=44), *GIVEN_UP)


@pytest.mark.parametrize("found", [12, 29, 0xFF, 24])
def test_a_phase_that_is_not_what_was_written_is_put_back(found: int) -> None:
    wrong = (STILL, writes(3, 18, 28), reads(3, 18, found))
    error = failing(VerificationFailed, *wrong, *BACK_18, *GIVEN_UP)
    assert "as they were" in error.__notes__[0]


def test_limits_that_are_not_taken_put_the_phase_back_too() -> None:
    wrong = (STILL, *stored(18, 28), STILL, writes(3, 9, 0, 0, 0, 0), reads(3, 9, 0, 0, 0xFF, 0x0F))
    error = failing(VerificationFailed, *wrong, *BACK_9, *BACK_18, *GIVEN_UP)
    assert "as they were" in error.__notes__[0]


def test_a_servo_that_lost_its_supply_is_put_back_with_its_lock_open() -> None:
    written = (STILL, *stored(18, 28), STILL, *stored(9, 0, 0, 0, 0))
    error = failing(OutcomeUnknown, *written, reads(3, 55, 1), *BACK_9, *BACK_18, *GIVEN_UP)
    assert "closed its EEPROM lock by itself" in error.summary


def test_what_cannot_be_put_back_is_told() -> None:
    silent = [STILL, unheard(writes(3, 18, 28)), unheard(reads(3, 18, 28))]
    limp = (OFF, OFF, OFF, reads(3, 40, 0))
    gone = [unheard(one) for one in (OPEN, STILL, *limp, *2 * CLOSED)]
    error = failing(OutcomeUnknown, *silent, *gone)
    assert "could not be put back as it was: 0c from register 18 on" in error.__notes__[0]
    assert "lock of node 3 may still be open" in error.__notes__[1]


# --- a simulated one ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MAPS)
def test_goals_of_several_turns_are_gone_to_and_read_rightly(name: str) -> None:
    with simulated(name) as (real, servo):
        shipped = real.memory["phase"]
        stood = real.motion.position(0.0)
        real.raw_position = 700
        assert servo.set_many_turns(True).after.position == pytest.approx(700 * COUNT)  # it does not jump
        assert real.memory["phase"] == shipped | 16
        servo.enable_torque()  # needs no `jump`
        assert servo.position() == pytest.approx(700 * COUNT, abs=2 * COUNT)
        for goal in (20.0, -30.0, FAR, 0.5):
            servo.move(goal)
            assert servo.position() == pytest.approx(goal, abs=0.05)
            assert real.motion.position(real._now()) - stood == pytest.approx(goal / COUNT - stood, abs=40)
        servo.move(-10.0, wait=False)
        assert servo.stop() is Promise.HOLD_ACCEPTED
        with pytest.raises(LimitExceeded):
            servo.move(FAR + 1)


@pytest.mark.parametrize("name", MAPS)
def test_the_setting_outlives_a_power_cycle_and_the_turns_do_not(name: str) -> None:
    with simulated(name) as (real, servo):
        servo.set_many_turns(True)
        servo.enable_torque()
        servo.move(20.0)
        real.power_cycle()
        told = servo.many_turns()
        assert told.on
        assert told.position == pytest.approx(20.0 % math.tau, abs=0.05)
        servo.enable_torque()
        assert servo.position() == pytest.approx(20.0 % math.tau, abs=0.05)


@pytest.mark.parametrize("name", MAPS)
def test_back_within_one_turn_it_holds_where_it_stands(name: str) -> None:
    with simulated(name) as (real, servo):
        shipped = bytes(real.memory.stored)
        servo.set_many_turns(True)
        servo.enable_torque()
        servo.move(8.0)
        servo.set_many_turns(False, (0.0, 4095 * COUNT))
        assert bytes(real.memory.stored[:40])[9:19] == shipped[9:19]
        assert real.memory["lock"] == 1
        assert servo.position() == pytest.approx(8.0 - math.tau, abs=0.05)
        before = real.motion.position(real._now())
        servo.enable_torque()
        servo.move(servo.position())
        assert real.motion.position(real._now()) == pytest.approx(before, abs=3)
        assert servo.calibrate().after == pytest.approx(math.pi)


def test_a_servo_with_limits_of_0_alone_is_told_what_helps() -> None:
    with simulated("sts") as (_, servo):
        servo.write(min_position_limit=0.0, max_position_limit=0.0)
        with pytest.raises(RequestError, match="set_many_turns"):
            servo.enable_torque()
        servo.set_many_turns(True)
        servo.enable_torque()


def test_the_phase_register_is_still_refused_by_name() -> None:
    with simulated("sts") as (real, servo):
        with pytest.raises(RequestError, match="belongs to one servo alone"):
            servo.write(phase=28)
        assert real.memory["phase"] == 12


@pytest.mark.parametrize("commits", [0.5, 1, 1.5, 2, 3, 3.5, 4, 5, 5.5])
def test_a_cut_of_the_supply_never_leaves_goals_over_more_turns_than_are_told(commits: float) -> None:
    for on in (True, False):
        with simulated("sts") as (real, servo):
            if not on:
                servo.set_many_turns(True)
            real.cut(commits)
            done = True
            try:
                servo.set_many_turns(on, None if on else (0.0, 6.0))
            except (VerificationFailed, OutcomeUnknown, NoReply):
                done = False
            real.power_cycle()
            told = servo.many_turns()
            assert told.on or not told.goals
            assert told.raw_phase in (12, 28)
            assert (told.on if on else told.off) or not done
            assert real.memory["lock"] == 1
