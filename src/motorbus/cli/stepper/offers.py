"""What common commands use of this family; `motorbus.cli.faces` says what each is for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motorbus.cli.stepper.writing import result
from motorbus.families.stepper import Planned

if TYPE_CHECKING:
    from motorbus.families.stepper import Controller, Written

COMMANDS: Final = {
    "write_project()": "`motorbus stepper write`",
    "backup()": "`motorbus stepper backup`",
    "restore()": "`motorbus stepper restore`",
    "run()": "`motorbus stepper run`",
    "jog()": "`motorbus jog`",
    "move_by()": "`motorbus move BUS#1+=ANGLE`",
    "home()": "`motorbus home`",
    "set_output()": "`motorbus stepper set-output`",
    "read_input()": "`motorbus stepper read-input`",
    "inputs()": "`motorbus stepper inputs`",
    "lint()": "`motorbus stepper check`",
    "expert=True": "--expert",
    "endless=True": "--endless",
    "stop_first=True": "--stop-first",
}
"""What errors of this family call by the name of a method, and the command that does the same."""

KEPT: Final = "the project it has stored"
"""Where its parameters are kept; what memory that is nobody says."""


def planned(event: object) -> str:
    """What would change and what that costs, as `difference` has it."""
    return str(event.difference) if isinstance(event, Planned) else ""


def written(told: Written) -> dict[str, object]:
    """What was written, and what is known of it, as `motorbus stepper write` says it."""
    return result(told)


def sample(one: Controller) -> dict[str, object]:
    """The levels of its five inputs, each as two readings agree: all that it tells while it runs."""
    return {f"input_{port}": active for port, active in one.inputs().items()}
