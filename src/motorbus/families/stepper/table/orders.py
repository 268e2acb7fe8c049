"""What each command does to the world, and whether it may be said twice: one row per command.

Source of what a command does: stepper controller serial protocol manual, the item of its number. How long it takes is
not in the manual: a set command or a read is given the time of a reply, whatever writes memory the time to store.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from motorbus.core.request import Effect, TimeoutClass
from motorbus.families.stepper import wire

REPLY: Final = 0.2
"""s from the end of a request to the end of its reply, an assumption."""
STORE: Final = 1.0
"""s for what writes memory that is kept (save, clear), an assumption."""
DUMP_BEGINS: Final = 0.3
"""s to the first byte of a dump, an assumption."""
DUMP_ENDS: Final = 0.6
"""s to the last byte of a dump, of which 0.235 are on the wire, an assumption."""
RATE: Final = 9600
"""Baud, with 8 data bits, no parity and one stop bit: the manual's preamble."""


class Order(NamedTuple):
    """What carrying out a command does.

    `title` names it for people; `effect` is what it does to the world; `repeatable` says that saying it twice does no
    more than saying it once; `timeout` how long it may take; `note` what one should know before.
    """

    command: wire.Command
    title: str
    effect: Effect
    repeatable: bool
    timeout: TimeoutClass = TimeoutClass.REPLY
    note: str = ""

    @property
    def source(self) -> str:
        return f"stepper controller serial protocol manual, item {self.command.number}"


_EDIT: Final = (Effect.PERSISTENT, True)
_MOVE: Final = (Effect.MOTION, False)
_STOP: Final = (Effect.MOTION, True)
_READ: Final = (Effect.NONE, True)
_STORE: Final = (Effect.PERSISTENT, False)

_ALL: Final[tuple[tuple[str, str, tuple[Effect, bool], str], ...]] = (
    (
        "select_project", "Select a project and set its number of steps", _EDIT,
        "always writes the number of steps; the edits that follow go to this project, an assumption",
    ),
    ("set_microstep_and_angle", "Set microsteps and step angle", _EDIT, "angles up to 2.55 degrees"),
    ("set_turn_distance", "Set the distance of one turn", _EDIT, "defines the unit of all distances"),
    ("set_step_distance", "Set the distance of a step", _EDIT, ""),
    ("set_step_direction_start", "Set direction and start frequency of a step", _EDIT, ""),
    ("set_step_accel_speed", "Set acceleration and speed of a step", _EDIT, ""),
    ("set_step_output", "Set what a step does to the outputs", _EDIT, ""),
    ("set_step_delay", "Set the pause after a step", _EDIT, ""),
    ("set_step_start_input", "Set the input a step waits for", _EDIT, ""),
    ("set_step_stop_input", "Set the input that ends a step", _EDIT, ""),
    ("set_segment_loop", "Set the step loop", _EDIT, "one range for each project"),
    ("set_project_loop", "Set how often a project runs", _EDIT, "255 is endless: no notice ever comes"),
    (
        "start_project", "Start a project", _MOVE,
        "also input 3; the only command with a second answer, EE DD when the project has ended",
    ),
    ("stop_project", "Stop the project", _STOP, "also input 4; names no project"),
    ("read_project", "Read a project", _READ, "226 bytes, no checksum"),
    ("save_project", "Save a project", _STORE, "what was edited is kept when the supply goes"),
    ("clear_project", "Clear a project", _STORE, "all to zero; without project 1 there is no speed to jog with"),
    ("jog_forward", "Jog forward", _MOVE, "until stopped, with the speed of step 1 of project 1"),
    ("jog_reverse", "Jog in reverse", _MOVE, "until stopped, with the speed of step 1 of project 1"),
    ("run_once", "Run one move", _MOVE, "distance and speed of step 1 of project 1"),
    ("stop_motor", "Stop the motor", _STOP, ""),
    ("set_stop_mode", "Set the stop mode", _EDIT, "slow or immediate"),
    ("home", "Home", _MOVE, "in reverse until input 5; no limit of travel or time, no message at its end"),
    (
        "set_output", "Set an output", (Effect.TORQUE, True),
        "what hangs on an output is not known: it may be a brake, a valve or a gripper",
    ),
    ("read_input", "Read an input", _READ, "the only reply that carries live state"),
    ("set_mode4", "Set the variant of mode 4", _EDIT, "nobody knows what it does"),
    ("set_power_on_home", "Set homing at power-on", _EDIT, "the motor moves when the supply comes"),
)  # fmt: skip

ORDERS: Final[Mapping[str, Order]] = MappingProxyType(
    {
        name: Order(
            wire.COMMANDS[name],
            title,
            *what,
            TimeoutClass.STORE if what is _STORE else TimeoutClass.REPLY,
            note,
        )
        for name, title, what, note in _ALL
    }
)
"""Every command by its name, in the order of the manual."""
EDITS: Final = tuple(
    name for name, order in ORDERS.items() if order.effect is Effect.PERSISTENT and order.repeatable
)
"""The commands that set parameters."""
