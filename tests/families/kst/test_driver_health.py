"""How a servo fares, by what its make tells, and whether it has said that it starts."""

from __future__ import annotations

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Request
from motorbus.families.kst import BusSettings, Node
from motorbus.families.kst.driver.feedback import health
from motorbus.families.kst.notifications import BusState, FrameReceiver
from tests.families.kst.bench import bench, node, play

POSITION = "605#4002600000000000"
STATUS = "605#4005600000000000"


def test_by_the_manual_it_tells_where_it_is_and_no_more() -> None:
    request = health(Node(5))
    assert isinstance(request, Request)
    assert request.reports_position
    found = play(request, (POSITION, "4b02600084030000"))
    assert found.state.position == pytest.approx(1.5707963)
    assert (found.torque, found.blank, found.restarts) == (None, None, None)
    assert (found.state.current, found.state.temperature) == (None, None)


def test_newer_firmware_tells_current_and_temperature_in_one_exchange() -> None:
    request = health(node("kst-ext"))
    assert isinstance(request, Request)
    assert not request.reports_position
    found = play(request, (STATUS, "430560002c01f600"))
    assert found.state.current == pytest.approx(3.0)
    assert found.state.temperature == -10.0
    assert found.state.position is None


def test_an_open_bus_counts_the_boot_messages_of_a_node() -> None:
    state = BusState()
    receiver, servo = FrameReceiver(state=state), Node(5, BusSettings(state=state))
    frames = ("", "705#00", "706#00", "705#05", "705#00", "705#0000", "385#0A020000")
    for said, restarts in zip(frames, (0, 1, 1, 1, 2, 2, 2), strict=True):
        if said:
            name, _, data = said.partition("#")
            receiver.feed(CanFrame(int(name, 16), bytes.fromhex(data)))
        found = play(health(servo), (POSITION, "4b02600084030000"))
        assert found.restarts == restarts


def test_a_simulated_servo_says_it_where_the_switch_says_so() -> None:
    for says in (False, True):
        with bench(boot_notice=says) as there:
            servo = there.servo()
            assert servo.bus.run(health(servo)).restarts == 0
            there.sim().power_cycle()
            assert servo.bus.run(health(servo)).restarts == int(says)
