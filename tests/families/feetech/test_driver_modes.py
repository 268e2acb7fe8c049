"""Reading the mode and changing it: guarded, limp, at rest; with the registers of every map, typed by hand."""

from __future__ import annotations

from math import radians

import pytest

import motorbus
from motorbus.core.operation import Effect
from motorbus.errors import DeviceError, RequestError
from motorbus.families.feetech.driver import Node, Servo, mode, set_mode
from motorbus.families.feetech.table import CONTROL, TABLES, Mode
from tests.families.feetech.driver_script import Line, looks, play, reads, watch, writes
from tests.families.feetech.maps import HEADS, eeprom, met

ZERO_VELOCITY = "its goal velocity is 0: set_velocity() gives one"
SCS_COUNT = radians(300) / 1024
MODE_AT = {"sts": 33, "smbl": 33, "smcl": 35, "hls": 33}
LOCK_AT = {"sts": 55, "smbl": 55, "smcl": 48, "hls": 55, "scs": 48, "scs2": 48}


def guarded(name: str, address: int, *data: int) -> list[Line]:
    """Unlock, torque off, see that it has not restarted, write, read back, the same once more, lock, see it locked."""
    lock = LOCK_AT[name]
    return [
        *looks(writes(3, address, *data)),
        *(writes(3, lock, 0), writes(3, 40, 0), reads(3, 64, 0), reads(3, lock, 0)),
        *(writes(3, address, *data), reads(3, address, *data)),
        *(reads(3, lock, 0), writes(3, lock, 1), reads(3, lock, 1)),
    ]


def asked(name: str, **changes: int) -> Line:
    return reads(3, 0, *eeprom(name, **changes))


AT_REST = {
    Mode.VELOCITY: [writes(3, 46, 0, 0)],
    Mode.PWM: [writes(3, 44, 0, 0)],
    Mode.CURRENT: [writes(3, 44, 0, 0)],
}
CHANGES = [(name, code, one) for name in MODE_AT for code, one in CONTROL[name].modes.items()]


@pytest.mark.parametrize(("name", "code", "wanted"), CHANGES)
def test_the_mode_is_told(name: str, code: int, wanted: Mode) -> None:
    assert play(mode(Node(3)), asked(name, **{f"at_{MODE_AT[name]}": code})) is wanted


@pytest.mark.parametrize("name", ["scs", "scs2"])
def test_limits_tell_the_mode_where_no_register_does(name: str) -> None:
    assert play(mode(met(name)), asked(name)) is Mode.POSITION
    assert play(mode(met(name)), asked(name, at_11=0, at_12=0)) is Mode.PWM


def test_what_nobody_explains_is_not_made_up() -> None:
    with pytest.raises(RequestError, match="operating mode 4, which is not documented"):
        play(mode(Node(3)), asked("hls", at_33=4))
    with pytest.raises(DeviceError, match="register map is not described"):
        play(mode(Node(3)), asked("sts", at_0=9))


@pytest.mark.parametrize(
    ("name", "code", "wanted"), [one for one in CHANGES if one[0] != "hls" or one[2] is not Mode.PWM]
)
def test_it_is_set_guarded_and_what_the_new_mode_heeds_becomes_0(name: str, code: int, wanted: Mode) -> None:
    at = MODE_AT[name]
    played = watch(
        set_mode(Node(3), wanted.value),
        *(asked(name), *guarded(name, at, code), asked(name, **{f"at_{at}": code})),
        *AT_REST.get(wanted, []),
    )
    assert played.alone == 1
    stored = played.sent.index(writes(3, at, code).sent)
    assert played.exchanges[stored].effect is Effect.PERSISTENT


@pytest.mark.parametrize("name", ["scs", "scs2"])
def test_scs_servos_become_motors_and_servos_again_by_their_limits(name: str) -> None:
    node, zero = met(name), {"at_11": 0, "at_12": 0}
    play(
        set_mode(node, Mode.PWM),
        *(asked(name, at_10=20), *guarded(name, 9, 0, 0, 0, 0), asked(name, **zero), *AT_REST[Mode.PWM]),
    )
    assert node.limits is None
    back = [asked(name, **zero), *guarded(name, 9, 0, 20, 3, 0xFF), asked(name, at_10=20)]
    play(set_mode(node, Mode.POSITION), *back)
    assert node.known_mode is Mode.POSITION
    assert node.limits == pytest.approx((20 * SCS_COUNT, 1023 * SCS_COUNT))


def test_limits_of_a_motor_that_others_made_are_asked_for() -> None:
    zero = {"at_11": 0, "at_12": 0}
    with pytest.raises(RequestError, match="nobody here knows which") as caught:
        play(set_mode(Node(3), "position"), asked("scs", **zero))
    assert "shipped are 0.1023 to 5.129" in caught.value.expected
    with pytest.raises(RequestError, match="the lower one first|limits 5.0 to 1.0 rad are none"):
        play(set_mode(Node(3), "position", limits=(5.0, 1.0)), asked("scs", **zero))
    limits = (100 * SCS_COUNT, 900 * SCS_COUNT)
    play(
        set_mode(Node(3), "position", limits=limits),
        *(asked("scs", **zero), *guarded("scs", 9, 0, 100, 3, 0x84), asked("scs")),
    )


@pytest.mark.parametrize(
    ("name", "wanted"),
    [(name, one) for name in HEADS for one in Mode if one not in CONTROL[name].has],
)
def test_a_mode_that_the_map_has_not_changes_nothing(name: str, wanted: Mode) -> None:
    with pytest.raises(RequestError, match=f"has no {wanted.value} mode"):
        play(set_mode(Node(3), wanted), asked(name))


def test_pwm_of_hls_and_limits_of_others_and_words_that_are_no_modes_are_refused() -> None:
    with pytest.raises(RequestError, match="nobody has published which register takes the duty"):
        play(set_mode(Node(3), "pwm"), asked("hls"))
    with pytest.raises(RequestError, match="has an operating mode"):
        play(set_mode(Node(3), "position", limits=(0.0, 1.0)), asked("sts"))
    with pytest.raises(RequestError, match="'wheel' is no mode") as caught:
        play(set_mode(Node(3), "wheel"))
    assert "velocity" in caught.value.expected


def test_a_current_that_was_a_goal_is_no_bound_of_the_next_mode() -> None:
    play(
        set_mode(met("hls", at_33=2), Mode.POSITION),
        *(
            asked("hls", at_33=2),
            *looks(writes(3, 33, 0)),
            writes(3, 55, 0),
            writes(3, 40, 0),
            reads(3, 64, 0),
        ),
        # The supply may go behind any line: 0 is always noticed.
        *(reads(3, 55, 0), writes(3, 44, 0, 0), reads(3, 44, 0, 0)),
        *(reads(3, 55, 0), writes(3, 33, 0), reads(3, 33, 0)),
        *(reads(3, 55, 0), writes(3, 44, 0xF4, 1), reads(3, 44, 0xF4, 1)),
        *(reads(3, 55, 0), writes(3, 55, 1), reads(3, 55, 1), asked("hls")),
    )
    assert TABLES["hls"]["protection_current"].to_value(500) == pytest.approx(3.25)


@pytest.mark.parametrize("by_name", [False, True], ids=["set_mode", "write"])
@pytest.mark.parametrize("wanted", [Mode.POSITION, Mode.VELOCITY])
def test_a_program_that_comes_later_has_a_servo_with_its_full_force(wanted: Mode, by_name: bool) -> None:
    with motorbus.simulate("feetech", ids="3", model="hls3925") as simulation:
        with motorbus.open(simulation.url) as bus:
            servo = Servo(bus, 3)
            servo.set_mode("current")
            servo.enable_torque()
            servo.set_current(0.1)
            if by_name:
                servo.write(operating_mode=0 if wanted is Mode.POSITION else 1)
            else:
                servo.set_mode(wanted)
        assert simulation[3].memory["goal_torque"] == simulation[3].memory["protection_current"] == 500
        with motorbus.open(simulation.url) as bus:
            servo = Servo(bus, 3)
            servo.enable_torque()
            if wanted is Mode.POSITION:
                servo.move(2.5)
                assert servo.position() == pytest.approx(2.5, abs=0.05)
            assert servo.blockers() == (() if wanted is Mode.POSITION else (ZERO_VELOCITY,))
        assert simulation[3].memory["goal_torque"] == 500


def test_a_bound_that_was_set_stays_from_mode_to_mode_where_it_was_no_goal() -> None:
    with motorbus.simulate("feetech", ids="3", model="hls3925") as simulation:
        simulation[3].memory["goal_torque"] = 100
        with motorbus.open(simulation.url) as bus:
            Servo(bus, 3).set_mode("velocity")
            Servo(bus, 3).set_mode("position")
        assert simulation[3].memory["goal_torque"] == 100
