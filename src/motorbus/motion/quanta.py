"""Jogging: an axis moves while somebody asks for it again and again, and stops by itself when nobody does.

    with robot.jogging("shoulder", 0.3) as hand:
        while key_is_down():
            hand.beat()                          # goes on for a fifth of a second, and returns

Each beat is worth one quantum of motion, and no motion is ordered without one: a program that dies, hangs, or has lost
its connection to whoever holds the key down leaves an axis that comes to its end by itself. A device that can be led
gets small goals, each one cycle ahead. One that moves by a profile of its own makes one bounded move for each beat.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import Any, Final, Self

from motorbus.errors import RequestError
from motorbus.motion import limits
from motorbus.motion.loop.faces import AsyncLoop, Loop
from motorbus.motion.loop.readings import LoopState
from motorbus.motion.moving.jogging import jog
from motorbus.motion.parallel import Parallel, settled

QUANTUM: Final = 0.2
"""s of travel that a beat is worth; with what a command is ahead of the device less than the 0.25 s that it may be."""
LONGEST: Final = 0.25
"""s of travel that one order may be worth."""
RATE: Final = 50.0
"""Hz at which an axis is led, when nobody says another rate."""


class _Jog:
    """What a blocking and an async jogging have in common; `velocity` in rad/s (m/s), with its sign."""

    def __init__(self, robot: Any, name: str, velocity: float, rate: float = RATE) -> None:
        axis = robot.axis(name)
        limits.check_velocity(axis.name, axis.spec, velocity)
        if not velocity:
            raise RequestError(
                f"{name}: a velocity of 0 is no jog", expected="another one", advice="nothing was sent"
            )
        limits.check_number("rate", rate)
        if not (isfinite(rate) and rate >= 1 / LONGEST):
            raise RequestError(
                f"rate is {rate}",
                expected=f"a finite number of Hz, at least {1 / LONGEST:g}",
                cause="an order is as far ahead as a cycle is long, and must not be farther",
                advice="nothing was sent",
            )
        if "stream" not in axis.able and "jog" not in axis.able:
            raise RequestError(f"{name}: {axis.spec.device} cannot jog", advice="nothing was sent")
        self._robot = robot
        self._axis = axis
        self._velocity = velocity
        self._rate = rate
        self._goal: float | None = None
        self._loop: Any = None
        self._open = False

    @property
    def _led(self) -> bool:
        return "stream" in self._axis.able

    def _check_open(self) -> None:
        if not self._open:
            raise RequestError(
                "this jogging is over", expected="beats inside its `with`", advice="nothing was sent"
            )

    def _started(self, state: LoopState) -> None:
        """It was seen before the first goal: from there it goes."""
        self._goal = state.position[self._axis.name]

    def _cycles(self) -> Iterator[None]:
        """A goal for each cycle of one beat; whoever iterates carries the cycle out."""
        for _ in range(max(1, int(QUANTUM * self._rate))):
            assert self._goal is not None
            ahead = self._goal + self._velocity / self._rate
            self._loop.goal[self._axis.name] = ahead
            yield
            self._goal = ahead

    def _own(self) -> Parallel[Any]:
        """One bounded move, of an axis that nobody can lead."""
        return Parallel({self._axis.spec.bus: jog(self._axis, self._velocity, QUANTUM)}, settled)


class Jogging(_Jog):
    """Of a `Robot`; use it in a `with`. When that is left the axis brakes."""

    def __enter__(self) -> Self:
        if self._led:
            self._loop = Loop(self._robot, self._robot.conductor, self._rate, self._axis.name).__enter__()
        self._open = True
        return self

    def beat(self) -> None:
        """Go on for one quantum, and return then. Raises LimitExceeded at the end of its way, and as a `Loop`."""
        self._check_open()
        if not self._led:
            self._robot.conductor.run(self._own())
            return
        if self._goal is None:
            self._started(next(self._loop))
        for _ in self._cycles():
            next(self._loop)

    def __exit__(self, *how: Any) -> None:
        self._open = False
        if self._loop is not None:
            self._loop.__exit__(*how)


class AsyncJogging(_Jog):
    """Of an `AsyncRobot`; use it in an `async with`. When that is left the axis brakes."""

    async def __aenter__(self) -> Self:
        if self._led:
            loop = AsyncLoop(self._robot, self._robot.conductor, self._rate, self._axis.name)
            self._loop = await loop.__aenter__()
        self._open = True
        return self

    async def beat(self) -> None:
        """As `Jogging.beat`."""
        self._check_open()
        if not self._led:
            await self._robot.conductor.run(self._own())
            return
        if self._goal is None:
            self._started(await anext(self._loop))
        for _ in self._cycles():
            await anext(self._loop)

    async def __aexit__(self, *how: Any) -> None:
        self._open = False
        if self._loop is not None:
            await self._loop.__aexit__(*how)


def blocking_jogging(robot: Any, name: str, velocity: float, *, rate: float = RATE) -> Jogging:
    """Move an axis at a velocity (rad/s, m/s, with its sign) while `beat()` of what this gives is called, in a `with`.

    One that can be led gets its goals at `rate` (Hz), at least 4. Raises LimitExceeded for a velocity above that of the
    axis, RequestError for one that is 0, for a rate that cannot be, and for an axis that can neither be led nor jog.
    """
    return Jogging(robot, name, velocity, rate)


def awaiting_jogging(robot: Any, name: str, velocity: float, *, rate: float = RATE) -> AsyncJogging:
    """The same for an `async with`, in which `beat()` is awaited; see `blocking_jogging`."""
    return AsyncJogging(robot, name, velocity, rate)
