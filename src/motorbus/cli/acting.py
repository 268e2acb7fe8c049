"""One verb that moves a device: rehearsed, agreed to, carried out, or only shown; the same for every such command."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.identity import carried_out
from motorbus.cli.target import face, takes

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output


def acted(
    bus: Bus,
    node: int,
    verb: str,
    *args: object,
    question: str,
    dry_run: bool,
    output: Output,
    **extra: object,
) -> Any:
    """What the verb returned, None after a dry run. `question` is what somebody must agree to before, "" for nothing.

    Raises RequestError where the verb lacks one of `extra`.
    """
    rehearsal = dry.DryBus(bus)
    one = face(rehearsal, node)
    takes(one, verb, extra)
    rehearse = partial(getattr(one, verb), *args, **extra)
    if dry_run:
        dry.rehearse(rehearsal, rehearse, output)
        return None
    consent_to(question, output, yes=not question, rehearse=rehearse)
    return carried_out(bus, node, verb, *args, output=output, **extra)
