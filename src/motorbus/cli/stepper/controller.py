"""What the commands of this family share: the one controller of a bus, and work on it carried out or only shown."""

from __future__ import annotations

from collections.abc import Coroutine
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from cyclopts import Parameter

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Unforeseeable
from motorbus.cli.output import Bar
from motorbus.cli.stepper.events import say
from motorbus.cli.stepper.files import NAME
from motorbus.cli.target import face, opened, target
from motorbus.cli.wording import in_words_of_the_shell
from motorbus.core.steps import Progress, discard
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.stepper import FAMILY, Controller
from motorbus.families.stepper.driver import Node

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output
    from motorbus.core.steps import Runnable

T = TypeVar("T")

BusName = Annotated[str, Parameter(name="BUS", help="stepper:PORT, as stepper:/dev/ttyUSB0")]
BusOption = Annotated[str, Parameter(help="Any option of the bus string, as a flag: --dump-order big.")]
ProjectNumber = Annotated[int, Parameter(help="Which project, 1 to 4.")]


def ours(text: str) -> str:
    """The bus that BUS or BUS#1 names. Raises RequestError when it is one of another family."""
    found = target(text)
    if found.family.name != NAME:
        raise RequestError(f"{found.bus} is no {NAME} bus", advice="nothing was sent")
    return found.bus


def numbers_in(text: str) -> tuple[int, ...]:
    """1,3 or 1-4 -> those numbers. Raises RequestError for text that names none."""
    from motorbus import session

    return session.parse_ids(text)


def verb(name: str, *args: Any, **values: Any) -> Callable[[Controller], Runnable[Any]]:
    """A verb of the controller with what it gets, to be carried out on one."""
    function = getattr(Controller, name).function
    return lambda one: function(one, *args, **values)


def carried_out(
    text: str,
    options: Mapping[str, str],
    output: Output,
    do: Callable[[Controller], Runnable[T]],
    *,
    what: str = "",
    consent: str | Callable[[Bus], str] = "",
    dry_run: bool = False,
    rehearse: Callable[[Controller], Runnable[object]] | None = None,
    hear: Callable[[object, Bar], None] | None = None,
) -> T | None:
    """Open the bus and carry out what `do` says to its controller; what came of it, None after a dry run.

    What is refused before the first step is refused before the port is opened. `consent` is what somebody must agree to
    before, "" for nothing; a function finds that out on the open bus. Before anybody is asked a rehearsal has found
    nothing against it. `rehearse` stands for `do` there where `do` waits for what no rehearsal brings. `hear` gets the
    events that `say` has no words for, and the bar named `what`.
    """
    bus = ours(text)
    _refused_early(do)
    with opened(bus, options, output) as opening:
        if dry_run:
            _shown(opening, rehearse or do, output, hear)
            return None
        question = consent if isinstance(consent, str) else consent(opening)
        consent_to(question, output, yes=not question, rehearse=lambda: _rehearsed(opening, rehearse or do))
        with output.progress(what or "working") as bar:
            return opening.run(
                do(face(opening, 1)), report=lambda event: _heard(event, bar, output, opening.report, hear)
            )


def _refused_early(do: Callable[[Controller], Runnable[object]]) -> None:
    """Begin it on a controller of no bus, as far as its first step, which is not carried out."""
    try:
        begun = do(Node())  # type: ignore[arg-type]
        if isinstance(begun, Coroutine):
            with suppress(StopIteration):
                discard(begun.send(None))
            begun.close()
    except MotorbusError as error:
        in_words_of_the_shell(error, FAMILY)
        raise


def _rehearsed(bus: Bus, do: Callable[[Controller], Runnable[object]]) -> dry.DryBus:
    rehearsal = dry.DryBus(bus)
    rehearsal.run(do(face(rehearsal, 1)))
    return rehearsal


def _shown(
    bus: Bus,
    do: Callable[[Controller], Runnable[object]],
    output: Output,
    hear: Callable[[object, Bar], None] | None,
) -> None:
    """What would be sent, as far as that can be foreseen."""
    rehearsal = dry.DryBus(bus)
    try:
        rehearsal.run(
            do(face(rehearsal, 1)), report=lambda event: hear(event, Bar()) if hear is not None else None
        )
    except Unforeseeable as error:
        output.note(f"note: {error.summary}; what is shown is as far as it can be foreseen")
    dry.show(rehearsal, output)


def _heard(
    event: object,
    bar: Bar,
    output: Output,
    report: Callable[[object], None] | None,
    hear: Callable[[object, Bar], None] | None,
) -> None:
    if isinstance(event, Progress):
        bar.advance(event.done, event.total, event.what)
    elif say(event):
        if report is not None:
            report(event)
    elif hear is not None:
        hear(event, bar)
