"""A signal at any step of the end of a robot, and a second one soon after: nobody is left out, and it comes out."""

from __future__ import annotations

import _thread
import dis
import operator
import signal
import sys
import weakref
from collections.abc import Iterator
from functools import partial
from types import CodeType, FrameType
from typing import Any, Final

import pytest

from motorbus import Robot
from motorbus.motion.machine import Machine
from motorbus.motion.safety.lease import Lease
from tests.motion.machines import machine
from tests.session.test_robot_ends import default_signals

EXITS = {
    "a1": {"exit": "torque_off"},
    "a2": {"exit": "hold"},
    "a3": {"exit": "park", "park": "2 deg"},
}
END: Final = (
    "session/robot.py",
    "session/signals.py",
    "session/attended.py",
    "motion/leaving.py",
    "motion/conductor.py",
)
BELOW = ("bus/pump.py", "bus/run.py", "bus/relay.py", "motion/several.py")
"""Not the operations: Python ignores what is raised in a generator that is dropped, an interruption too."""
CALLING_NOTHING = {
    dis.opmap[name]
    for name in (
        "LOAD_FAST",
        "STORE_FAST",
        "LOAD_CONST",
        "LOAD_GLOBAL",
        "POP_TOP",
        "COPY",
        "SWAP",
        "PUSH_NULL",
        "PRECALL",
    )
    if name in dis.opmap
}
"""What comes at such a step is taken at the next one, or after that."""
Step = tuple[CodeType, int]


class Mortal:
    """What is told to go when it dies."""


class Coming(weakref.ref[Mortal]):
    """Makes a signal come when its object dies, by nothing but C code: Python takes it where it would take a real one.

    Said from a trace function it would be taken in there, and tracing would be over.
    """

    come: Any


class Interrupting:
    """Interrupts at the first step of these files that was not `tried`, and `again` so many of their steps later."""

    def __init__(
        self, number: signal.Signals, files: tuple[str, ...], tried: set[Step], again: int, opcodes: bool
    ) -> None:
        self.coming = type("Coming", (Coming,), {"come": partial(_thread.interrupt_main, number)})
        self.number = number
        self.files = files
        self.tried = tried
        self.again = again
        self.opcodes = opcodes
        self.where: Step | None = None
        self.later = 0
        self.silent = False
        self.due: list[Any] = []
        self.robot: Robot | None = None

    def __call__(self, frame: FrameType, event: str, arg: object) -> Any:
        """A call: whatever was to come has come, for Python looks for signals before it says so."""
        if self.where is not None and self.later >= self.again:
            sys.settrace(None)
            return None
        if self.silent:
            self.silent = False
            for caller in callers(frame):
                self._traced(caller)
        return self.step if self._traced(frame) else None

    def _traced(self, frame: FrameType) -> bool:
        """No generator expression: Python tells of a call when it is dropped, too, and there all errors are ignored."""
        code = frame.f_code
        if code.co_name in ("left", "traced") or (
            code.co_filename.endswith(self.files) and code.co_name != "<genexpr>"
        ):
            frame.f_trace_opcodes = self.opcodes
            frame.f_trace = self.step
            return True
        return False

    def step(self, frame: FrameType, event: str, arg: object) -> Any:
        """One event of such a file; what is made here dies when this returns, and it is not called before it came."""
        mortal = Mortal()
        if event == ("opcode" if self.opcodes else "line") and self._now(frame):
            self.silent = True
            for one in (frame, *callers(frame)):
                one.f_trace = None
            self.due.append(self.coming(mortal, operator.methodcaller("come")))
            return None
        return self.step

    def _now(self, frame: FrameType) -> bool:
        here = (frame.f_code, frame.f_lasti)
        if not taken(self.number) or (
            self.opcodes and frame.f_code.co_code[frame.f_lasti] in CALLING_NOTHING
        ):
            return False
        if self.where is None and here not in self.tried:
            self.tried.add(here)
            self.where = here
            return True
        self.later += self.where is not None
        return self.later == self.again and bool(self.again)


def callers(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None and (frame := frame.f_back) is not None:
        yield frame


def taken(number: int) -> bool:
    return signal.getsignal(number) not in (signal.SIG_DFL, signal.default_int_handler)


def traced() -> None:
    """The call from which on everything is traced."""


def left(made: Machine, interrupting: Interrupting) -> Robot:
    """A robot of which one axis stands, one turns without an end, and one is to be parked: its end is interrupted."""
    with Robot.of(made) as robot:
        robot["a2"].device.set_mode("velocity")
        robot.enable_torque()
        robot.lease = lease = Lease(None)
        lease.take("test", robot.now, attended=True)
        robot["a2"].device.set_velocity(1.0)
        interrupting.robot = robot
        sys.settrace(interrupting)
        traced()
    return robot


def interruptions(
    number: signal.Signals, files: tuple[str, ...], again: int = 0, *, opcodes: bool = True
) -> Iterator[str]:
    """Interrupt at each step of it; gives where, when all is as it has to be."""
    tried: set[Step] = set()
    while True:
        with machine(arm="1-3", axes=EXITS) as (made, sims), default_signals():
            interrupting = Interrupting(number, files, tried, again, opcodes)
            error: BaseException | None = None
            before = sys.gettrace()
            try:
                left(made, interrupting)
            except (KeyboardInterrupt, SystemExit) as raised:
                error = raised
            finally:
                sys.settrace(before)
            where = str(interrupting.where)
            robot = interrupting.robot
            assert robot is not None
            kind = KeyboardInterrupt if number == signal.SIGINT else SystemExit
            assert isinstance(error, kind) == (interrupting.where is not None), where
            assert not taken(number), where
            memory = [sims["arm"][node].memory for node in (1, 2, 3)]
            assert [one["torque_enable"] for one in memory] == [0, 1, 1], where
            assert not memory[1]["goal_velocity"], where
            parked = abs(sims["arm"][3].raw_position - 2048 - 2 / 360 * 4096) < 6
            told = "\n".join([*robot.warnings, *getattr(error, "__notes__", ())])
            assert parked or "a3: not parked" in told, where
            with Robot.of(made) as another:
                assert len(another.axes) == 3
        if interrupting.where is None:
            return
        yield where


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_at_any_step_of_the_end(number: signal.Signals) -> None:
    assert len(list(interruptions(number, END[:2]))) > 80


@pytest.mark.parametrize(("number", "again"), [(signal.SIGINT, 1), (signal.SIGTERM, 6)])
def test_twice_at_any_line_of_leaving(number: signal.Signals, again: int) -> None:
    assert len(list(interruptions(number, END, again, opcodes=False))) > 120


def test_at_any_line_of_what_carries_it_out() -> None:
    assert len(list(interruptions(signal.SIGTERM, BELOW, opcodes=False))) > 60
