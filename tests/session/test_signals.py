"""Whoever is told to end leaves its machine first; a handler that the program has set is nobody's business."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from typing import Any

import pytest

from motorbus import AsyncRobot, Robot
from motorbus.session.signals import NAMES, Signals, ended
from tests.motion.machines import machine

ENDING = [getattr(signal, name) for name in NAMES if hasattr(signal, name)]


@contextmanager
def handled(handler: Any) -> Iterator[None]:
    """These signals have this handler meanwhile."""
    before = {number: signal.signal(number, handler) for number in ENDING}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def now() -> set[Any]:
    return {signal.getsignal(number) for number in ENDING}


def test_there_is_one_that_tells_a_process_to_end_on_every_system() -> None:
    assert signal.SIGTERM in ENDING


def test_it_takes_those_that_nobody_has_and_gives_them_back() -> None:
    heard: list[int] = []
    with handled(signal.SIG_DFL):
        signals = Signals(heard.append)
        signals.take()
        for number in ENDING:
            signal.raise_signal(number)
        signals.give_back()
        assert heard == ENDING
        assert now() == {signal.SIG_DFL}
        signals.give_back()


@pytest.mark.parametrize("own", [signal.SIG_IGN, lambda *_: None])
def test_a_handler_of_the_program_stays(own: Any) -> None:
    with handled(own), machine(arm="1") as (made, _):
        with Robot.of(made):
            assert now() == {own}
        assert now() == {own}


def test_one_that_is_set_meanwhile_stays_as_well() -> None:
    def own(*_: object) -> None:
        pass

    with handled(signal.SIG_DFL), machine(arm="1") as (made, _):
        with Robot.of(made):
            signal.signal(signal.SIGTERM, own)
        assert signal.getsignal(signal.SIGTERM) is own


def test_another_thread_takes_none() -> None:
    found: list[set[Any]] = []

    def work() -> None:
        with machine(arm="1") as (made, _), Robot.of(made):
            found.append(now())

    with handled(signal.SIG_DFL):
        thread = Thread(target=work)
        thread.start()
        thread.join(60)
        assert found == [{signal.SIG_DFL}]


def test_a_robot_takes_none_before_its_with_and_has_none_after_it() -> None:
    with handled(signal.SIG_DFL), machine(arm="1") as (made, _):
        robot = Robot.of(made)
        assert now() == {signal.SIG_DFL}
        with robot:
            assert signal.SIG_DFL not in now()
        assert now() == {signal.SIG_DFL}


@pytest.mark.parametrize("number", ENDING)
def test_it_ends_as_the_shell_says(number: int) -> None:
    with pytest.raises(SystemExit) as caught:
        ended(number)
    assert caught.value.code == 128 + number


def test_a_task_of_an_event_loop_is_cancelled_leaves_its_machine_and_ends() -> None:
    async def main(left: list[int]) -> None:
        with machine(arm="1-2", exit="torque_off") as (made, sims):
            try:
                async with AsyncRobot.of(made) as robot:
                    await robot.enable_torque()
                    asyncio.get_running_loop().call_later(0, signal.raise_signal, signal.SIGTERM)
                    await asyncio.sleep(3600)
            finally:
                left += [sims["arm"][node].memory["torque_enable"] for node in (1, 2)]

    left: list[int] = []
    with handled(signal.SIG_DFL):
        with pytest.raises(SystemExit) as caught:
            asyncio.run(main(left))
        assert now() == {signal.SIG_DFL}
    assert (caught.value.code, left) == (143, [0, 0])
