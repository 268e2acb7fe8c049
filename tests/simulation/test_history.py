"""A history tells what was true when, changes nothing of what it stands in front of, and forgets only when asked to."""

from __future__ import annotations

import pytest

from motorbus.bus.pump import Bus
from motorbus.core.family import Family
from motorbus.errors import RequestError
from motorbus.families import feetech, kst, stepper
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from motorbus.simulation.history import History

RATES = {"feetech": 1_000_000, "kst": 500_000, "stepper": 9600}


class Bench:
    """A family's simulated devices with their history, and a bus to them."""

    def __init__(self, family: Family, *ids: int, keep: int | None = None, **options: object) -> None:
        self.history = History(family.simulator(ids, "", **options), keep=keep)
        self.link = MemoryLink(self.history, rate=RATES[family.name])
        self.bus = Bus(self.link, family.configured(), admit=Gate(), report=lambda event: None)

    def now(self) -> float:
        """A moment that nothing else has, and what is so just before is known."""
        self.link.advance(0.001)
        self.history.look(self.link.now())
        self.link.advance(0.001)
        return self.link.now()


def accelerate(servo: feetech.Servo, raw: int) -> None:
    """Write the acceleration of a servo as a raw value."""
    servo.prepare()
    assert servo.table is not None
    servo.write(acceleration=servo.value(servo.table["acceleration"], raw))


def test_a_value_was_held_from_its_write_on_and_the_one_before_until_then() -> None:
    bench = Bench(feetech.FAMILY, 1, 2)
    servo = feetech.Servo(bench.bus, 1)
    accelerate(servo, 7)
    since = bench.now()
    accelerate(servo, 77)
    until = bench.now()
    assert bench.history.held(1, "acceleration", since, until) == {7, 77}
    assert bench.history.held(1, "acceleration", until, bench.now()) == {77}
    assert bench.history.applied(1, "acceleration", since, until) == [77]
    assert bench.history.applied(1, "acceleration", until, bench.now()) == []
    assert bench.history.held(2, "acceleration", 0.0, until) == {0}, "the other one was not written to"
    assert bench.history.heard > 0


def test_what_a_servo_works_out_is_known_without_anybody_reading_it() -> None:
    bench = Bench(feetech.FAMILY, 1)
    bench.history.simulator.servos[0].raw_position = 1234
    since = bench.now()
    bench.link.advance(0.001)
    bench.history.simulator.servos[0].raw_position = 4000
    until = bench.now()
    assert bench.history.held(1, "present_position", since, since) == {1234}
    assert bench.history.held(1, "present_position", since, until) == {1234, 4000}


def test_a_movement_counts_as_what_it_was_whenever_something_passed() -> None:
    bench = Bench(feetech.FAMILY, 1)
    servo = feetech.Servo(bench.bus, 1)
    servo.enable_torque()
    servo.move(1.0, wait=False)
    for _ in range(20):
        bench.link.advance(0.01)
        since = bench.link.now()
        told = servo.read_raw("present_position", "present_velocity", "moving", "goal_position_echo")
        for name, raw in told.items():
            assert raw in bench.history.held(1, name, since, bench.link.now())
    assert bench.history.changes() > 10
    assert len(bench.history.held(1, "present_position", 0.0, bench.link.now())) > 10


def test_of_two_servos_with_one_id_what_either_held_was_held() -> None:
    bench = Bench(feetech.FAMILY, 1, 2, duplicate="1")
    here, _, twin = bench.history.simulator.servos
    here.raw_position, twin.raw_position = 100, 200
    now = bench.now()
    assert bench.history.held(1, "present_position", now, now) == {100, 200}


def test_a_second_servo_may_come_later() -> None:
    bench = Bench(feetech.FAMILY, 3)
    since = bench.now()
    bench.history.duplicate(3)
    bench.history.simulator.servos[1].memory["acceleration"] = 9
    until = bench.now()
    assert bench.history.held(3, "acceleration", since, until) == {0, 9}


def test_a_servo_is_found_by_the_id_it_had_then() -> None:
    bench = Bench(feetech.FAMILY, 1)
    servo = feetech.Servo(bench.bus, 1)
    before = bench.now()
    servo.set_id(9)
    after = bench.now()
    assert bench.history.held(9, "id", before, before) == set()
    assert bench.history.held(9, "id", before, after) == {9}
    assert bench.history.held(1, "id", after, after) == set()


def test_objects_of_a_servo_on_can() -> None:
    bench = Bench(kst.FAMILY, 0x25)
    servo = kst.Servo(bench.bus, 0x25)
    since = bench.now()
    servo.move(0.5, wait=False)
    until = bench.now()
    goal = servo.table["goal_position"].to_raw(0.5)
    assert bench.history.applied(0x25, "goal_position", since, until) == [goal]
    bench.link.advance(0.1)
    places = bench.history.held(0x25, "present_position", since, bench.now())
    assert {0} < places


def test_a_stepper_controller_shows_its_project_its_images_and_its_pins() -> None:
    bench = Bench(stepper.FAMILY, 1)
    controller = stepper.Controller(bench.bus)
    since = bench.now()
    controller.set_output(2, True)
    controller.set_step_delay(1, 777)
    bench.history.nodes[1].set_input(3, True)  # type: ignore[attr-defined]  # a simulated controller has it
    until = bench.now()
    assert bench.history.applied(1, "output_2", since, until) == [1]
    assert bench.history.applied(1, "input_3", since, until)[-1] == 1
    assert bench.history.applied(1, "step_1_delay", since, until) == [777]
    images = bench.history.held(1, "image_1", since, until)
    assert len(images) >= 1
    assert all(isinstance(image, bytes) and len(image) == 220 for image in images)


def test_a_history_that_keeps_little_says_so_when_it_is_asked_for_more() -> None:
    bench = Bench(feetech.FAMILY, 1, keep=3)
    servo = feetech.Servo(bench.bus, 1)
    for raw in range(1, 10):
        accelerate(servo, raw)
        bench.link.advance(0.001)
    assert bench.history.changes() <= 2
    now = bench.now()
    assert bench.history.held(1, "acceleration", now, now) == {9}
    with pytest.raises(RequestError, match="lies before the 3 changes"):
        bench.history.held(1, "acceleration", 0.0, now)


def test_what_shows_nothing_has_no_history() -> None:
    with pytest.raises(RequestError, match="does not show"):
        History(object())  # type: ignore[arg-type]
    with pytest.raises(RequestError, match="a history of 1"):
        History(feetech.FAMILY.simulator((1,)), keep=1)


@pytest.mark.parametrize("family", [feetech.FAMILY, kst.FAMILY, stepper.FAMILY])
def test_with_a_history_the_devices_answer_the_same_at_the_same_moments(family: Family) -> None:
    def run(*, remembered: bool) -> list[object]:
        simulator = family.simulator((1,))
        link = MemoryLink(History(simulator) if remembered else simulator, rate=RATES[family.name], pace=True)
        bus = Bus(link, family.configured(), admit=Gate())
        device = family.devices.blocking(bus, 1)
        return [(device.read(), link.now()) for _ in range(3)]

    assert run(remembered=True) == run(remembered=False)
