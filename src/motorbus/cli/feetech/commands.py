"""What errors of this family call by the name of a method, and the command that does the same."""

from __future__ import annotations

from typing import Final

COMMANDS: Final = {
    "calibrate()": "`motorbus calibrate`",
    "calibrate(how='offset')": "`motorbus calibrate BUS#ID --how offset`",
    "factory_restore()": "`motorbus feetech factory-restore`",
    "limits=(low, high)": "--low and --high",
    "move()": "`motorbus move`",
    "recover_overload()": "`motorbus feetech recover-overload`",
    "set_mode('position')": "`motorbus feetech mode BUS#ID position`",
    "set_mode('velocity')": "`motorbus feetech mode BUS#ID velocity`",
    "set_mode('pwm')": "`motorbus feetech mode BUS#ID pwm`",
    "set_mode('step')": "`motorbus feetech mode BUS#ID step`",
    "set_mode('current')": "`motorbus feetech mode BUS#ID current`",
}
