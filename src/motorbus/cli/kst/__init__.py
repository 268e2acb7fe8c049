"""What only KST CAN servos and their kin can do: the commands of their manual, one by one, and provisioning.

The only face that knows this family. `app` has the commands, each file some of them; the rest is what common commands
use, see `motorbus.cli.faces`.
"""

from __future__ import annotations

from motorbus.cli.kst import identity, position, provision, settings, sheet
from motorbus.cli.kst.offers import (
    COMMANDS,
    CUT_OFF,
    bit_rate_heard,
    budget_frames,
    meaning,
    ping_everyone,
    report_frames,
    say,
)
from motorbus.cli.kst.servo import app
from motorbus.cli.kst.together import move_together

__all__ = [
    "COMMANDS",
    "CUT_OFF",
    "app",
    "bit_rate_heard",
    "budget_frames",
    "identity",
    "meaning",
    "move_together",
    "ping_everyone",
    "position",
    "provision",
    "report_frames",
    "say",
    "settings",
    "sheet",
]
