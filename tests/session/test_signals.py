"""Whoever is told to end leaves its machine first; a handler that the program has set is nobody's business."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from typing import Any

import pytest

from motorbus import AsyncRobot, Robot
from motorbus.session.signals import NAMES, Kept, Signals, interrupted, uncut
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
    heard: list[object] = []
    with handled(signal.SIG_DFL):
        signals = Signals(lambda error, frame: heard.append(error.args[0]))
        signals.take()
        for number in ENDING:
            signal.raise_signal(number)
        signals.give_back()
        assert heard == [128 + number for number in ENDING]
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
    with handled(signal.SIG_DFL), machine(arm="1") as (made, _):
        with pytest.raises(SystemExit) as caught, Robot.of(made):
            signal.raise_signal(number)
        assert caught.value.code == 128 + number


@contextmanager
def ctrl_c(handler: Any) -> Iterator[None]:
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def test_python_s_own_handler_of_ctrl_c_is_stood_in_for_and_given_back() -> None:
    with ctrl_c(signal.default_int_handler), machine(arm="1") as (made, _):
        with Robot.of(made):
            assert signal.getsignal(signal.SIGINT) is not signal.default_int_handler
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("own", [signal.SIG_IGN, signal.SIG_DFL, lambda *_: None])
def test_no_other_handler_of_ctrl_c_is(own: Any) -> None:
    with ctrl_c(own), machine(arm="1") as (made, _), Robot.of(made):
        assert signal.getsignal(signal.SIGINT) is own


def test_the_handler_of_an_asyncio_runner_stays() -> None:
    async def main() -> None:
        with machine(arm="1") as (made, _):
            before = signal.getsignal(signal.SIGINT)
            assert before is not signal.default_int_handler
            async with AsyncRobot.of(made):
                assert signal.getsignal(signal.SIGINT) is before
            with Robot.of(made):
                assert signal.getsignal(signal.SIGINT) is before

    with ctrl_c(signal.default_int_handler):
        asyncio.run(main())


def test_what_falls_where_nothing_is_cut_off_is_kept_until_its_end() -> None:
    class Ending:
        _kept = Kept()
        steps = 0

        @uncut
        def close(self) -> None:
            for error in (KeyboardInterrupt(), SystemExit(143)):
                interrupted(error, sys._getframe())
                self.steps += 1
            self._kept.end(None)

        @uncut
        def over(self) -> None:
            interrupted(SystemExit(129), sys._getframe())

    ending = Ending()
    with pytest.raises(KeyboardInterrupt):
        ending.close()
    assert ending.steps == 2
    with pytest.raises(SystemExit, match="129"):
        ending.over()


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


def test_what_another_thread_closes_leaves_handlers_that_do_as_those_before_and_goes_at_the_end() -> None:
    with handled(signal.SIG_DFL), ctrl_c(signal.default_int_handler), machine(arm="1") as (made, _):
        found: list[BaseException] = []
        with Robot.of(made) as robot:

            def close() -> None:
                try:
                    robot.close()
                except BaseException as error:
                    found.append(error)

            thread = Thread(target=close)
            thread.start()
            thread.join(60)
            assert not found
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        assert now() == {signal.SIG_DFL}


def test_a_signal_behind_that_ends_the_process_as_it_would_have_before() -> None:
    program = """
import signal, sys, threading
from motorbus.session.signals import Signals
signals = Signals(lambda error, frame: print("told"))
signals.take()
thread = threading.Thread(target=signals.give_back)
thread.start()
thread.join()
signal.raise_signal(signal.SIGTERM)
print("lives on")
"""
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert told.returncode
    assert not told.stdout
