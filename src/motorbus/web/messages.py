"""Messages between page and server, as Structs. Commands of the robot are sent as they are.

Up: `Message`. Down: `Frame` with each state, `Control` when the right to move changes, `Done` or `Failed` for each
command, `Notice` for what every page shows.
"""

from __future__ import annotations

from typing import Any, Final, Literal, TypeAlias

import msgspec
from msgspec import Struct

from motorbus.motion import commands
from motorbus.motion.state import RobotState


class Heartbeat(Struct, frozen=True, tag="heartbeat"):
    """The page that moves the machine is still there."""


class Take(Struct, frozen=True, tag="take"):
    """Take the right to move; with `force` from another page, which stops the machine."""

    force: bool = False


class Leave(Struct, frozen=True, tag="leave"):
    """Give the right to move back; the machine stops."""


class Target(Struct, frozen=True, tag="target"):
    """A slider: follow this position (rad, m), a wheel this velocity (rad/s).

    `stops` is the number of stops that the page knew when the slider was taken; after a later stop it is refused.
    """

    name: str
    value: float
    stops: int


class JogStart(Struct, frozen=True, tag="jog_start"):
    """A button is held: move at this velocity (rad/s, m/s). `stops` as in `Target`."""

    name: str
    velocity: float
    stops: int


class Release(Struct, frozen=True, tag="release"):
    """The button of a jog was released, or a recording ends."""


class Inject(Struct, frozen=True, tag="inject"):
    """An order to a simulated bus of `--demo`, in the words of the control socket, as `unplug 3`."""

    bus: str
    order: str


class SetUp(Struct, frozen=True, tag="setup"):
    """Set up joints of a FEETECH bus, () means all. Its `Prompt`, `Live` and `Note` go to every page."""

    kind: Literal["number", "calibrate", "verify"]
    bus: str
    names: tuple[str, ...] = ()


class Answer(Struct, frozen=True, tag="answer"):
    """The text of the user for the step with the text `question`; "" for Enter."""

    question: str
    text: str = ""


class Examine(Struct, frozen=True, tag="doctor"):
    """Run the doctor on the open machine; its report is the result."""


PageMessage: TypeAlias = (
    Heartbeat | Take | Leave | Target | JogStart | Release | Inject | SetUp | Answer | Examine
)
PageCommand: TypeAlias = (
    commands.Move
    | commands.Pose
    | commands.Home
    | commands.RunProgram
    | commands.Replay
    | commands.Teach
    | commands.Torque
    | commands.Stop
    | commands.EStop
    | commands.Reset
    | commands.SetPosition
    | commands.ClearFault
    | commands.ReadRegisters
    | commands.WriteRegisters
)
"""Commands of the robot that a panel sends; the others are refused."""
Message: TypeAlias = PageMessage | PageCommand
DECODER: Final = msgspec.json.Decoder(Message)


class Frame(Struct, frozen=True, tag="state"):
    """The machine now. `activity` is the command that runs, `stops` the number of stops so far."""

    state: RobotState
    activity: str
    latched: bool
    stops: int


class Control(Struct, frozen=True, tag="control"):
    """Which page may move the machine."""

    holder: Literal["you", "other", "none"]


class Done(Struct, frozen=True, tag="done"):
    """The result of a command."""

    of: str
    result: Any = None


class Failed(Struct, frozen=True, tag="failed"):
    """What failed, what was expected, the cause and the fix; `notes` are for other axes."""

    of: str
    text: str
    expected: str = ""
    cause: str = ""
    advice: str = ""
    notes: tuple[str, ...] = ()


class Notice(Struct, frozen=True, tag="notice"):
    """A text for every page. `reopens`: the server opens the machine again, then the page must load itself."""

    text: str
    reopens: bool = False
