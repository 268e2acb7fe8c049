"""The commands of one family, and what common commands use of it.

`Family.cli` is the dotted name of a module, imported when it is used. Its `app` has the commands of the family. For
common commands it may offer

    move_together(bus, goals, velocity, acceleration, wait)    goals in rad by node, begun in the same instant where the
                                                               family can; when one device is lost the others stop
    disable_torque_everyone()                                  the request that does it on a whole bus in one broadcast
    ping_everyone(bus)                                         the nodes that answer one broadcast
    say(event)                                                 what an event of its operations says, "" if nothing
    sample(one)                                                what there is to watch of a device without telemetry:
                                                               words by name
    as_written(driver, read, withheld, request)                the reply to a request after frames that a dry run has
                                                               withheld, b"" if they make no difference; None: unknown
    meaning(row, raw)                                          what a raw value says in words, where the row cannot tell
    KEPT                                                       where registers are that survive power-off: "EEPROM" if
                                                               it does not say another word
    planned(event)                                             what an event of `write` says of what is about to be
                                                               written and what that takes, "" if nothing
    written(told)                                              what `write` returned, as plain data
    CUT_OFF                                                    what to do about a change that was cut off, where no
                                                               journal is kept
    COMMANDS                                                   what errors call -> the command that does the same

A family that lacks one of them is served by the common verbs, or the command says that it cannot be done.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from motorbus import families
from motorbus.errors import RequestError


def names() -> list[str]:
    """The families that may have commands of their own; none is imported."""
    return families.names()


def __getattr__(family: str) -> Any:
    """The commands of a family; the parser imports them by this name when one is called."""
    if family not in names():
        raise AttributeError(f"no family {family!r}")

    def refuse() -> None:
        raise RequestError(f"{family} devices have no commands of their own", advice="nothing was sent")

    return offer(family, "app") or refuse


def offer(family: str, what: str) -> Any:
    """What the module of this family offers by this name, or None."""
    name = families.load(family).cli
    return getattr(import_module(name), what, None) if name else None
