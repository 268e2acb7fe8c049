"""Commands of a robot and their results, as Structs: one definition for shell, web and schema.

Positions are in rad (m), velocities in rad/s (m/s), times in s. `name` is an axis; `names` are axes, groups and buses,
None means all axes. The fields of a command are the arguments of its program, see `robot.PROGRAMS`.
"""

from __future__ import annotations

from typing import TypeAlias

from msgspec import Struct

from motorbus.motion.profile import Kind

AxisNames: TypeAlias = tuple[str, ...] | None


class Move(Struct, frozen=True, tag="move"):
    """Move axes to these positions; all start and end together. `relative`: by these distances.

    `velocity` is the highest of each axis, None: that of the machine file.
    """

    goals: dict[str, float]
    duration: float | None = None
    speed: float = 1.0
    kind: Kind = "trapezoid"
    relative: bool = False
    velocity: float | None = None


class Pose(Struct, frozen=True, tag="pose"):
    """Move to a pose of the machine file."""

    name: str
    duration: float | None = None
    speed: float = 1.0


class Jog(Struct, frozen=True, tag="jog"):
    """Move an axis at a velocity for a time."""

    name: str
    velocity: float
    seconds: float


class Home(Struct, frozen=True, tag="home"):
    """Move to the reference switch, at `velocity` or as the device is set."""

    names: AxisNames = None
    timeout: float = 30.0
    velocity: float | None = None


class RunProgram(Struct, frozen=True, tag="run"):
    """Run a stored program of the device of an axis."""

    name: str
    number: int
    timeout: float | None = None


class Replay(Struct, frozen=True, tag="replay"):
    """Play a trajectory file; first move to its start."""

    file: str
    speed: float = 1.0
    smooth: float | None = None
    repeat: int = 1


class Teach(Struct, frozen=True, tag="teach"):
    """Record axes that are moved by hand into a trajectory file."""

    file: str
    seconds: float
    names: AxisNames = None
    rate: float = 50.0
    keep_torque: bool = False


class Follow(Struct, frozen=True, tag="follow"):
    """Let axes track others: follower by leader."""

    pairs: dict[str, str]
    seconds: float
    rate: float = 100.0


class Torque(Struct, frozen=True, tag="torque"):
    """Switch torque; on holds the present position."""

    on: bool
    names: AxisNames = None


class Stop(Struct, frozen=True, tag="stop"):
    """Decelerate and hold. `verify`: watch until each axis rests."""

    names: AxisNames = None
    verify: bool = False


class EStop(Struct, frozen=True, tag="estop"):
    """Emergency stop of all buses; latched until `Reset`."""


class Reset(Struct, frozen=True, tag="reset"):
    """Take the latch of the emergency stop off."""


class SetPosition(Struct, frozen=True, tag="set_position"):
    """Declare the position of an axis whose device reports none."""

    name: str
    position: float


class ClearFault(Struct, frozen=True, tag="clear_fault"):
    """Clear faults, so that the axes may move again."""

    names: AxisNames = None


class ReadRegisters(Struct, frozen=True, tag="read_registers"):
    """Read registers of the device of an axis."""

    name: str
    registers: tuple[str, ...]


class WriteRegisters(Struct, frozen=True, tag="write_registers"):
    """Write registers of the device of an axis."""

    name: str
    values: dict[str, float]


class DeviceCommand(Struct, frozen=True, tag="device_command"):
    """Call a driver function of the device of an axis by its name."""

    name: str
    function: str
    arguments: dict[str, float | int | str | bool] = {}


RobotCommand: TypeAlias = (
    Move
    | Pose
    | Jog
    | Home
    | RunProgram
    | Replay
    | Teach
    | Follow
    | Torque
    | Stop
    | EStop
    | Reset
    | SetPosition
    | ClearFault
    | ReadRegisters
    | WriteRegisters
    | DeviceCommand
)


# -- results ---------------------------------------------------------------------------------------------------


class AxisResult(Struct, frozen=True):
    """Goal and final position of an axis; `estimated`: its device reports none."""

    goal: float
    position: float | None
    estimated: bool = False


class MoveResult(Struct, frozen=True, tag="moved"):
    """A completed move: planned and measured duration (s), what limited it, the axes."""

    axes: dict[str, AxisResult]
    planned: float
    duration: float
    limited_by: str = ""


class StopState(Struct, frozen=True):
    """What the device promised; whether it was seen at rest (None: not watched); its position."""

    promise: str
    at_rest: bool | None = None
    position: float | None = None


class StopResult(Struct, frozen=True, tag="stopped"):
    """The axes that accepted the stop."""

    axes: dict[str, StopState]


class EStopResult(Struct, frozen=True):
    """Of one bus: the nodes that acknowledged an emergency stop, those that did not, and the promise."""

    acknowledged: tuple[int, ...]
    silent: tuple[int, ...]
    promise: str


class LoopResult(Struct, frozen=True, tag="loop"):
    """A finished jog, recording, replay or following: its duration (s), cycles, and the final positions."""

    duration: float
    cycles: int
    positions: dict[str, float]
    overruns: int = 0
    held: dict[str, int] = {}
    notes: tuple[str, ...] = ()
