"""What common commands use of this family; `motorbus.cli.faces` says what each is for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motorbus.families.stepper import Controller

COMMANDS: Final = {
    "select()": "`motorbus stepper select-project`",
    "save()": "`motorbus stepper save-project`",
    "clear()": "`motorbus stepper clear-project`",
    "write_project()": "`motorbus stepper write`",
    "backup()": "`motorbus stepper backup`",
    "restore()": "`motorbus stepper restore`",
    "run()": "`motorbus stepper run`",
    "start_project()": "`motorbus stepper start-project`",
    "jog()": "`motorbus jog`",
    "jog_forward()": "`motorbus stepper jog-forward`",
    "jog_reverse()": "`motorbus stepper jog-reverse`",
    "move_by()": "`motorbus move BUS#1+=ANGLE`",
    "run_once()": "`motorbus stepper run-once`",
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


def sample(one: Controller) -> dict[str, object]:
    """The levels of its five inputs, each as two readings agree: all that it tells while it runs."""
    return {f"input_{port}": active for port, active in one.inputs().items()}
