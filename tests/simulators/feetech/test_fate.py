"""What happens by itself happens in order of time, each at its own moment, and costs nothing before."""

from __future__ import annotations

import pytest

from tests.simulators.feetech.host import Host


def burdened(*torques: float) -> Host:
    """Servos that hold their place, and have done so for no time yet."""
    host = Host(tuple(range(1, len(torques) + 1)), goal_at_power_up="present").wait(0.0)
    for id, torque in enumerate(torques, start=1):
        host.write(id, 40, 1)
        host.bus.nodes[id].torque = torque
    return host


def test_each_trips_at_its_own_moment() -> None:
    host = burdened(0.9, 0.95, 0.5)
    host.bus.nodes[2].memory["overload_time"] = 50  # 0.5 s
    host.bus.nodes[2].move(host.now)
    host.wait(100.0)
    first, second, third = host.bus.servos
    assert (first.motion.start, second.motion.start) == pytest.approx((3.0, 1.5))
    assert (first.tripped, second.tripped, third.tripped) == (True, True, False)


def test_what_follows_from_it_follows_at_once() -> None:
    # tripped after 2 s, it has a fifth of its torque left, and an outside of 0.9 that is stronger
    host = Host(goal_at_power_up="present", overpowered="yields").wait(0.0)
    servo = host.bus.nodes[1]
    host.write(1, 40, 1)
    servo.torque = 0.9
    host.wait(2.0 + 0.7 * 3400 / 25_400)
    assert servo.motion.velocity(host.now) == pytest.approx(-0.7 * 3400)


def test_a_moment_that_was_put_off_does_no_harm() -> None:
    host = burdened(0.9)
    host.wait(1.9)
    host.bus.nodes[1].torque = 0.0
    host.wait(100.0)
    assert not host.bus.nodes[1].tripped


def test_the_clock_shows_the_moment_and_never_goes_back() -> None:
    host = burdened(0.9)
    servo = host.bus.nodes[1]
    seen: list[float] = []
    fire = servo.protection.fire

    def watched(at: float) -> None:
        seen.append(host.bus.now)
        fire(at)

    servo.protection.fire = watched  # type: ignore[method-assign]
    host.wait(50.0)
    assert seen == [pytest.approx(3.0)]
    assert host.bus.now == 51.0
