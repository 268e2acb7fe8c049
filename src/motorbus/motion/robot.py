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
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack, ExitStack, suppress
from functools import wraps
from math import inf
from os import PathLike
from threading import Event, Thread
from typing import TYPE_CHECKING, Any, Concatenate, Final, Generic, ParamSpec, Self, TypeVar, overload

from msgspec import structs

from motorbus.bus.interrupts import Interrupts, interrupts
from motorbus.errors import Refused, RequestError
from motorbus.motion import commands, moves
from motorbus.motion import teach as recording
from motorbus.motion.axis import Axis, read_position
from motorbus.motion.blocks import AsyncLoop, Attendance, Loop
from motorbus.motion.commands import EStopResult, RobotCommand
from motorbus.motion.loop import ControlLoop, Policy
from motorbus.motion.machine import MachineConfig, Names
from motorbus.motion.opening import UNTRUSTED, USUAL_VELOCITY, bus_options, identify, machine_at, select
from motorbus.motion.program import Program, drive, drive_async, raise_first, run
from motorbus.motion.shutdown import Shutdown
from motorbus.motion.state import (
    MachineDescription,
    OpenMachine,
    Subscription,
    describe,
    poll,
    read_axes,
    read_positions,
)
from motorbus.session import open as open_bus
from motorbus.session import open_async

P = ParamSpec("P")
T = TypeVar("T")
LOG = logging.getLogger("motorbus.motion")
POLL_PERIOD: Final = 0.1  # s between two states for subscribers while no loop runs


if TYPE_CHECKING:

    class program_method(Generic[P, T]):  # noqa: N801 - used like a function
        """The type of a method of a robot: the value of its program, of an AsyncRobot a coroutine of it."""

        def __init__(self, program: Callable[Concatenate[Any, P], Program[T]]) -> None: ...
        @overload
        def __get__(self, robot: Robot, owner: type) -> Callable[P, T]: ...
        @overload
        def __get__(self, robot: AsyncRobot, owner: type) -> Callable[P, Coroutine[Any, Any, T]]: ...
        def __get__(self, robot: Any, owner: type) -> Any: ...

else:

    def program_method(program: Callable[..., Program[T]]) -> Callable[..., Any]:
        """Make a method of a robot that runs this program."""

        @wraps(program)
        def method(self: Any, /, *args: Any, **options: Any) -> Any:
            return self.carry_out(program(self, *args, **options))

        return method


async def shutdown(machine: OpenMachine) -> None:
    """Graceful stop: decelerate, hold, go to the pose `park` if there is one, torque off.

    A second Ctrl-C, or a cancellation, releases at once. What failed is in `warnings`.
    """
    await _leave(machine, None, graceful=True)


async def _leave(machine: OpenMachine, error: BaseException | None, *, graceful: bool = False) -> None:
    """Program: the end. What it did not achieve is a note of `error`, which ends the program, else is raised."""
    ending = Shutdown(machine, graceful=graceful)
    try:
        await ending.run()
    except BaseException as interrupt:
        error = error or interrupt
        raise
    finally:
        machine.warnings += ending.notes
        for note in ending.notes:
            LOG.warning("%s", note)
            if error is not None:
                error.add_note(note)
    if error is None:
        raise_first(ending.errors)


class RobotMethods(OpenMachine):
    """What a robot can do; in `AsyncRobot` each method that does I/O is awaited.

    `names` are names of axes, groups and buses; None means all axes.
    """

    carry_out: Callable[[Program[Any]], Any]

    def __init__(self, config: MachineConfig, axes: Names = None) -> None:
        super().__init__()
        self.config = select(config, axes)
        self._whole = config
        self._closed = Event()

    @classmethod
    def load(cls, path: str | PathLike[str] = "motorbus.toml", axes: Names = None) -> Self:
        """The machine of a file, or only these axes of it. Raises RequestError that names file and key."""
        return cls(MachineConfig.load(path), axes)

    @classmethod
    def at(cls, address: str, *, max_velocity: float = USUAL_VELOCITY) -> Self:
        """The devices of an address, `FAMILY:PORT#1-6`, as axes `#1` … with the limits of the devices.

        `max_velocity` (rad/s) is that of each axis.
        """
        return cls(machine_at(address, max_velocity))

    states = program_method(read_axes)
    positions = program_method(read_positions)
    move = program_method(moves.move)
    pose = program_method(moves.pose)
    jog = program_method(moves.jog)
    home = program_method(moves.home)
    run = program_method(moves.run_stored)
    stop = program_method(moves.stop)
    enable_torque = program_method(moves.enable_torque)
    disable_torque = program_method(moves.disable_torque)
    teach = program_method(recording.teach)
    replay = program_method(recording.replay)
    follow = program_method(recording.follow)
    shutdown = program_method(shutdown)

    @property
    def _is_virtual(self) -> bool:
        return any(bus.link.virtual for bus in self.buses.values())

    def __getitem__(self, name: str) -> Axis:
        return self.axis(name)

    def program(self, command: RobotCommand) -> Program[Any]:
        """The program that carries out a command."""
        return PROGRAMS[type(command)](self, **structs.asdict(command))

    # -- without I/O -----------------------------------------------------------------------------------------------

    def describe(self) -> MachineDescription:
        """What the machine is; sends nothing."""
        return describe(self)

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
        axis = self.axis(name)
        if axis.status.measured:
            raise RequestError(
                f"{name}: its device reports its position", advice="calibrate its zero instead"
            )
        moves.check_reach(axis, position)
        axis.status.estimate = axis.config.to_device(position)

    def subscribe(self, *, rate: float | None = None, depth: int = 64) -> Subscription:
        """All states from now on, at most `rate` per s: of loops, else of a poll ten times a second.

        In virtual time nothing is polled.
        """
        if not self.subscriptions and not self._is_virtual:
            Thread(target=self._poll, name="motorbus poller", daemon=True).start()
        return super().subscribe(rate=rate, depth=depth)

    def _poll(self) -> None:
        while not self._closed.wait(POLL_PERIOD) and self.subscriptions:
            if not self.loops:
                with suppress(Exception):  # a bus that is gone, or closed meanwhile
                    drive(poll(self))

    def attended(self, seconds: float = inf) -> Attendance:
        """Attend the machine in a block: motion without an end of its own is allowed, and stopped at the end.

        The block gets a `Lease`. With `seconds` it must be renewed by `beat()` within that time, or all that moves is
        stopped, and the end of the block raises Refused.
        """
        return Attendance(self, seconds, self.carry_out)

    # -- emergency stop --------------------------------------------------------------------------------------------

    def estop(self) -> dict[str, EStopResult]:
        """Emergency stop of all buses at the same time, latched until `reset`. From any thread; never awaited."""
        if not self._is_virtual:
            with suppress(RuntimeError), ThreadPoolExecutor(len(self.buses)) as pool:  # no thread left
                return dict(zip(self.buses, pool.map(self._stop_bus, self.buses), strict=True))
        return {name: self._stop_bus(name) for name in self.buses}

    def _stop_bus(self, name: str) -> EStopResult:
        try:
            outcome = self.buses[name].estop()
        except Exception as error:  # its port is gone: the others are stopped all the same
            nodes = tuple(axis.config.node for axis in self.axes.values() if axis.config.bus == name)
            return EStopResult((), nodes, f"nothing: {error}")
        return EStopResult(outcome.acknowledged, outcome.silent, outcome.promise)

    def trigger_estop(self) -> None:
        """Ask the stop threads of all buses for an emergency stop; for signal handlers."""
        for bus in self.buses.values():
            bus.trigger_estop()

    def reset(self) -> None:
        """Take the latch of the emergency stop off. Nothing is sent."""
        for bus in self.buses.values():
            bus.reset()


# -- commands --------------------------------------------------------------------------------------------------


async def switch_torque(machine: OpenMachine, on: bool, names: Names) -> tuple[str, ...]:
    """Program: torque on or off."""
    return await (moves.enable_torque if on else moves.disable_torque)(machine, names)


async def read_registers(machine: OpenMachine, name: str, registers: tuple[str, ...]) -> Any:
    """Program: registers of the device of an axis, by name."""
    axis = machine.axis(name)
    return await run(axis.bus, _device_function(axis, "read")(axis.device, *registers))


async def write_registers(machine: OpenMachine, name: str, values: Mapping[str, float]) -> Any:
    """Program: write registers of the device of an axis, after a read of its position."""
    return await call_device(machine, name, "write", values)


async def call_device(machine: OpenMachine, name: str, function: str, arguments: Mapping[str, Any]) -> Any:
    """Program: a driver function of the device of an axis, after a read of its position."""
    axis = machine.axis(name)
    called = _device_function(axis, function)
    await run(axis.bus, read_position(axis))
    return await run(axis.bus, called(axis.device, **arguments))


def _device_function(axis: Axis, name: str) -> Callable[..., Any]:
    method: Any = getattr(type(axis.device), name, None)
    if not hasattr(method, "function"):
        raise RequestError(f"{axis.name}: {axis.config.device} has no command {name!r}")
    return method.function  # type: ignore[no-any-return]


def _at_once(method: Callable[..., Any]) -> Callable[..., Program[Any]]:
    async def program(robot: RobotMethods, **fields: Any) -> Any:
        return method(robot, **fields)

    return program


PROGRAMS: Final[Mapping[type, Callable[..., Program[Any]]]] = {
    commands.Move: moves.move,
    commands.Pose: moves.pose,
    commands.Jog: moves.jog,
    commands.Home: moves.home,
    commands.RunProgram: moves.run_stored,
    commands.Replay: recording.replay_file,
    commands.Teach: recording.teach_file,
    commands.Follow: recording.follow,
    commands.Torque: switch_torque,
    commands.Stop: moves.stop,
    commands.EStop: _at_once(RobotMethods.estop),
    commands.Reset: _at_once(RobotMethods.reset),
    commands.SetPosition: _at_once(RobotMethods.set_position),
    commands.ClearFault: _at_once(RobotMethods.clear_fault),
    commands.ReadRegisters: read_registers,
    commands.WriteRegisters: write_registers,
    commands.DeviceCommand: call_device,
}


# -- blocking --------------------------------------------------------------------------------------------------


class Robot(RobotMethods):
    """An open machine, blocking; use it in a `with`. Raises NoReply for a device that does not answer."""

    def __init__(self, config: MachineConfig, axes: Names = None) -> None:
        super().__init__(config, axes)
        self._stack = ExitStack()
        self._signals: Interrupts | None = None
        with ExitStack() as stack:
            for name, bus in self.config.buses.items():
                self.buses[name] = stack.enter_context(
                    open_bus(bus.address, **bus_options(self._whole, name))
                )
            drive(identify(self, "blocking"))
            self._stack = stack.pop_all()

    def carry_out(self, program: Program[T]) -> T:
        """Run a program and give its value."""
        return drive(program)

    def execute(self, command: RobotCommand) -> Any:
        """Carry out a command and give its result."""
        return drive(self.program(command))

    def loop(
        self,
        rate: float | None = None,
        names: Names = None,
        *,
        policy: Policy = "reject",
        direct: bool = False,
    ) -> Loop:
        """A control loop of these axes, at `rate` Hz. See `ControlLoop`."""
        return Loop(ControlLoop(self, names, rate=rate, policy=policy, direct=direct))

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
            try:
                drive(_leave(self, error))
            finally:
                self._closed.set()
                self._stack.close()
                if self._signals is not None:
                    self._signals.cleanups -= 1


# -- asyncio ---------------------------------------------------------------------------------------------------


class AsyncRobot(RobotMethods):
    """An open machine on asyncio; it is opened when its `async with` is entered."""

    async def carry_out(self, program: Program[T]) -> T:
        """Run a program and give its value."""
        return await drive_async(program)

    def loop(
        self,
        rate: float | None = None,
        names: Names = None,
        *,
        policy: Policy = "reject",
        direct: bool = False,
    ) -> AsyncLoop:
        """A control loop of these axes, at `rate` Hz. See `ControlLoop`."""
        return AsyncLoop(ControlLoop(self, names, rate=rate, policy=policy, direct=direct))

    async def execute(self, command: RobotCommand) -> Any:
        """Carry out a command and give its result."""
        if isinstance(command, commands.EStop) and not self._is_virtual:
            from asyncio import to_thread

            return await to_thread(self.estop)
        return await drive_async(self.program(command))

    async def __aenter__(self) -> Self:
        from motorbus.bus.aio import TaskSignals

        if self._closed.is_set():
            raise RequestError("this robot is closed", advice="make another one")
        async with AsyncExitStack() as stack:
            stack.callback(TaskSignals().end)
            for name, bus in self.config.buses.items():
                opened = open_async(bus.address, **bus_options(self._whole, name))
                self.buses[name] = await stack.enter_async_context(opened)
            await drive_async(identify(self, "awaiting"))
            stack.callback(self._closed.set)
            self._stack = stack.pop_all()
        return self

    async def __aexit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        async with self._stack:
            await self.carry_out(_leave(self, error))
