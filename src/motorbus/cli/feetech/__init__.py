"""What only FEETECH servos can do, and what is known of them: the commands, and what common commands use.

The only face that knows this family. `app` has the commands, each file some of them; the rest is what common commands
use, see `motorbus.cli.faces`.
"""

from __future__ import annotations

from motorbus.cli.feetech import tables
from motorbus.cli.feetech.orders import Train, app, move_together, ping_everyone

__all__ = ["Train", "app", "move_together", "ping_everyone", "tables"]
