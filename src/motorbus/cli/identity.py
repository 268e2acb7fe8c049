"""What `set-id` and `set-baud` share: a change by which a device is found afterwards, and how to address it then."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from motorbus.cli import dry, faces
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Unforeseeable
from motorbus.cli.target import face, rate_word, takes
from motorbus.core import units
from motorbus.core.steps import Progress
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output
    from motorbus.core.family import Family


def id_said(text: str) -> int:
    """An id as it was typed, decimal or 0x. Raises RequestError when it is no whole number."""
    try:
        return units.whole(text)
    except ValueError:
        raise RequestError(
            f"{text!r} is not an id", expected="a whole number", advice="nothing was sent"
        ) from None


def parse_timeout(timeout: str) -> dict[str, object]:
    """--timeout as an argument of a verb, if it is given. Raises RequestError."""
    return {"timeout": units.parse(timeout, "time")} if timeout else {}


def rehearsed(
    bus: Bus, nodes: Iterable[int], verb: str, value: int, extra: Mapping[str, object], output: Output
) -> None:
    """Show what would be sent to each, as far as that can be foreseen."""
    shown = dry.DryBus(bus)
    for node in nodes:
        rehearsal = dry.DryBus(bus)  # each for itself: what is withheld of one says nothing of the next
        try:
            getattr(face(rehearsal, node), verb)(value, **extra)
        except Unforeseeable as error:
            output.note(f"note: {error.summary}; what is shown is as far as it can be foreseen")
        shown.frames += rehearsal.frames
    dry.show(shown, output)


def agreed(
    bus: Bus, node: int, verb: str, value: int, extra: Mapping[str, object], what: str, output: Output
) -> None:
    """Ask before it is done, once a rehearsal has found nothing against it."""
    rehearse = partial(getattr(face(dry.DryBus(bus), node), verb), value, **extra)
    consent_to(what, output, yes=False, rehearse=rehearse)


def carried_out(
    bus: Bus,
    node: int,
    verb: str,
    *args: object,
    output: Output,
    report: Any = None,
    **extra: object,
) -> Any:
    """What the verb of this device returns; its progress as a bar, and what else it has to say as notes.

    `report(event)` is called first for each event.
    """
    one = face(bus, node)
    takes(one, verb, extra)
    function: Callable[..., Any] = getattr(type(one), verb).function
    say: Callable[[object], str] = faces.offer(bus.family.name, "say") or _nothing
    with output.progress(verb.replace("_", " ")) as bar:

        def listen(event: object) -> None:
            if report is not None:
                report(event)
            if isinstance(event, Progress):
                bar.advance(event.done, event.total, event.what)
            elif text := say(event):
                bar.say(text)
                if not bar.shown:
                    output.note(text)

        return bus.run(function(one, *args, **extra), report=listen)


def _nothing(event: object) -> str:
    return ""


def address(bus: str, family: Family, *, node: int | None = None, rate: int = 0) -> str:
    """How a device on this bus is addressed, or the bus itself; at another rate than it was when one is given."""
    from motorbus import session

    spot = session.parse_address(bus)
    if rate:
        options = {**spot.options, rate_word(family): str(rate)}
        if rate == family.link.rate:
            del options[rate_word(family)]
        spot = spot._replace(options=options)
    return spot.bus if node is None else f"{spot.bus}#{node}"
