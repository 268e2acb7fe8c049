"""A machine by its file: its buses are opened, its devices asked what they are, and its axes are there to be moved.

    with Robot.load("motorbus.toml") as robot:
        robot.positions()
        robot["shoulder"].enable_torque()

    async with AsyncRobot.load("motorbus.toml") as robot:
        await robot.positions()

Loading reads, and writes nothing to any device. When it is closed, however that comes, each axis that was moved from
here does what the file says: `hold`, `torque_off`, `park` or `leave`. That is so at the normal end, on an exception, on
Ctrl-C, and in the main thread on SIGTERM and SIGHUP, unless the program has a handler of its own: see
`motorbus.bus.interrupts`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import AsyncExitStack, ExitStack
from os import PathLike
from types import TracebackType
from typing import Any, Final, Self

from motorbus.bus.aio import AsyncBus, TaskSignals
from motorbus.bus.base import BaseBus
from motorbus.bus.blocking import Bus
from motorbus.bus.interrupts import Interrupts, interrupts
from motorbus.bus.stop_socket import StopOutcome
from motorbus.errors import MotorbusError, RequestError
from motorbus.link.memory import MemoryLink, share_clock
from motorbus.motion import group
from motorbus.motion.axis import AsyncAxis, Axis
from motorbus.motion.body import Body
from motorbus.motion.conductor import Conductor, LoopConductor
from motorbus.motion.follow import follow
from motorbus.motion.leaving import Leaving
from motorbus.motion.loop.faces import awaiting_loop, blocking_loop, looped
from motorbus.motion.machine import NAME, Machine
from motorbus.motion.moving import verbs as moving
from motorbus.motion.parallel import Led, LedAsync, together
from motorbus.motion.quanta import awaiting_jogging, blocking_jogging
from motorbus.motion.recognition import recognise
from motorbus.motion.safety.fence import fence
from motorbus.motion.teach import teach
from motorbus.session.deadman import Leased, awaiting_attended, blocking_attended
from motorbus.session.echo import LOG
from motorbus.session.faults import clear, distrust, faults
from motorbus.session.plan import Plan, loaded
from motorbus.session.stopping import estop, latch, reset, trigger

Notify = Callable[[object], None]
Left = Callable[[Leaving, BaseException | None], None]
Names = str | Iterable[str] | None

NOT_OPEN: Final = "not open: use `async with`"
CLOSED: Final = "closed: load it again"


class RobotVerbs(Leased):
    """What a robot can do, blocking or async. `names` are names of axes, groups and buses; None means every axis."""

    def __repr__(self) -> str:
        if self._shut:
            return f"<{type(self).__name__}: {self._shut}>"
        if self._shut:
            return f"<{type(self).__name__}: {self._shut}>"
        axes, buses = ", ".join(self.axes), ", ".join(self.buses)
        return f"<{type(self).__name__}: axes {axes} on {buses}>"

    positions = together(group.positions)
    states = together(group.states)
    enable_torque = together(group.enable_torque)
    disable_torque = together(group.disable_torque)
    stop = together(group.stop)
    stopped = together(group.stopped)
    hold = together(group.hold)
    home = together(group.home)
    move = together(moving.move)
    pose = together(moving.pose)
    park = together(moving.park)
    replay = together(moving.replay)
    follow = looped(follow)
    teach = looped(teach)

    when_left: Left | None = None
    """Called once each axis was left as the file says and while the ports are still open: with what became of that, and
    with what ended the machine, None where nothing did. To tell how things stand; it should raise nothing."""
    _said: tuple[str, ...] = ()
    _shut = ""
    _latched = False

    def chosen(self, names: Names = None) -> dict[str, Any]:
        """See `Body.chosen`. Raises RequestError also while the machine is not open."""
        self._refuse_shut()
        return super().chosen(names)

    def axis(self, name: str) -> Any:
        """See `Body.axis`. Raises RequestError also while the machine is not open."""
        self._refuse_shut()
        return super().axis(name)

    def _refuse_shut(self) -> None:
        if self._shut:
            what, advice = self._shut.split(": ")
            raise RequestError(f"the machine is {what}", advice=f"{advice}; nothing was sent")

    @property
    def simulated(self) -> bool:
        """Whether there is no real device behind one of its buses."""
        return any(bus.simulated for bus in self.buses.values())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user ought to know of its buses, as a guarded change that was cut off, and of how it was left."""
        buses = (f"{name}: {text}" for name, bus in self.buses.items() for text in bus.warnings)
        return (*buses, *self._said)

    @property
    def faults(self) -> dict[str, str]:
        """The reason of each axis that is at fault, by name: its device restarted, lost its torque, or a guarded change
        of it is unfinished. Such an axis does not move and gets no torque; stop and torque off always pass.
        """
        return faults(self)

    def clear_fault(self, names: Names = None) -> None:
        """Clear the fault of these axes, so that they may move again. None: all that are at fault.

        Sends nothing. Raises RequestError for an unknown name; Refused, and clears none, if a guarded change of one is
        unfinished: `motorbus recover` ends it.
        """
        clear(self, names)

    def estop(self) -> dict[str, StopOutcome]:
        """Emergency stop on every bus at the same time; see `motorbus.bus.base.BaseBus.estop`. From any thread.

        Never waits for a movement, and tells for each bus, by its name, what it achieved: a bus that is gone
        acknowledges nothing. Motion and torque are refused afterwards until `reset`, also when the machine is closed
        and opened again meanwhile. A plain call on both kinds. Raises RequestError while the machine is not open, for
        then it stops nothing.
        """
        self._refuse_shut()
        self._latched = True
        return estop(self)

    def trigger_estop(self) -> None:
        """Ask the stop thread of every bus for an emergency stop, and return at once: made for signal handlers.

        Raises nothing. On a simulated bus it does nothing before the first motion or torque command.
        """
        self._latched = True
        trigger(self)

    def reset(self) -> None:
        """Take the latch of an emergency stop off every bus. Nothing is sent and nothing moves. A plain call too."""
        self._refuse_shut()
        self._latched = False
        reset(self)

    def _ended(self, leaving: Leaving, others: BaseException | None) -> None:
        """Report what leaving did not achieve, then call `when_left`."""
        try:
            self._report_errors(leaving, others)
        finally:
            self._shown(leaving, others)

    def _shown(self, leaving: Leaving, others: BaseException | None) -> None:
        if self.when_left is not None:
            self.when_left(leaving, others)

    def _report_errors(self, leaving: Leaving, others: BaseException | None) -> None:
        """Raise the error of leaving, or add it as a note to `others`."""
        self._said = tuple(leaving.said)
        for text in leaving.said:
            LOG.warning("%s", text)
        error = leaving.error
        if others is not None:
            for text in (*leaving.said, *([f"leaving failed: {error}"] if error is not None else [])):
                others.add_note(text)
        elif error is not None:
            for text in leaving.said:
                error.add_note(text)
            raise error


class Robot(RobotVerbs, Led):
    """An open machine, blocking; use it in a `with`. Made by `load` or `of`."""

    axes: Mapping[str, Axis]
    loop = blocking_loop
    attended = blocking_attended
    jogging = blocking_jogging

    def __init__(self, machine: Machine, buses: Mapping[str, Bus], axes: Mapping[str, Axis]) -> None:
        super().__init__(machine, buses, axes)
        self.conductor = Conductor(buses)
        self._ports = tuple(buses.values())
        self._exits = ExitStack()
        self._signals: Interrupts | None = None

    @classmethod
    def load(
        cls, path: str | PathLike[str] = NAME, axes: Names = None, *, report: Notify | None = None
    ) -> Self:
        """Open the machine that a file describes, or only what these axes, groups and buses of it need.

        `report` gets progress and early results of every bus. Raises RequestError for the file, as `Machine.load`, also
        for an address that cannot be: before anything is opened; else as `of`.
        """
        return cls.of(loaded(path), axes, report=report)

    @classmethod
    def of(cls, machine: Machine, axes: Names = None, *, report: Notify | None = None) -> Self:
        """Open a machine, or only what these axes, groups and buses of it need, and ask each device what it is.

        Raises PortNotFound, PortBusy or LinkError for a bus, naming it; NoReply, naming axis, device and address, for a
        device that is silent; RequestError for one that cannot do what the file asks of it. Whatever was opened is
        closed then. Only reads are sent.
        """
        plan = Plan.of(machine, axes)
        with ExitStack() as stack:
            buses = {name: stack.enter_context(plan.open(name, report)) for name in plan.buses}
            _share_clock(buses.values())
            robot = cls(machine, buses, plan.blocking(buses))
            robot.conductor.run(recognise(robot))
            fence(robot)
            distrust(robot)
            robot._exits = stack.pop_all()
        return robot

    def __getitem__(self, name: str) -> Axis:
        """The axis of this name. Raises RequestError for none, or one that was not opened."""
        axis: Axis = super().axis(name)
        return axis

    def close(self) -> None:
        """Leave the machine as its file says, and give the ports back. Calling it again does nothing.

        Raises what leaving raised, when every axis was visited and every port is closed.
        """
        self._end(None)

    def __enter__(self) -> Self:
        self._refuse_shut()
        self._signals = interrupts()
        self._signals.cleanups += 1
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end(error)

    def _end(self, others: BaseException | None) -> None:
        if self._shut:
            return
        with interrupts():
            first: BaseException | None = None
            try:
                self._lay_down()
                leaving = Leaving(self)
                first = self._leave(leaving)
                self._ended(leaving, others or first)
            finally:
                try:
                    self._exits.close()
                finally:
                    for bus in self._ports:
                        bus.close()
                    self._shut = CLOSED
                    self._retire()
                    if self._signals is not None:
                        self._signals.cleanups -= 1
            if first is not None:
                raise first

    def _leave(self, leaving: Leaving) -> BaseException | None:
        """Carry out all of it; the first signal that came meanwhile. Each signal shortens what is left."""
        first: BaseException | None = None
        while True:
            try:
                interrupts().raise_pending()
                work = leaving.work()
                if work is None:
                    return first
                self.conductor.run(work)
            except MotorbusError as error:
                leaving.failed(error)
            except BaseException as signal:
                first = first or signal
                leaving.hurry()


class AsyncRobot(RobotVerbs, LedAsync):
    """An open machine on the running event loop; use it in an `async with`. Made by `load` or `of`."""

    axes: Mapping[str, AsyncAxis]
    loop = awaiting_loop
    attended = awaiting_attended
    jogging = awaiting_jogging
    _shut = NOT_OPEN

    def __init__(self, plan: Plan, report: Notify | None = None) -> None:
        super().__init__(plan.machine, {}, {})
        self.conductor = LoopConductor({})
        self._plan = plan
        self._report = report
        self._ending = False
        self._exits = AsyncExitStack()

    @classmethod
    def load(
        cls, path: str | PathLike[str] = NAME, axes: Names = None, *, report: Notify | None = None
    ) -> Self:
        """The machine that a file describes; it is opened when its `async with` is entered. Else as `Robot.load`."""
        return cls.of(loaded(path), axes, report=report)

    @classmethod
    def of(cls, machine: Machine, axes: Names = None, *, report: Notify | None = None) -> Self:
        """A machine; it is opened when its `async with` is entered, which raises what `Robot.of` raises."""
        return cls(Plan.of(machine, axes), report)

    async def __aenter__(self) -> Self:
        if not self._shut:
            raise RequestError("the machine is open already", advice="use it in one `async with` at a time")
        async with AsyncExitStack() as stack:
            buses: dict[str, AsyncBus] = {}
            for name in self._plan.buses:
                buses[name] = await stack.enter_async_context(self._plan.open_async(name, self._report))
            _share_clock(buses.values())
            body = Body(self._plan.machine, buses, self._plan.awaiting(buses))
            conductor = LoopConductor(buses)
            await conductor.run(recognise(body))
            fence(body)
            distrust(body)
            Body.__init__(self, body.machine, buses, body.axes, body.origins)
            self.conductor = conductor
            if self._latched:
                latch(self)
            self._exits = stack.pop_all()
        self._shut = ""
        self.lease = self._lease
        self._signals = TaskSignals()
        return self

    def __getitem__(self, name: str) -> AsyncAxis:
        """The axis of this name. Raises RequestError for none, or one that was not opened."""
        axis: AsyncAxis = super().axis(name)
        return axis

    async def close(self) -> None:
        """Leave the machine as its file says, and give the ports back; see `Robot.close`."""
        await self._end(None)

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._end(error)

    async def _end(self, others: BaseException | None) -> None:
        if self._shut or self._ending:
            return
        self._ending = True
        self._lay_down()
        try:
            async with self._exits:
                leaving = Leaving(self)
                interruption = await self._leave(leaving)
                self._ended(leaving, others or interruption)
                if interruption is not None:
                    raise interruption
        finally:
            self._ending, self._shut = False, NOT_OPEN
            self._retire()
            self._signals.end()

    async def _leave(self, leaving: Leaving) -> BaseException | None:
        """Carry out all of it; the first cancellation that came meanwhile."""
        first: BaseException | None = None
        caught: BaseException | None = None
        while True:
            try:
                if caught is not None:
                    first = first or caught
                    leaving.hurry()
                    caught = None
                work = leaving.work()
                if work is None:
                    return first
                await self.conductor.run(work)
            except MotorbusError as error:
                leaving.failed(error)
            except GeneratorExit:  # the coroutine was closed: what was begun has cleaned up
                raise
            except BaseException as interruption:  # cancelled again: wait less, visit every axis
                caught = interruption


def _share_clock(buses: Iterable[Bus | AsyncBus]) -> None:
    """Put the simulated buses of this machine on one virtual clock."""
    links = [bus.link for bus in buses if isinstance(bus, BaseBus)]
    simulated = [link for link in links if isinstance(link, MemoryLink) and link.virtual]
    if len(simulated) == len(links):
        share_clock(simulated)
