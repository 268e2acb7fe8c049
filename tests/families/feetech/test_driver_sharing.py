"""Two servos on one id: seen when anything about them differs, not seen when nothing does, never seen in one."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import pytest

import motorbus
from motorbus.core.request import Effect
from motorbus.core.steps import Progress
from motorbus.errors import NoReply, RequestError
from motorbus.families.feetech.driver import Node, ScanWarning, duplicates
from motorbus.families.feetech.driver.sharing import POLLS
from motorbus.link.base import Side
from motorbus.simulation.named import Simulation
from tests.families.feetech.driver_script import Line, play, reads, watch
from tests.support.noisy_line import NoisyLine

MODELS = ("sts3215", "scs0009", "scs215-2", "sm60-360m", "sm85blhv", "hls3925")
LATE = 254
"""2 µs each: register 7 of one of the two; its answers begin when those of the other have ended."""


def asked(simulation: Simulation, polls: int = POLLS) -> ScanWarning:
    with motorbus.open(simulation.url) as bus:
        return bus.run(duplicates(Node(3), polls))


def twins(model: str = "", **options: Any) -> Simulation:
    return motorbus.simulate("feetech", ids=(3, 3), model=model, **options)


def twice(line: Line) -> Line:
    """The same request, answered by two."""
    assert isinstance(line.back, bytes)
    return Line(line.sent, [line.back, line.back])


@pytest.mark.parametrize("model", MODELS)
def test_one_alone_is_never_suspected(model: str) -> None:
    with motorbus.simulate("feetech", ids="3+4", model=model, reply_jitter=0.0002) as simulation:
        seen = asked(simulation)
    assert (seen.suspected, seen.signs, seen.silent, seen.polls) == (False, 0, 0, POLLS)


@pytest.mark.parametrize("model", MODELS)
def test_two_that_stand_elsewhere_garble_each_other(model: str) -> None:
    with twins(model) as simulation:
        simulation.simulator.servos[1].raw_position = 700  # type: ignore[attr-defined]
        seen = asked(simulation)
    assert seen.suspected
    assert seen.garbled


@pytest.mark.parametrize("jitter", [0.00005, 0.0005])
def test_two_that_begin_at_different_moments_are_heard(jitter: float) -> None:
    with twins(reply_jitter=jitter) as simulation:
        assert asked(simulation).suspected


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("rate", [0, 1_000_000, 38_400])
def test_a_simulated_duplicate_is_seen_with_the_default_settings(model: str, rate: int) -> None:
    with motorbus.simulate("feetech", ids="2-3", model=model, servo_baud=rate, duplicate=3) as simulation:
        with motorbus.open(simulation.url) as bus:
            assert not bus.run(duplicates(Node(2))).suspected
        seen = asked(simulation)
    assert seen.suspected
    assert seen.polls <= 20


def test_two_that_answer_one_after_the_other_are_heard() -> None:
    """The second answer comes behind the first, or into the next question, which has more answers then than are due."""
    with twins("scs0009") as simulation:
        simulation.simulator.servos[1].memory["return_delay"] = LATE  # type: ignore[attr-defined]
        assert asked(simulation).suspected


def test_d1_two_that_are_equal_in_everything_look_like_one() -> None:
    """As the docs say: not even 1000 questions tell, and connecting one at a time is the only proof."""
    with twins() as simulation:
        assert len(simulation.simulator.servos) == 2  # type: ignore[attr-defined]
        seen = asked(simulation, 1000)
    assert not seen.suspected
    assert seen.polls == 1000


def test_it_ends_when_it_is_plain() -> None:
    with twins() as simulation:
        simulation.simulator.servos[1].raw_position = 700  # type: ignore[attr-defined]
        assert asked(simulation).polls < 60


def test_nothing_is_written_and_progress_is_told() -> None:
    answer = reads(3, 56, *range(15))
    played = watch(duplicates(Node(3), 2), answer, twice(answer), reads(3, 5, 3))
    assert {request.effect for request in played.requests} == {Effect.NONE}
    assert [event.done for event in played.events if isinstance(event, Progress)] == [1, 2]
    quiet = watch(duplicates(Node(3), 2, quiet=True), answer, twice(answer), reads(3, 5, 3))
    assert quiet.events == []


def test_a_second_answer_and_other_contents_are_evidence() -> None:
    feedback, image = reads(3, 56, *range(15)), reads(3, 0, *range(40))
    lines = [
        feedback,
        twice(feedback),
        image,
        twice(image),
        feedback,
        twice(feedback),
        reads(3, 0, *range(1, 41)),
    ]
    in_step = reads(3, 5, 3)
    checked = [one for line in lines for one in ([line] if isinstance(line.back, bytes) else [line, in_step])]
    seen = play(duplicates(Node(3), 7), *checked, in_step)
    assert (seen.doubled, seen.changed, seen.garbled) == (3, 1, 0)
    assert seen.suspected
    assert seen.evidence == "of 7 answers 3 doubled, 1 with other EEPROM contents"


def test_a_few_garbled_answers_may_be_noise() -> None:
    assert not ScanWarning(3, 1_000_000, 200, garbled=3).suspected
    assert ScanWarning(3, 1_000_000, 200, garbled=4).suspected
    assert ScanWarning(3, 1_000_000, 200, doubled=1, changed=1).suspected
    assert ScanWarning(3, 1_000_000, 8, garbled=2).suspected
    assert not ScanWarning(3, 1_000_000, 200, silent=50).suspected
    assert "none was garbled" in ScanWarning(3, 1_000_000, 200).evidence


@pytest.mark.parametrize("seed", range(6))
def test_late_answers_are_no_second_servo(seed: int) -> None:
    """A host or a device that is held up: what comes after its time must not be heard as somebody else."""
    with motorbus.simulate("feetech", ids="3") as simulation:
        simulation.line = NoisyLine(seed, late=0.05, late_by=(0.001, 0.3), toward=Side.HOST)
        seen = asked(simulation)
    assert seen.silent
    assert not seen.suspected, seen


def test_silence_is_no_second_servo_and_nobody_at_all_is_no_reply() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        simulation.line = NoisyLine(1, loss=0.05, toward=Side.HOST)
        seen = asked(simulation)
        assert (seen.suspected, seen.silent > 0) == (False, True)
    with motorbus.simulate("feetech", ids="4") as simulation, pytest.raises(NoReply):
        asked(simulation, 20)


@pytest.mark.parametrize("polls", [0, -1, 100_001, 10**12])
def test_less_than_one_question_is_none_and_too_many_are_refused(polls: int) -> None:
    with pytest.raises(RequestError):
        play(duplicates(Node(3), polls))


def test_the_bus_is_usable_afterwards() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.open(simulation.url) as bus:
        servo = motorbus.feetech.Servo(bus, 3)
        assert not servo.duplicates(20).suspected
        assert servo.position() > 3.0


# -- figures ------------------------------------------------------------------------------------------------------


def one_pair(random: Random, model: str) -> Simulation:
    """Two on one id that differ by what they measure, by when they answer, or by both."""
    differ = random.choice(("payload", "timing", "both"))
    jitter = random.uniform(0.00001, 0.0006) if differ != "payload" else 0.0
    simulation = twins(model, reply_jitter=jitter, seed=random.randrange(1 << 30))
    if differ != "timing":
        second = simulation.simulator.servos[-1]  # type: ignore[attr-defined]
        quantity = random.choice(("position", "temperature", "voltage"))
        if quantity == "position":
            second.raw_position = second.raw_position + random.choice((-40, -1, 1, 40))
        elif quantity == "temperature":
            second.temperature = second.temperature + random.choice((-1, 1))
        else:
            second.voltage = second.voltage + random.choice((-0.1, 0.1))
    return simulation


@pytest.mark.timeout(1200)
def test_d1_pairs_that_differ_are_found_within_200_questions(rounds: Callable[[int], int]) -> None:
    """The bar is all of them; how many questions it took is printed by `make soak`."""
    random = Random(4)
    total = rounds(20_000) if rounds(20_000) == 20_000 else 60
    needed: list[int] = []
    for number in range(total):
        with one_pair(random, MODELS[number % len(MODELS)]) as simulation:
            seen = asked(simulation)
        assert seen.suspected, (number, seen)
        needed.append(seen.polls)
    if total > 60:
        needed.sort()
        print(
            f"\n{total} pairs on one id, all found: verdict after {needed[total // 2]} questions (median), "
            f"{needed[total * 99 // 100]} (99 %), {needed[-1]} (most)"
        )


@pytest.mark.timeout(1200)
def test_a_noisy_line_is_suspected_rather_than_trusted(rounds: Callable[[int], int]) -> None:
    """One servo alone: how often noise looks like two. Never on a clean line; told for noisy ones."""
    total = rounds(2_000) if rounds(20_000) == 20_000 else 20
    for corrupt in (0.0, 0.001, 0.01):
        suspected = 0
        for seed in range(total):
            with motorbus.simulate("feetech", ids="3") as simulation:
                simulation.line = NoisyLine(seed, corrupt=corrupt, toward=Side.HOST)
                suspected += asked(simulation).suspected
        assert corrupt or not suspected
        if total > 20:
            print(
                f"\none servo, {corrupt:.1%} of its packets damaged: suspected {suspected} of {total} times"
            )
