"""Stopping: two commands, each until it is accepted, and no more is promised than that they were heard."""

from __future__ import annotations

from math import inf

import pytest

from motorbus.errors import LinkError, OutcomeUnknown
from motorbus.families.stepper import FAMILY, Promise
from motorbus.families.stepper.driver.stopping import BY_HAND, ended
from motorbus.families.stepper.execution import Phase
from tests.families.stepper.bench import Bench, Tampering, bench

PROJECT = "FF AA 5E 00 00 00 00 00 00 00 07"
MOTOR = "FF AA 03 0D 00 00 00 00 00 00 B9"
JOG = "FF AA 03 0A 00 00 00 00 00 00 B6"
START = "FF AA 4E 01 00 00 00 00 00 00 F8"
READS = ("FF AA 3E", "FF AA 00 0B")


def is_stopped_last(sent: list[str]) -> bool:
    """Whether the last that was said, but for readings, has ended a motion by hand."""
    return [one for one in sent if not one.startswith(READS)][-2:] == [MOTOR, PROJECT]


class Losing(Tampering):
    """Swallows replies that begin so, as often as said."""

    def __init__(self, begin: str, times: int = 1_000_000) -> None:
        super().__init__()
        self.begin, self.times = bytes.fromhex(begin), times

    def change(self, data: bytes, number: int) -> bytes:
        if data.startswith(self.begin) and self.times:
            self.times -= 1
            return b""
        return data


def turning(there: Bench, request: str = JOG) -> None:
    assert there.device.ping()
    there.press(request)
    assert there.simulated.moving
    there.sent()


def at_rest(there: Bench) -> bool:
    there.link.advance(1.0)
    before = there.simulated.position
    there.link.advance(1.0)
    return there.simulated.position == before and there.simulated.state.phase is Phase.IDLE


def test_both_commands_are_said_in_order() -> None:
    with bench() as there:
        turning(there, START)
        assert there.device.stop() is Promise.STOP_ACCEPTED
        assert there.sent() == [PROJECT, MOTOR]
        assert at_rest(there)


def test_a_jog_is_stopped() -> None:
    with bench() as there:
        turning(there)
        there.device.stop()
        assert at_rest(there)


def test_no_more_is_promised_than_that_it_was_accepted() -> None:
    assert Promise.STOP_ACCEPTED.value.startswith("stop accepted")
    assert "nothing tells when it rests" in FAMILY.open().stop({}).promise


@pytest.mark.parametrize("times", [1, 2, 4])
def test_what_was_not_accepted_is_said_again_and_the_rest_is_not(times: int) -> None:
    with bench(line=Losing("FF AA 5E", times)) as there:
        turning(there)
        assert there.device.stop() is Promise.STOP_ACCEPTED
        assert there.sent() == [PROJECT, MOTOR] + [PROJECT] * times
    with bench(line=Losing("FF AA 03 0D", times)) as there:
        turning(there)
        assert there.device.stop() is Promise.STOP_ACCEPTED
        assert there.sent() == [PROJECT, MOTOR] + [MOTOR] * times


def test_both_are_said_though_the_first_never_is_accepted() -> None:
    with bench(line=Losing("FF AA 5E")) as there:
        turning(there)
        with pytest.raises(
            OutcomeUnknown, match="stop project was not accepted, said 5 times: the motor may be"
        ):
            there.device.stop()
        assert there.sent() == [PROJECT, MOTOR] + [PROJECT] * 4
        assert at_rest(there)
        assert (there.device.memory.stops, there.device.memory.wanted) == (0, 1)


def test_a_controller_that_hears_every_third_frame_only_is_told_both_soon() -> None:
    """Whichever is not heard, the other leaves in the same round: it may be the one that ends this motion."""
    with bench(line=Losing("FF AA", 1)) as there:
        there.press(JOG)
        there.device.stop()
        assert there.sent() == [PROJECT, MOTOR, PROJECT]
        assert at_rest(there)


def test_a_motion_by_hand_is_stopped_by_its_own_command_first() -> None:
    with bench(line=Losing("FF AA", 3)) as there:
        there.press(JOG)
        there.run(ended(there.device, BY_HAND))
        assert there.sent() == [MOTOR, PROJECT, MOTOR, PROJECT, MOTOR]
        memory = there.device.memory
        assert (memory.stops, memory.wanted, memory.stopping) == (1, 0, 0)


def test_neither_was_accepted_and_both_are_named() -> None:
    with bench(line=Losing("FF AA")) as there:
        there.press(JOG)
        with pytest.raises(OutcomeUnknown, match="stop project and stop motor were not accepted"):
            there.device.stop()
        assert there.sent() == [PROJECT, MOTOR] * 5


def test_what_was_accepted_is_counted_and_nothing_is_owed_any_more() -> None:
    with bench() as there:
        turning(there, START)
        there.device.memory.owed, there.device.memory.turning = True, 1e9
        there.device.stop()
        memory = there.device.memory
        assert (memory.stops, memory.wanted, memory.owed, memory.turning) == (1, 1, False, -inf)


def test_a_port_that_is_gone_is_what_is_told() -> None:
    with bench() as there:
        turning(there)
        there.link.close()
        with pytest.raises(LinkError) as caught:
            there.device.stop()
        assert caught.value.__notes__ == ["the stop was not accepted: the motor may be turning"]


@pytest.mark.parametrize("request_", [JOG, START])
def test_an_emergency_stop_ends_a_project_and_a_jog(request_: str) -> None:
    with bench() as there:
        turning(there, request_)
        outcome = there.bus.estop()
        assert (outcome.acknowledged, outcome.silent, outcome.rounds) == ((1,), (), 1)
        assert there.sent() == [PROJECT, MOTOR]
        assert at_rest(there)


def test_an_emergency_stop_goes_before_anybody_has_answered() -> None:
    with bench() as there:
        there.press(JOG)
        there.bus.estop()
        assert there.sent()[:2] == [PROJECT, MOTOR]
        assert at_rest(there)


@pytest.mark.parametrize("lost", ["FF AA 5E", "FF AA 03 0D"])
def test_an_emergency_stop_is_acknowledged_when_both_are_and_not_before(lost: str) -> None:
    with bench(line=Losing(lost)) as there:
        turning(there)
        outcome = there.bus.estop()
        assert (outcome.acknowledged, outcome.silent, outcome.rounds) == ((), (1,), 5)
        assert there.sent() == [PROJECT, MOTOR] * 5
        assert at_rest(there)
    with bench(line=Losing(lost, 1)) as there:
        turning(there)
        outcome = there.bus.estop()
        assert (outcome.acknowledged, outcome.silent, outcome.rounds) == ((1,), (), 2)
