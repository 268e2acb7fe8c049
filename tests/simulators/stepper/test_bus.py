"""Time on the line: who is heard when, what waits, what a power cut takes, and that nothing depends on who looks."""

from __future__ import annotations

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.errors import RequestError
from motorbus.families.stepper.simulator import Change, simulate
from motorbus.link.memory import MemoryLink
from tests.protocol.stepper.vectors import DUMP_A
from tests.simulators.stepper.host import (
    DONE,
    FORWARD,
    READ,
    SAVE,
    START,
    STOP,
    Host,
    frame,
    step,
    written,
)


def test_a_reply_begins_after_the_turnaround() -> None:
    assert Host(turnaround=0.004).timed(STOP) == [(0.004, "FF AA 03 0D 00 00")]


def test_requests_wait_for_one_another() -> None:
    host = Host(save_time=0.1)
    times = [at for at, _ in host.timed(frame(SAVE, 1) + STOP, 1.0)]
    assert times[0] == pytest.approx(0.102)
    assert times[1] == pytest.approx(0.104)


def test_no_more_than_so_many_requests_wait() -> None:
    host = Host(save_time=0.1)
    answers = host.timed(STOP * 40, 5.0)
    assert 16 <= len(answers) < 40


def test_at_another_rate_nobody_hears_anybody() -> None:
    host = Host()
    host.bus.tune(19200)
    assert host.say(STOP) == ""
    for rate in (9600, 0):
        host.bus.tune(rate)
        assert host.say(STOP) != ""


def test_a_can_frame_is_for_another_bus() -> None:
    bus = simulate()
    bus.receive(CanFrame(1, STOP[:8]), 0.0)
    assert bus.advance(1.0) == []


def test_a_notice_may_come_between_a_request_and_its_reply_by_itself() -> None:
    host = Host(turnaround=0.1)
    host.write(written(1, step(1)), within=0.2)
    host.say(frame(START, 1), 0.95)
    assert [text for _, text in host.timed(frame(0, 0x0B, 1), 1.0)] == [DONE, "FF AA 00 0B 01 00"]


def test_a_notice_that_is_due_in_a_dump_comes_behind_it() -> None:
    host = Host()
    host.write(written(2, step(1)))
    host.say(frame(START, 2), 0.9)
    link = MemoryLink(host.bus, rate=9600, pace=True, start=host.now)
    link.write(frame(READ, 1))
    heard = [(link.now() - host.now, data) for _ in range(2) for data in link.read(host.now + 2.0)]
    assert [len(data) for _, data in heard] == [226, 2]
    assert heard[0][0] == pytest.approx((11 + 226) * 10 / 9600 + 0.002)
    assert heard[1][0] == pytest.approx((11 + 226 + 2) * 10 / 9600 + 0.002)


def test_an_echo_comes_before_the_reply() -> None:
    host = Host(echo=True)
    assert host.say(STOP) == STOP.hex(" ").upper() + " FF AA 03 0D 00 00"


def test_it_may_be_deaf_while_it_moves() -> None:
    host = Host(deaf_while_moving=True)
    host.write(written(1, step(1, delay=500)))
    host.say(frame(START, 1), 0.5)
    assert host.say(STOP, 0.1) == ""
    host.wait(0.5)
    assert host.say(STOP) == "FF AA 03 0D 00 00"  # it pauses, so it hears


def test_a_contact_bounces() -> None:
    host = Host(bounce=3, bounce_ms=10.0, start_input="edge")
    host.write(written(1, step(1, wait=1), step(2, wait=1), step(3, wait=1), step(4, wait=1, distance=0)))
    host.say(frame(START, 1), 0.1)
    host.device.set_input(1, True)
    host.wait(0.2)
    assert [one.kind for one in host.device.told] == ["waits", "begins"]
    quick = Host(bounce=3, bounce_ms=10.0, start_input="edge")
    quick.write(written(1, *(step(n, wait=1, distance=0) for n in range(1, 5))))
    quick.say(frame(START, 1), 0.1)
    quick.device.set_input(1, True)
    assert [text for _, text in quick.wait(0.2)] == [DONE]  # one press went through four steps


def test_a_script_of_inputs_begins_with_the_supply() -> None:
    bus = simulate()
    bus.script([Change(0.5, 2, True), Change(1.5, 2, False)])
    levels = []
    for at in (1000.0, 1000.6, 1001.6):
        bus.receive(frame(0, 0x0B, 2), at)
        levels += [data[-1] for _, data in bus.advance(at + 0.1) if isinstance(data, bytes)]
    assert levels == [0, 1, 0]


def test_a_script_is_no_reason_to_begin_at_another_moment_than_told() -> None:
    bus = simulate()
    bus.script("0.0 2 on  # at once\n3600 1 on")
    assert bus.due() is None
    bus.advance(1000.0)
    assert bus.nodes[1].status()["inputs"] == [2]
    assert bus.due() == 4600.0


def test_a_hand_on_a_button_needs_no_supply() -> None:
    host = Host()
    host.bus.press(1, True, host.now + 1.0)
    host.device.unplug()
    host.wait(2.0)
    host.device.plug()
    assert host.say(frame(0, 0x0B, 1)) == "FF AA 00 0B 01 01"
    with pytest.raises(RequestError, match="no input 9"):
        host.bus.press(9, True, 0.0)


def test_what_waits_on_the_line_is_lost_with_the_supply() -> None:
    host = Host(turnaround=0.1)
    host.bus.receive(STOP, host.now)
    host.device.power_cycle()
    assert host.wait(1.0) == []
    assert host.say(STOP) == "FF AA 03 0D 00 00"


def test_it_says_when_something_happens_next() -> None:
    host = Host()
    assert host.bus.due() is None
    host.write(written(1, step(1)))
    assert host.bus.due() is None
    host.bus.receive(frame(START, 1), host.now)
    assert host.bus.due() == pytest.approx(host.now + 0.002)
    host.wait(0.5)
    assert host.bus.due() == pytest.approx(host.now + 0.5)
    host.wait(1.0)
    assert host.bus.due() is None
    host.say(FORWARD)
    assert host.bus.due() is None  # it turns until it is told otherwise


def test_nothing_depends_on_how_often_somebody_looks() -> None:
    runs = []
    for looks in (1, 700):
        host = Host()
        host.write(written(1, step(1, delay=200), step(2, direction=1, delay=300), repeat=2))
        host.bus.receive(frame(START, 1), host.now)
        heard = [one for _ in range(looks) for one in host.wait(7.0 / looks)]
        runs.append([(round(at, 6), text) for at, text in heard])
    assert runs[0] == runs[1]
    assert [text for _, text in runs[0]] == ["FF AA 4E 01 00 00", DONE]


def test_a_clock_may_begin_anywhere() -> None:
    bus = simulate()
    bus.receive(frame(READ, 1), 5e5)
    ((at, data),) = bus.advance(5e5 + 1)
    assert at == pytest.approx(5e5 + 0.002)
    assert data == DUMP_A
    assert bus.controller.state.since == 5e5


def test_moments_that_go_back_count_as_the_latest() -> None:
    host = Host()
    host.wait(10.0)
    host.bus.receive(STOP, 3.0)
    ((at, _),) = host.bus.advance(11.0)
    assert at == pytest.approx(10.002)
