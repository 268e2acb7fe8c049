"""A control loop over axes of several buses: `robot.loop(rate)`, blocking and on an event loop.

    with robot.loop(rate=200) as loop:
        for state in loop:                                   # one sync read in, one sync write out
            loop.goal["elbow"] = 0.5 * state.position["shoulder"]

Entering reads and nothing else. Nothing moves before the first goal of an axis is set; it then gets torque without a
jump, in a cycle of its own. Goals are followed within velocity and acceleration of the axis, or sent as they are with
`direct=True`. When the `with` is left, by whatever, no goal follows any more: who follows one and is on its way brakes,
and what was sent direct is the last that its device knows. What the axes do then is the affair of their exit policy.

Who leaves the `for` and stays in the `with` leaves the axes at their last small goal, abruptly where they were quick.
Ctrl-C while they brake ends that as abruptly. A loop that was left takes no goals and has no cycles any more.

An axis belongs to who told it something last. When somebody else stops it, lets it go or moves it, another loop
included, the loop sends it no goal any more and raises Interrupted; the next goal that is set takes it back. That holds
from when a goal is set, also before the cycle in which its axis gets torque.

Nobody is ordered anywhere who was silent for more than two cycles, or whose last reading cannot be believed: he is left
out, the others go on, and when he is heard again he goes on from where he is.

A collection of garbage may hold Python up for longer than a period. A program with a quick loop had better call
`gc.collect()` and `gc.freeze()` before it.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Concatenate, Generic, NamedTuple, ParamSpec, Protocol, Self, TypeVar, overload

from motorbus.bus.blocking import Bus
from motorbus.core.device import MethodDescriptor
from motorbus.errors import MotorbusError
from motorbus.motion.body import Body
from motorbus.motion.clamping import Policy
from motorbus.motion.loop.grid import Statistics
from motorbus.motion.loop.readings import LoopState
from motorbus.motion.loop.rounds import Rounds
from motorbus.motion.parallel import AsyncConductor, BlockingConductor, Led, LedAsync, Parallel, Works
from motorbus.motion.safety.blame import raise_blamed

P = ParamSpec("P")
T = TypeVar("T")

Names = str | Iterable[str] | None


class Goals(Mapping[str, float]):
    """The goals that are set, in rad (m on a linear axis) by name: `loop.goal["elbow"] = 0.5`.

    One that is set stays until another one is. Setting raises RequestError for an axis that is not in the loop and for
    what is no number; everything else about a goal is judged before it is sent.
    """

    def __init__(self, rounds: Rounds) -> None:
        self._rounds = rounds

    def __setitem__(self, name: str, goal: float) -> None:
        self._rounds.ask(name, goal)

    def __getitem__(self, name: str) -> float:
        asked = self._rounds.places[name].asked
        if asked is None:
            raise KeyError(name)
        return asked

    def __iter__(self) -> Iterator[str]:
        return (name for name, place in self._rounds.places.items() if place.asked is not None)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def update(self, goals: Mapping[str, float]) -> None:
        """Set several; all of them are judged by name and kind before the first is set."""
        for name, goal in goals.items():
            self._rounds.check(name, goal)
        for name, goal in goals.items():
            self[name] = goal


class LoopFace:
    """What a blocking and an async loop have in common.

    `goal` takes goals, `without` names the axes that cannot be in a loop, because nobody can lead their device.
    """

    def __init__(
        self,
        body: Body,
        rate: float,
        axes: Names = None,
        *,
        direct: bool = False,
        exactly: bool = False,
        policy: Policy = "reject",
        watch: bool = True,
    ) -> None:
        self._rounds = Rounds(body, rate, axes, direct=direct, exactly=exactly, policy=policy, watch=watch)
        self.goal = Goals(self._rounds)

    @property
    def rate(self) -> float:
        """Cycles per second that it was asked for (Hz)."""
        return self._rounds.rate

    @property
    def axes(self) -> tuple[str, ...]:
        """The names of the axes that are in it."""
        return tuple(self._rounds.places)

    @property
    def without(self) -> tuple[str, ...]:
        """The names of those that were asked for and cannot be in it."""
        return self._rounds.without

    def allows(self, name: str, goal: float) -> bool:
        """Whether the limits of an axis that is in it, and those of its device, allow this goal (rad, m)."""
        return self._rounds.places[name].allows(goal)

    @property
    def statistics(self) -> Statistics:
        """What became of it so far: cycles, overruns, slots that were skipped, readings that were lost, times."""
        return self._rounds.statistics


class Loop(LoopFace):
    """A loop of a `Robot`; use it in a `with`, and in a `for` inside it. Never ends by itself.

    Raises NoReply when an axis is silent too long, LimitExceeded for a goal that must not be sent (nothing was sent
    then, and the loop can go on) or for an axis that is held back (it stays, the others go on), Interrupted when an
    axis was stopped from elsewhere, Faulted when one has lost its torque or restarted, Overloaded when one pushes too
    hard for too long or is too hot; see `Rounds`.
    """

    def __init__(
        self, body: Body, conductor: BlockingConductor, rate: float, axes: Names = None, **how: Any
    ) -> None:
        super().__init__(body, rate, axes, exactly=True, **how)
        self._conductor = conductor

    def __enter__(self) -> Self:
        _carried(self._rounds.entering(), self._conductor.run)
        buses = {name: part.bus for name, part in self._rounds.parts.items()}
        self._rounds.buses = {name: bus for name, bus in buses.items() if isinstance(bus, Bus)}
        return self

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> LoopState:
        try:
            return _carried(self._rounds.round(), self._conductor.run)
        except MotorbusError as error:
            raise_blamed(error, [part.bus for part in self._rounds.parts.values()])
            raise

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        try:
            _carried(self._rounds.leaving(), self._conductor.run)
        except MotorbusError as failure:
            _told(failure, error)


class AsyncLoop(LoopFace):
    """A loop of an `AsyncRobot`; use it in an `async with`, and in an `async for` inside it. Errors as `Loop` raises.

    An event loop wakes up to a millisecond late, so cycles begin a little later in their slots than those of a `Loop`.
    """

    def __init__(
        self, body: Body, conductor: AsyncConductor, rate: float, axes: Names = None, **how: Any
    ) -> None:
        super().__init__(body, rate, axes, **how)
        self._conductor = conductor

    async def __aenter__(self) -> Self:
        await _awaited(self._rounds.entering(), self._conductor.run)
        return self

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> LoopState:
        try:
            return await _awaited(self._rounds.round(), self._conductor.run)
        except MotorbusError as error:
            raise_blamed(error, [part.bus for part in self._rounds.parts.values()])
            raise

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: object
    ) -> None:
        try:
            await _awaited(self._rounds.leaving(), self._conductor.run)
        except MotorbusError as failure:
            _told(failure, error)


def blocking_loop(
    robot: Any,
    rate: float,
    axes: Names = None,
    *,
    direct: bool = False,
    policy: Policy = "reject",
    watch: bool = True,
) -> Loop:
    """A control loop of `rate` (Hz) over these axes, for a `with` and a `for` in it; see `motorbus.motion.loop`.

    `direct` sends goals as they are: one that is farther from the last than the velocity of the axis allows is refused.
    Else they are followed.

    A goal that goes too far is refused; with the policy `clamp` it is brought to the nearest that is allowed, which is
    counted, and told as a `Clamped` event where it has not been lately. What is no finite number is refused always.
    While axes are led, each is asked now and then how it fares, where the wire is free for that; `watch=False` leaves
    that out.

    Raises RequestError for what cannot be; nothing is sent before the `with` is entered.
    """
    how = {"direct": direct, "policy": policy, "watch": watch}
    return Loop(robot, robot.conductor, rate, axes, **how)


def awaiting_loop(
    robot: Any,
    rate: float,
    axes: Names = None,
    *,
    direct: bool = False,
    policy: Policy = "reject",
    watch: bool = True,
) -> AsyncLoop:
    """The same for an `async with` and an `async for` in it; see `blocking_loop`."""
    how = {"direct": direct, "policy": policy, "watch": watch}
    return AsyncLoop(robot, robot.conductor, rate, axes, **how)


def _told(failure: MotorbusError, error: BaseException | None) -> None:
    """What went wrong while leaving: it is raised, or goes along with what made it leave."""
    if error is None:
        raise failure
    error.add_note(f"and on leaving the loop: {failure}")


def _carried(works: Works[T], run: Callable[[Parallel[Any]], Any]) -> T:
    """Carry out one piece of work after the other, and give what they come to."""
    try:
        work = works.send(None)
        while True:
            try:
                told = run(work)
            except MotorbusError as error:
                work = works.throw(error)
            else:
                work = works.send(told)
    except StopIteration as end:
        found: T = end.value
        return found


async def _awaited(works: Works[T], run: Callable[[Parallel[Any]], Coroutine[Any, Any, Any]]) -> T:
    try:
        work = works.send(None)
        while True:
            try:
                told = await run(work)
            except MotorbusError as error:
                work = works.throw(error)
            else:
                work = works.send(told)
    except StopIteration as end:
        found: T = end.value
        return found


# -- verbs that are made of a loop ----------------------------------------------------------------------------------

T_co = TypeVar("T_co", covariant=True)


class Course(Protocol[T_co]):
    """What a verb does in a loop."""

    def step(self, loop: LoopFace, state: LoopState) -> bool:
        """One cycle has been: set goals. False when it is over."""

    def result(self, loop: LoopFace) -> T_co:
        """What it has come to, once it is over."""


class Errand(NamedTuple, Generic[T]):
    """A course and the loop that it needs: its rate (Hz), its axes, its `policy`.

    `before` is carried out once the loop has been entered, where there is something: what refuses the loop, as a rate
    that cannot be, refuses that too. One that is `endless` has no other end than an interruption of its caller, so then
    Ctrl-C ends it and its result is given; else it is raised as everywhere. What ends it early is told to `failed`,
    where there is that, before it is raised.
    """

    course: Course[T]
    rate: float
    axes: tuple[str, ...]
    before: Callable[[], Parallel[Any]] | None = None
    endless: bool = False
    failed: Callable[[MotorbusError], None] | None = None
    policy: Policy = "reject"


class looped(MethodDescriptor[P, T]):  # noqa: N801 - reads as a word in a list of verbs
    """Makes a method of a function that gives an `Errand`: blocking on what is `Led`, awaitable on `LedAsync`."""

    returns = "Errand"

    def __init__(self, function: Callable[Concatenate[Any, P], Errand[T]]) -> None:
        super().__init__(function)

    @overload
    def __get__(self, machine: None, owner: type) -> Self: ...
    @overload
    def __get__(self, machine: Led, owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(self, machine: LedAsync, owner: type) -> Callable[P, Coroutine[Any, Any, T]]: ...
    def __get__(self, machine: Any, owner: type) -> Any:
        return self.bind(machine, owner)

    def make_method(self) -> Callable[..., Any]:
        function: Callable[..., Any] = self.function

        def method(machine: Any, /, *args: Any, **kwargs: Any) -> Any:
            carry_out: Callable[..., Any] = _blocking if isinstance(machine, Led) else _awaiting
            return carry_out(machine, function(machine, *args, **kwargs))

        return method


@contextmanager
def _telling(errand: Errand[Any]) -> Iterator[None]:
    try:
        yield
    except MotorbusError as error:
        if errand.failed is not None:
            errand.failed(error)
        raise


def _blocking(machine: Any, errand: Errand[T]) -> T:
    course, how = errand.course, {"policy": errand.policy}
    with _telling(errand), Loop(machine, machine.conductor, errand.rate, errand.axes, **how) as loop:
        if errand.before is not None:
            machine.conductor.run(errand.before())
        try:
            for state in loop:
                if not course.step(loop, state):
                    break
        except KeyboardInterrupt:
            if not errand.endless:
                raise
    return course.result(loop)


async def _awaiting(machine: Any, errand: Errand[T]) -> T:
    course, how = errand.course, {"policy": errand.policy}
    with _telling(errand):
        async with AsyncLoop(machine, machine.conductor, errand.rate, errand.axes, **how) as loop:
            if errand.before is not None:
                await machine.conductor.run(errand.before())
            async for state in loop:
                if not course.step(loop, state):
                    break
    return course.result(loop)
