"""What errors of this family call by the name of a method, and the command that does the same."""

from __future__ import annotations

from typing import Final

COMMANDS: Final = {
    "calibrate()": "`motorbus calibrate`",
    "calibrate(how='offset')": "`motorbus calibrate BUS#ID --how offset`",
    "clear_turns()": "`motorbus feetech clear-turns`",
    "factory_restore()": "`motorbus feetech factory-restore`",
    "limits=(low, high)": "--low and --high",
    "move()": "`motorbus move`",
    "recover_overload()": "`motorbus feetech recover-overload`",
    "set_current()": "`motorbus feetech drive BUS#ID current=AMPERE`",
    "set_duty()": "`motorbus feetech drive BUS#ID duty=FRACTION`",
    "set_many_turns(False)": "`motorbus feetech many-turns BUS#ID off`",
    "set_many_turns(True)": "`motorbus feetech many-turns BUS#ID on`",
    "many_turns()": "`motorbus feetech many-turns BUS#ID`",
    "set_mode('position')": "`motorbus feetech mode BUS#ID position`",
    "set_mode('velocity')": "`motorbus feetech mode BUS#ID velocity`",
    "set_mode('pwm')": "`motorbus feetech mode BUS#ID pwm`",
    "set_mode('step')": "`motorbus feetech mode BUS#ID step`",
    "set_mode('current')": "`motorbus feetech mode BUS#ID current`",
    "set_second_id()": "`motorbus feetech second-id BUS#ID NEW`",
    "set_second_id(": "`motorbus feetech second-id BUS#ID {}`",
    "set_torque_limit(": "`motorbus feetech torque-limit BUS#ID {}`",
    "set_velocity()": "`motorbus feetech drive BUS#ID velocity=VELOCITY`",
}
