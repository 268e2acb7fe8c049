"""What only FEETECH servos can do, and what is known of them: the commands, and what common commands use.

The only face that knows this family. `app` has the commands, each file some of them; the rest is what common commands
use, see `motorbus.cli.faces`.
"""

from __future__ import annotations

from motorbus.cli.feetech import modes, procedures
from motorbus.cli.feetech.commands import COMMANDS
from motorbus.cli.feetech.offers import say, torque_after_write, torque_told
from motorbus.cli.feetech.orders import app
from motorbus.cli.feetech.together import move_together, ping_everyone
from motorbus.families.feetech.driver import disable_torque_everyone

__all__ = [
    "COMMANDS",
    "app",
    "disable_torque_everyone",
    "modes",
    "move_together",
    "ping_everyone",
    "procedures",
    "say",
    "torque_after_write",
    "torque_told",
]
