"""The robot: an open machine, and the service that shell, dashboard and plugins use.

    with Robot.load("motorbus.toml") as robot:
        robot.move({"shoulder": 0.5})

    async with AsyncRobot.at("feetech:/dev/ttyACM0#1-6") as robot:
        await robot.move({"#1": 3.0})

Opening reads and writes nothing to a device. At the end, however it comes, each axis with torque or motion from here
does what `exit` of the machine file says.
"""

from __future__ import annotations

import logging
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import AsyncExitStack, ExitStack, suppress
from math import inf
from os import PathLike
from threading import Event, Thread
from typing import Any, Final, Self

from motorbus.bus.base import BaseBus
from motorbus.bus.interrupts import Interrupts, interrupts
from motorbus.core.steps import gather
from motorbus.errors import MotorbusError, Refused, RequestError
from motorbus.motion_new import commands, moves, teach
from motorbus.motion_new.blocks import Attendance, Loop
from motorbus.motion_new.commands import EStopResult, RobotCommand
from motorbus.motion_new.describe import MachineDescription, describe
from motorbus.motion_new.health import HealthMonitor
from motorbus.motion_new.loop import ControlLoop, Policy
from motorbus.motion_new.machine import MachineConfig, Names
from motorbus.motion_new.opening import UNTRUSTED, bus_options, identify, machine_at, select
from motorbus.motion_new.program import OnBuses, Program, drive, drive_async, raise_first
from motorbus.motion_new.shutdown import Shutdown
from motorbus.motion_new.state import Axis, OpenMachine, Subscription, poll, read_all
from motorbus.motion_new.trajectory import Trajectory
from motorbus.session import open as open_bus
from motorbus.session import open_async

LOG = logging.getLogger("motorbus.motion")
POLL_PERIOD: Final = 0.1  # s between two states for subscribers while no loop runs


class RobotMethods(OpenMachine):
    """What a robot can do; in `AsyncRobot` each method that does I/O is awaited.

    `names` are names of axes, groups and buses; None means all axes.
    """

    def __init__(self, config: MachineConfig, axes: Names = None) -> None:
        super().__init__()
        self.config = select(config, axes)
        self.health = HealthMonitor()
        self._poller: Any = None
        self._whole = config

    @classmethod
    def load(cls, path: str | PathLike[str] = "motorbus.toml", axes: Names = None) -> Self:
        """The machine of a file, or only these axes of it. Raises RequestError that names file and key."""
        return cls(MachineConfig.load(path), axes)

    @classmethod
    def at(cls, address: str) -> Self:
        """The devices of an address, `FAMILY:PORT#1-6`, as axes `#1` … with the limits of the devices."""
        return cls(machine_at(address))

    @abstractmethod
    def carry_out(self, program: Program[Any]) -> Any:
        """Run a program; gives its value, or what is awaited for it."""

    # -- state -----------------------------------------------------------------------------------------------------

    def describe(self) -> MachineDescription:
        """What the machine is; sends nothing."""
        return describe(self)

    def states(self, names: Names = None) -> Any:
        """Read these axes; gives their `AxisState` by name."""
        return self.carry_out(self._read(names))

    async def _read(self, names: Names) -> Any:
        axes = self.chosen(names)
        groups: dict[BaseBus, list[Axis]] = {}
        for axis in axes:
            if self.health.is_due(axis):
                groups.setdefault(axis.bus, []).append(axis)
        if groups:
            await OnBuses(
                {
                    bus: gather(*[self.health.note(axis) for axis in members])
                    for bus, members in groups.items()
                }
            )
        return await read_all(self, names)

    def positions(self, names: Names = None) -> Any:
        """Read the positions (rad, m) of these axes, by name; None where a device reports none."""
        return self.carry_out(self._read_positions(names))

    async def _read_positions(self, names: Names) -> dict[str, float | None]:
        states = await self._read(names)
        return {name: state.position for name, state in states.items()}

    @property
    def faults(self) -> dict[str, str]:
        """The reason of each axis that is at fault, by name."""
        return {name: axis.status.fault for name, axis in self.axes.items() if axis.status.fault}

    def clear_fault(self, names: Names = None) -> None:
        """Let axes at fault move again. Sends nothing. Raises Refused while a guarded change of one is unfinished."""
        axes = self.chosen(names)
        for axis in axes:
            if axis.status.fault.startswith(UNTRUSTED):
                raise Refused(f"{axis.name} is at fault: {axis.status.fault}", reason="fault")
        for axis in axes:
            axis.status.fault = ""

    def set_position(self, name: str, position: float) -> None:
        """Declare the position (rad, m) of an axis whose device reports none. Sends nothing."""
        (axis,) = self.chosen(name)
        if "position" in axis.driver:
            raise RequestError(
                f"{name}: its device reports its position", advice="calibrate its zero instead"
            )
        moves.check_reach(axis, position)
        axis.status.estimate = axis.config.to_device(position)

    # -- commands --------------------------------------------------------------------------------------------------

    def program(self, command: RobotCommand) -> Program[Any]:
        """The program that carries out a command."""
        health = self.health
        match command:
            case commands.Move(goals, duration, speed, kind, relative):
                return moves.move(
                    self, health, goals, duration=duration, speed=speed, kind=kind, relative=relative
                )
            case commands.Pose(name, duration, speed):
                return moves.move(self, health, self._pose(name), duration=duration, speed=speed)
            case commands.Jog(axis, velocity, seconds):
                return moves.jog(self, health, axis, velocity, seconds)
            case commands.Home(axes, timeout):
                return moves.home(self, axes, timeout)
            case commands.RunProgram(axis, number, timeout):
                return moves.run_stored(self, axis, number, timeout)
            case commands.Replay(file, speed, smooth, repeat, skip_others):
                trajectory = Trajectory.load(file, self.config.axes, skip_others=skip_others)
                return teach.replay(self, health, trajectory, speed=speed, smooth=smooth, repeat=repeat)
            case commands.Teach():
                return self._teach_file(command)
            case commands.Follow(pairs, seconds, rate):
                return teach.follow(self, health, pairs, seconds=seconds, rate=rate)
            case commands.Torque(on, axes):
                return moves.switch_torque(self, health, on, axes)
            case commands.Stop(axes, verify):
                return moves.stop(self, axes, verify=verify)
            case commands.ReadRegisters(axis, registers):
                return self._call(axis, "read", registers, {})
            case commands.WriteRegisters(axis, values):
                return self._call(axis, "write", (), values)
            case commands.DeviceCommand(axis, name, arguments):
                return self._call(axis, name, (), arguments)
            case _:
                return self._at_once(command)

    async def _at_once(self, command: RobotCommand) -> None:
        match command:
            case commands.Reset():
                self.reset()
            case commands.ClearFault(axes):
                self.clear_fault(axes)
            case commands.SetPosition(axis, position):
                self.set_position(axis, position)
            case _:
                raise RequestError(f"{command!r} is not a command of a robot")

    def _pose(self, name: str) -> dict[str, float]:
        if name not in self.config.poses:
            raise RequestError(
                f"no pose {name!r}", expected=f"one of {', '.join(self.config.poses) or 'none'}"
            )
        return self.config.poses[name]

    async def _teach_file(self, command: commands.Teach) -> commands.LoopResult:
        with open(command.file, "x") as file:  # refused before anything is recorded
            recorded = await teach.teach(
                self,
                self.health,
                command.axes,
                seconds=command.seconds,
                rate=command.rate,
                keep_torque=command.keep_torque,
            )
            file.write(recorded.text(self.config.axes))
        return commands.LoopResult(
            recorded.duration,
            len(recorded.times),
            recorded.positions(recorded.duration),
            notes=recorded.notes,
        )

    async def _call(self, name: str, function: str, given: Sequence[Any], named: Mapping[str, Any]) -> Any:
        """Program: a driver function of the device of an axis."""
        (axis,) = self.chosen(name)
        method: Any = getattr(type(axis.device), function, None)
        if not hasattr(method, "function"):
            raise RequestError(f"{name}: {axis.config.device} has no command {function!r}")
        value = (await OnBuses({axis.bus: method.function(axis.device, *given, **named)}))[axis.bus]
        raise_first({name: value})
        return value

    def move(self, goals: Mapping[str, float], **options: Any) -> Any:
        """Move axes together; gives a `MoveResult`. See `moves.move`."""
        return self.carry_out(moves.move(self, self.health, goals, **options))

    def pose(self, name: str, **options: Any) -> Any:
        """Move to a pose of the machine file; gives a `MoveResult`."""
        return self.move(self._pose(name), **options)

    def jog(
        self,
        name: str,
        velocity: float,
        seconds: float | None = None,
        until: Callable[[], bool] | None = None,
    ) -> Any:
        """Move an axis at a velocity (rad/s, m/s), then brake; gives a `LoopResult`. See `moves.jog`."""
        return self.carry_out(moves.jog(self, self.health, name, velocity, seconds, until))

    def home(self, names: Names = None, *, timeout: float = 30.0) -> Any:
        """Move to the reference switches; gives the positions by name. Needs `attended()`."""
        return self.carry_out(moves.home(self, names, timeout))

    def run(self, name: str, number: int, *, timeout: float | None = None) -> Any:
        """Run a stored program of the device of an axis; gives its result as text."""
        return self.carry_out(moves.run_stored(self, name, number, timeout))

    def stop(self, names: Names = None, *, verify: bool = False) -> Any:
        """Decelerate and hold; gives a `StopResult`. `verify`: watch until each rests, at most 1 s."""
        return self.carry_out(moves.stop(self, names, verify=verify))

    def torque(self, on: bool, names: Names = None) -> Any:
        """Switch torque; on holds the present position. Gives the names of the axes."""
        return self.carry_out(moves.switch_torque(self, self.health, on, names))

    def teach(self, names: Names = None, **how: Any) -> Any:
        """Record axes that are moved by hand; gives a `Trajectory`. See `teach.teach`."""
        return self.carry_out(teach.teach(self, self.health, names, **how))

    def replay(self, trajectory: Trajectory, **how: Any) -> Any:
        """Play a trajectory; gives a `LoopResult`. See `teach.replay`."""
        return self.carry_out(teach.replay(self, self.health, trajectory, **how))

    def follow(self, pairs: Mapping[str, str], **how: Any) -> Any:
        """Let axes track others, `{leader: follower}`; gives a `LoopResult`. See `teach.follow`."""
        return self.carry_out(teach.follow(self, self.health, pairs, **how))

    # -- emergency stop --------------------------------------------------------------------------------------------

    def estop(self) -> dict[str, EStopResult]:
        """Emergency stop of all buses at the same time, latched until `reset`. From any thread; never awaited."""
        found: dict[str, EStopResult] = {}

        def stop(name: str) -> None:
            try:
                outcome = self.buses[name].estop()
            except Exception as error:  # its port is gone: the others are stopped all the same
                nodes = tuple(axis.config.node for axis in self.axes.values() if axis.config.bus == name)
                found[name] = EStopResult((), nodes, f"nothing: {error}")
            else:
                found[name] = EStopResult(outcome.acknowledged, outcome.silent, outcome.promise)

        threads = []
        for name, bus in self.buses.items():
            thread = None if bus.link.virtual else Thread(target=stop, args=(name,), daemon=True)
            try:
                if thread is None:
                    raise RuntimeError
                thread.start()
                threads.append(thread)
            except RuntimeError:  # virtual time, or no thread is left
                stop(name)
        for thread in threads:
            thread.join()
        return {name: found[name] for name in self.buses}

    def trigger_estop(self) -> None:
        """Ask the stop threads of all buses for an emergency stop; for signal handlers."""
        for bus in self.buses.values():
            bus.trigger_estop()

    def reset(self) -> None:
        """Take the latch of the emergency stop off. Nothing is sent."""
        for bus in self.buses.values():
            bus.reset()

    # -- loop, lease -----------------------------------------------------------------------------------------------

    def loop(
        self,
        rate: float | None = None,
        names: Names = None,
        *,
        policy: Policy = "reject",
        direct: bool = False,
    ) -> Loop:
        """A control loop of these axes, at `rate` Hz. See `ControlLoop`."""
        loop = ControlLoop(self, self.health, names, rate=rate, policy=policy, direct=direct)
        return Loop(loop, self.carry_out)

    def attended(self, seconds: float = inf) -> Attendance:
        """Attend the machine in a block: motion without an end of its own is allowed, and stopped at the end.

        The block gets a `Lease`. With `seconds` it must be renewed by `beat()` within that time, or all that moves is
        stopped, and the end of the block raises Refused.
        """
        return Attendance(self, seconds, self.carry_out)

    # -- the end ---------------------------------------------------------------------------------------------------

    def _report(self, ending: Shutdown, error: BaseException | None) -> None:
        """Tell what the end did not achieve: as notes of the error that ends the program, else raise."""
        self.warnings += ending.notes
        for note in ending.notes:
            LOG.warning("%s", note)
            if error is not None:
                error.add_note(note)
        if error is None:
            raise_first(ending.errors)


# -- blocking --------------------------------------------------------------------------------------------------


class Robot(RobotMethods):
    """An open machine, blocking; use it in a `with`. Raises NoReply for a device that does not answer."""

    def __init__(self, config: MachineConfig, axes: Names = None) -> None:
        super().__init__(config, axes)
        self._stack = ExitStack()
        self._closed = Event()
        self._signals: Interrupts | None = None
        with ExitStack() as stack:
            for name, bus in self.config.buses.items():
                self.buses[name] = stack.enter_context(
                    open_bus(bus.address, **bus_options(self._whole, name))
                )
            drive(identify(self, "blocking"))
            self._stack = stack.pop_all()

    def carry_out(self, program: Program[Any]) -> Any:
        return drive(program)

    def execute(self, command: RobotCommand) -> Any:
        """Carry out a command and give its result."""
        return self.estop() if isinstance(command, commands.EStop) else drive(self.program(command))

    def subscribe(self, *, rate: float | None = None, depth: int = 64) -> Subscription:
        """All states from now on, at most `rate` per s: of loops, else of a poll ten times a second.

        In virtual time nothing is polled.
        """
        if not self.subscriptions and not any(bus.link.virtual for bus in self.buses.values()):
            Thread(target=self._poll, name="motorbus poller", daemon=True).start()
        return super().subscribe(rate=rate, depth=depth)

    def _poll(self) -> None:
        while not self._closed.wait(POLL_PERIOD) and self.subscriptions:
            if not self.loops:
                with suppress(Exception):  # a bus that is gone, or closed meanwhile
                    drive(poll(self))

    def shutdown(self) -> Shutdown:
        """Graceful stop: decelerate, hold, go to the pose `park` if there is one, torque off. Then close it.

        A second Ctrl-C releases at once. Gives errors and notes.
        """
        ending = Shutdown(self, self.health, graceful=True)
        interrupted = self._carry_out(ending)
        if interrupted is not None:
            raise interrupted
        return ending

    def close(self) -> None:
        """Leave each axis as the machine file says, and give the ports back."""
        self._end(None)

    def __enter__(self) -> Self:
        self._signals = interrupts()
        self._signals.cleanups += 1
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._end(error)

    def _end(self, error: BaseException | None) -> None:
        if self._closed.is_set():
            return
        with interrupts():
            interrupted: BaseException | None = None
            try:
                ending = Shutdown(self, self.health)
                interrupted = self._carry_out(ending)
                self._report(ending, error or interrupted)
            finally:
                self._closed.set()
                self._stack.close()
                if self._signals is not None:
                    self._signals.cleanups -= 1
            if interrupted is not None:
                raise interrupted

    def _carry_out(self, ending: Shutdown) -> BaseException | None:
        """Run all programs of the end; gives the first signal that came meanwhile."""
        interrupted: BaseException | None = None
        while True:
            try:
                interrupts().raise_pending()
                program = ending.next()
                if program is None:
                    return interrupted
                drive(program)
            except BaseException as signal:
                if isinstance(signal, Exception) and not isinstance(signal, MotorbusError):
                    raise
                interrupted = interrupted or signal
                ending.hurry()


# -- asyncio ---------------------------------------------------------------------------------------------------


class AsyncRobot(RobotMethods):
    """An open machine on asyncio; it is opened when its `async with` is entered."""

    async def carry_out(self, program: Program[Any]) -> Any:
        return await drive_async(program)

    async def execute(self, command: RobotCommand) -> Any:
        """Carry out a command and give its result."""
        if isinstance(command, commands.EStop):
            return self.estop()
        return await drive_async(self.program(command))

    def subscribe(self, *, rate: float | None = None, depth: int = 64) -> Subscription:
        """All states from now on, see `Robot.subscribe`."""
        import asyncio

        if not self.subscriptions and not any(bus.link.virtual for bus in self.buses.values()):
            self._poller = asyncio.create_task(self._poll())
        return super().subscribe(rate=rate, depth=depth)

    async def _poll(self) -> None:
        import asyncio

        while True:
            await asyncio.sleep(POLL_PERIOD)
            if not self.subscriptions:
                return
            if not self.loops:
                with suppress(MotorbusError):
                    await drive_async(poll(self))

    async def shutdown(self) -> Shutdown:
        """Graceful stop, see `Robot.shutdown`. A cancellation releases at once."""
        ending = Shutdown(self, self.health, graceful=True)
        interrupted = await self._carry_out(ending)
        if interrupted is not None:
            raise interrupted
        return ending

    async def __aenter__(self) -> Self:
        from motorbus.bus.aio import TaskSignals

        async with AsyncExitStack() as stack:
            for name, bus in self.config.buses.items():
                opened = open_async(bus.address, **bus_options(self._whole, name))
                self.buses[name] = await stack.enter_async_context(opened)
            await drive_async(identify(self, "awaiting"))
            self._stack = stack.pop_all()
        self._signals = TaskSignals()
        return self

    async def __aexit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        interrupted: BaseException | None = None
        try:
            if self._poller is not None:
                self._poller.cancel()
            ending = Shutdown(self, self.health)
            interrupted = await self._carry_out(ending)
            self._report(ending, error or interrupted)
        finally:
            await self._stack.aclose()
            self._signals.end()
        if interrupted is not None:
            raise interrupted

    async def _carry_out(self, ending: Shutdown) -> BaseException | None:
        """Run all programs of the end; gives the first cancellation that came meanwhile."""
        interrupted: BaseException | None = None
        while (program := ending.next()) is not None:
            try:
                await drive_async(program)
            except GeneratorExit:
                raise
            except BaseException as signal:
                if isinstance(signal, Exception) and not isinstance(signal, MotorbusError):
                    raise
                interrupted = interrupted or signal
                ending.hurry()
        return interrupted
