"""What one family can do beyond the common verbs, for common commands that use it where it is there.

A family's face is the module (or package) of its name in this folder. Apart from its own commands it may offer

    move_together(bus, goals, velocity, acceleration, wait)    goals in rad by node, begun in the same instant where the
                                                               family can; when one device is lost the others stop
    disable_torque_everyone()                                  the request that does it on a whole bus in one broadcast
    ping_everyone(bus)                                         the nodes that answer one broadcast
    budget_frames(driver, node)                                what a loop says to a node ("read", "write"): for each
                                                               frame of that exchange all that it may be
    report_frames(driver, node)                                all that a report of a node may be
    say(event)                                                 what an event of its operations says, "" if nothing
    sample(one)                                                what there is to watch of a device without telemetry:
                                                               words by name
    demo(bus, seconds, picture, output)                        shows what these devices do in so many s, draws a picture
                                                               of it, and prints what came of it
    as_written(driver, read, withheld, request)                the reply to a request after frames that a dry run has
                                                               withheld, b"" if they make no difference; None: unknown
    meaning(row, raw)                                          what a raw value says in words, where the row cannot tell
    KEPT                                                       where registers are that survive power-off: "EEPROM" if
                                                               it does not say another word
    planned(event)                                             what an event of `write` says of what is about to be
                                                               written and what that takes, "" if nothing
    written(told)                                              what `write` returned, as plain data
    torque_after_write(one, values)                            what a write of these registers does to the torque,
                                                               for the question before it, "" if nothing
    torque_told(event)                                         what an event of `write` says of the torque after it:
                                                               {"on", "why", "text"}, None if nothing
    bit_rate_heard(bus, seconds, report)                       the rate of a bus by listening alone, and what was heard
    CUT_OFF                                                    what to do about a change that was cut off, where no
                                                               journal is kept
    COMMANDS                                                   what errors call -> the command that does the same

A family that lacks one of them is served by the common verbs, or the command says that it cannot be done.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from motorbus import families


def names() -> list[str]:
    """The families that have a face here."""
    return [name for name in families.names() if find_spec(f"motorbus.cli.{name}")]


def offer(family: str, what: str) -> Any:
    """What the face of this family offers by this name, or None."""
    if not _has_one(family):
        return None
    return getattr(import_module(f"motorbus.cli.{family}"), what, None)


@cache
def _has_one(family: str) -> bool:
    """Kept, for a scan asks at every frame, and what is installed is looked through for 2 ms. Faces come with us."""
    return family in names()
