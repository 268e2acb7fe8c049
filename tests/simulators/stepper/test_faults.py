"""Faults as a host meets them, by its bytes; and faults that come and go while the controller runs."""

from __future__ import annotations

import pytest

from motorbus.core.request import Noise, Reply
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.simulator import Switches
from tests.protocol.stepper.vectors import DUMP_A
from tests.simulators.stepper.host import (
    DONE,
    HOME,
    SAVE,
    SELECT,
    START,
    STOP,
    Host,
    frame,
    number,
    step,
    written,
)

EDIT = step(1, distance=77)[0]
EDITED = "FF AA 03 03 00 01"
READ_5 = frame(0, 0x0B, 5)


def texts(host: Host) -> list[str]:
    return [remark.text for remark in host.device.log]


# --- replies and requests ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("fault", "carried_out"), [("lost", True), ("unheard", False)])
def test_a_command_without_a_reply_is_carried_out_or_was_never_heard(fault: str, carried_out: bool) -> None:
    host = Host(reply_fault=fault)
    assert host.say(EDIT) == ""
    assert host.device.memory["step_1_distance"] == (77 if carried_out else 1)
    assert host.say(frame(START, 1)) == ""
    assert (host.device.status()["phase"] == "moving") is carried_out
    assert len(texts(host)) == 2


def test_each_third_command_is_unheard() -> None:
    host = Host(reply_fault="unheard", fault_every=3)
    assert [host.say(STOP) != "" for _ in range(6)] == [True, True, False, True, True, False]


def test_a_reply_may_come_twice() -> None:
    assert Host(reply_fault="doubled").say(EDIT) == f"{EDITED} {EDITED}"


def test_six_bytes_of_an_echo_are_an_acknowledgement_without_a_device() -> None:
    host = Host(echo="six", reply_fault="unheard")
    assert host.say(STOP) == "FF AA 03 0D 00 00"
    assert host.say(frame(START, 1)) == "FF AA 4E 01 00 00"
    assert host.device.status()["phase"] == "idle"


def test_six_bytes_of_an_echo_come_before_the_reply_of_a_device() -> None:
    host = Host(echo="six")
    assert host.timed(EDIT) == [(0.0, "FF AA 03 03 4D 00"), (0.002, EDITED)]
    assert host.device.memory["step_1_distance"] == 77


def test_requests_with_wrong_bytes_are_not_answered_and_change_nothing() -> None:
    host = Host(request_errors=1.0)
    assert host.say(EDIT) == ""
    assert host.dump(1) == b""
    assert host.device.memory["step_1_distance"] == 1
    assert texts(host)[0] == "fault: 11 of 11 bytes of what the host sent arrive wrong"


def test_some_requests_arrive_and_some_do_not() -> None:
    host = Host(request_errors=0.02, seed=1)
    answered = [host.say(STOP, 0.2) != "" for _ in range(200)]
    assert 120 < sum(answered) < 190  # 0.98 to the power of 11 is 80 %
    assert answered == [
        again.say(STOP, 0.2) != "" for again in [Host(request_errors=0.02, seed=1)] for _ in answered
    ]


def test_wrong_bytes_in_replies_leave_the_command_carried_out() -> None:
    host = Host(byte_errors=1.0)
    reply = bytes.fromhex(host.say(EDIT))
    assert len(reply) == 6
    assert all(one != other for one, other in zip(reply, bytes.fromhex(EDITED), strict=True))
    assert host.device.memory["step_1_distance"] == 77


# --- notices ---------------------------------------------------------------------------------------------------------


def test_a_late_notice() -> None:
    host = Host(notice_fault="late", fault_time=3.0)
    host.write(written(1, step(1)))
    assert [at for at, text in host.timed(frame(START, 1), 9.0) if text == DONE] == [pytest.approx(4.0)]


def test_a_notice_in_a_dump_shifts_the_rest_and_what_is_left_is_noise() -> None:
    host = Host(notice_fault="inside_dump", shipped="empty")
    host.write([frame(SELECT, 1, 10), *[one for row in range(1, 11) for one in step(row)]])
    right = host.dump(1)
    assert host.say(frame(START, 2)) == "FF AA 4E 02 00 00"  # it is empty, so it ends at once
    wrong = host.dump(1)
    receiver = wire.Receiver()
    dump, *rest = receiver.feed(wrong) + receiver.flush()
    assert isinstance(dump, Reply)
    assert (len(wrong), len(dump.data), dump.data[:6]) == (228, 226, right[:6])
    assert dump.data != right
    assert b"".join(event.data for event in rest if isinstance(event, Noise)) == wrong[226:]
    assert host.dump(1) == right


def test_a_notice_that_nothing_has_caused() -> None:
    host = Host()
    host.device.notice()
    assert [text for _, text in host.wait(0.1)] == [DONE]
    assert texts(host) == ["fault: a notice that nothing has caused"]
    host.device.unplug()
    with pytest.raises(RequestError, match="without supply"):
        host.device.notice()


def test_homing_that_is_over_at_once_tells_it_after_the_reply() -> None:
    host = Host(notice_on_once=True)
    host.device.set_input(5, True)
    assert [text for _, text in host.timed(HOME)] == ["FF AA 03 0F 00 00", DONE]
    quiet = Host()
    quiet.device.set_input(5, True)
    assert quiet.say(HOME) == "FF AA 03 0F 00 00"


def test_homing_at_power_on_that_is_over_at_once_tells_it_too() -> None:
    host = Host(notice_on_once=True)
    host.write([*written(1, step(1)), frame(0xAE, 1), frame(SAVE, 1)])
    host.device.set_input(5, True)
    host.device.power_cycle()
    assert [text for _, text in host.wait(0.1)] == [DONE]


# --- while it runs ---------------------------------------------------------------------------------------------------


def test_faults_come_and_go() -> None:
    host = Host()
    now = host.device.switch(reply_fault="lost", fault_every="2")
    assert (now["reply_fault"], now["fault_every"], now["echo"]) == ("lost", 2, "no")
    assert [host.say(STOP) != "" for _ in range(4)] == [True, False, True, False]
    host.device.switch(reply_fault="none")
    assert [host.say(STOP) != "" for _ in range(4)] == [True] * 4


def test_what_is_counted_is_counted_from_the_change() -> None:
    host = Host(reply_fault="lost", fault_every=3)
    host.say(STOP)
    host.device.switch(fault_every=2)
    assert [host.say(STOP) != "" for _ in range(4)] == [True, False, True, False]


@pytest.mark.parametrize(
    ("changes", "says", "expected"),
    [
        ({"echo": "six", "reply_fault": "torn"}, "'torn' is not possible", "one of none, lost, unheard"),
        ({"echo": "six", "reply_falt": "lost"}, "no option 'reply_falt'", "perhaps reply_fault"),
        ({"echo": "six", "byte_errors": 1.5}, "1.5 is not possible", "a number, 0 to 1"),
        ({"echo": "six", "ramp": "pulse"}, "ramp cannot be changed", "one of bounce"),
        ({"echo": "six", "motor": 4}, "motor cannot be changed", "one of bounce"),
    ],
)
def test_impossible_changes_change_nothing(changes: dict[str, object], says: str, expected: str) -> None:
    host = Host()
    with pytest.raises(RequestError) as caught:
        host.device.switch(**changes)
    assert says in caught.value.summary
    assert expected in caught.value.expected
    assert host.device.switches == host.bus.switches == Switches()
    assert host.say(STOP) == "FF AA 03 0D 00 00"


def test_every_switch_that_can_be_changed_is_told_and_can_be_said_again() -> None:
    host = Host()
    now = host.device.switch()
    made_for_tests = {
        name
        for name, field in Switches.__dataclass_fields__.items()
        if field.metadata["source"] == "made for tests of hosts"
    }
    assert set(now) == made_for_tests | {"turnaround", "save_time"}
    assert host.device.switch(**now) == now
    assert host.device.switch(**{name: str(value) for name, value in now.items()}) == now


def test_a_change_takes_hold_of_everything_it_is_about() -> None:
    host = Host()
    host.device.switch(turnaround=0.05, save_time=0.5, echo="yes")
    assert [at for at, _ in host.timed(STOP)] == [0.0, 0.05]
    assert [at for at, _ in host.timed(frame(SAVE, 1), 1.0)] == [0.0, 0.55]
    host.device.switch(notice_fault="late", fault_time=0.25, echo="no", dump_fault="short", bounce=2)
    ends = [at for at, text in host.timed(frame(START, 2), 1.0) if text == DONE]
    assert ends == [0.3]  # it is empty: the turnaround, and late
    assert len(host.dump(1)) == 113
    host.device.set_input(1, True)
    assert host.bus.due() is not None  # it bounces


def test_the_home_switch_breaks_and_is_mended_while_the_motor_turns() -> None:
    host = Host()
    host.write(written(1, step(1)))
    host.say(HOME, 1.0)
    host.device.switch(home_switch="stuck")
    assert (host.device.status()["phase"], host.device.state.homed) == ("idle", True)
    assert host.say(READ_5) == "FF AA 00 0B 05 01"
    host.device.switch(home_switch="never")
    assert host.say(READ_5) == "FF AA 00 0B 05 00"
    host.device.set_input(5, True)
    assert host.say(READ_5) == "FF AA 00 0B 05 00"
    host.device.switch(home_switch="free")
    host.device.set_input(5, True)
    assert host.say(READ_5) == "FF AA 00 0B 05 01"


def test_a_home_switch_may_be_wired_while_the_motor_turns() -> None:
    host = Host(home_switch="never")
    host.write(written(1, step(1)))
    host.say(HOME, 1.0)
    host.device.switch(home_switch="wired", home_at=-4800)
    host.wait(9.0)
    assert (host.device.position, host.device.status()["load"]) == (0, -4800)
    host.device.switch(home_at=-9000)
    assert host.say(READ_5) == "FF AA 00 0B 05 00"


def test_a_home_switch_may_be_moved_while_the_motor_turns() -> None:
    host = Host(home_switch="wired", home_at=-4800)
    host.write(written(1, step(1)))
    host.say(HOME, 1.0)
    host.device.switch(home_at=-8000)
    host.wait(9.0)
    assert (host.device.position, host.device.status()["load"]) == (0, -8000)


def test_the_same_seed_said_again_gives_the_same_errors() -> None:
    host = Host(byte_errors=0.2)
    runs = []
    for _ in range(2):
        host.device.switch(seed=9)
        runs.append([host.say(STOP) for _ in range(20)])
    assert runs[0] == runs[1]
    assert len(set(runs[0])) > 5


# --- what is remarked ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("reading", "says"),
    [
        ("warn", ["project 1 is saved as project 4"]),
        ("refuse", ["project 1 is selected and not saved as project 4"]),
        ("allow", []),
    ],
)
def test_how_saving_as_another_project_is_remarked(reading: str, says: list[str]) -> None:
    host = Host(save_cross=reading)
    host.say(frame(SAVE, 4))
    assert texts(host) == says


def test_a_remark_has_its_moment_since_the_beginning() -> None:
    host = Host()
    host.wait(2.5)
    host.say(frame(SAVE, 4))
    ((count, at, _),) = host.device.log
    assert (count, at) == (1, 2.5)


def test_it_remarks_what_it_did_not_hear() -> None:
    host = Host(save_time=1.0, deaf_while_moving=True)
    host.say((frame(SAVE, 1) + STOP * 17), 3.0)
    assert texts(host)[-1] == f"16 requests wait already: {STOP.hex(' ').upper()} is forgotten"
    host.write(written(1, step(1)), within=1.2)
    host.say(frame(START, 1), 0.5)
    host.say(STOP, 0.1)
    assert texts(host)[-1] == "fault: it moves and does not hear 11 bytes"
    host.bus.tune(115200)
    host.bus.tune(19200)
    assert texts(host)[-1] == "the host is at 115200 bit/s and this at 9600: neither hears the other"


def test_it_remarks_a_save_that_the_supply_has_cut() -> None:
    host = Host(save_time=1.0)
    host.say(frame(SAVE, 1), 0.5)
    assert host.device.status()["saving"] == 1
    host.device.power_cycle()
    assert host.device.status()["saving"] is None
    assert texts(host) == ["the supply has cut the saving of project 1"]
    assert host.dump(1) == DUMP_A


def test_numbers_out_of_range_that_are_acknowledged_are_remarked() -> None:
    host = Host(out_of_range="ack")
    assert host.say(frame(3, 1, *number(0, 2), 180)) == "FF AA 03 01 00 00"
    assert texts(host) == ["set_microstep_and_angle: microsteps 0 is out of range"]
    assert host.dump(1) == DUMP_A
