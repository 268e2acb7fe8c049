"""`motorbus recover`: end a guarded change that was cut off; without a bus, say where there is one."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from motorbus.cli import dry, faces
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Exit, Unforeseeable
from motorbus.cli.identity import address, carried_out
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.target import face, offers, opened, target
from motorbus.core.steps import OUTCOME, JournalEntry
from motorbus.errors import MotorbusError, RequestError
from motorbus.journal import Change

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output
    from motorbus.core.family import Family
    from motorbus.journal import BusJournal

app = App(
    name="recover",
    usage="Usage: motorbus recover [BUS] [OPTIONS]",
    help_epilogue="""`set-id` and `set-baud` write down what they are about to do, and so do `jog`,
`move` and `home` on stepper buses, which borrow project 1. When the program is
killed or the power goes in the middle, this finds the device, finishes the
change or takes it back, and says which: a servo is locked again, a stepper
controller is told to stop and has its project 1 back. It may be said again at
any time. --forget gives the change up without touching the device, as when it
is gone. --of is for a port that has another name since, as after the adapter
was plugged in again.

Examples:

    motorbus recover
    motorbus recover feetech:/dev/ttyACM0 --yes
    motorbus recover stepper:/dev/ttyUSB0 --yes
    motorbus recover feetech:/dev/ttyACM1 --of feetech:/dev/ttyACM0 --yes
    motorbus recover feetech:/dev/ttyACM0 --forget --yes""",
)

SCHEMA = "motorbus.recover/1"


@app.default
def recover(
    bus: Annotated[str, Parameter(name="BUS")] = "",
    /,
    *,
    forget: Flag = False,
    of: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Finish or take back a change that was cut off.

    Parameters
    ----------
    bus
        FAMILY:PORT, as feetech:/dev/ttyACM0; every unfinished change is listed when left out.
    forget
        Give the change up: nothing is sent, and the bus may be changed again.
    of
        The name that this bus had when the change was cut off; its journal is the one that is ended.
    yes
        Do not ask before the device is stopped or written, or the change is forgotten.
    options
        Any option of the bus string, as a flag.
    """
    if not bus:
        return _listed(output, more=bool(forget or of or dry_run or options))
    bus, family, _ = target(bus)
    _keeps_journals(family)
    if forget:
        return _given_up(of or bus, options, output, yes=yes)
    with _journal_elsewhere(of) as kept, opened(bus, options, output) as opening:
        change = _unfinished(opening, kept)
        if change is None:
            return _nothing(of or bus, output)
        if dry_run:
            _rehearsed(opening, change, output)
            return Exit.OK
        consent_to(_ending(change), output, yes=yes)
        outcome = carried_out(opening, change.node, "recover", change.verb, change.facts, output=output)
        _closed(kept, change, outcome)
    return _told(bus, change, outcome, output, family)


def _keeps_journals(family: Family) -> None:
    """Raises RequestError for a family whose changes need none: what was cut off is said again."""
    try:
        offers(family, "recover")
    except RequestError as lack:
        raise RequestError(
            f"{family.name} buses keep no journal, so there is nothing to recover",
            advice=faces.offer(family.name, "CUT_OFF") or lack.advice,
        ) from None


@contextmanager
def _journal_elsewhere(of: str) -> Iterator[BusJournal | None]:
    """The journal of a port by the name it had, while nobody else uses that port."""
    from motorbus import session
    from motorbus.link.lock import PortLock

    of = target(of).bus if of else ""
    kept = session.journal_of(of) if of else None
    if kept is None or kept.path is None:
        yield None
        return
    lock = PortLock(session.lock_name(of, {}))
    lock.path = kept.path.with_suffix(
        lock.path.suffix
    )  # it may lie where this name was a link to another port
    with lock:
        yield kept


def _unfinished(bus: Bus, kept: BusJournal | None) -> Change | None:
    from motorbus import session

    return session.unfinished(bus) if kept is None else kept.unfinished()


def _closed(kept: BusJournal | None, change: Change, outcome: str) -> None:
    """End a change in the journal by its former name; its own the bus has closed already."""
    if kept is not None:
        kept(JournalEntry(change.verb, OUTCOME, {"outcome": outcome}))


def _nothing(bus: str, output: Output) -> Exit:
    output.document(SCHEMA, {"bus": bus, "outcome": None})
    output.text(f"nothing is unfinished on {bus}")
    return Exit.OK


def _told(bus: str, change: Change, outcome: str, output: Output, family: Family | None = None) -> Exit:
    """What has become of it; with its family, how the device is addressed now, if that has changed."""
    told = {"new": "finished", "old": "given back" if change.what else "taken back"}.get(outcome, outcome)
    there = {"address": _address(bus, change, family)} if family and outcome == "new" else {}
    output.document(SCHEMA, {"bus": bus, **_facts(change), "outcome": outcome, **there})
    output.text(f"{told}: {_called(change)}" + "".join(f"; it is {one} now" for one in there.values()))
    return Exit.OK


def _address(bus: str, change: Change, family: Family) -> str:
    return address(bus, family, node=change.facts.get("new"), rate=change.facts.get("new_rate") or 0)


def _given_up(bus: str, options: Mapping[str, str], output: Output, *, yes: bool) -> Exit:
    """Close the journal as it is; the port need not be there any more."""
    with ExitStack() as stack:
        kept: Any = stack.enter_context(_journal_elsewhere(bus))
        if kept is None:  # nothing is sent: it is simulated, or belongs to nobody
            kept = stack.enter_context(opened(bus, options, output)).journal
        if kept is None:
            return _nothing(bus, output)
        try:
            change = kept.unfinished()
        except MotorbusError as error:  # nobody can end what cannot be read
            change = Change(bus, "?", {}, "?")
            output.note(f"note: {error.summary}")
        if change is None:
            return _nothing(bus, output)
        consent_to(f"forget {_called(change)}", output, yes=yes)
        kept.forget()
    return _told(bus, change, "forgotten", output)


def _listed(output: Output, *, more: bool) -> Exit:
    from motorbus import journal

    if more:
        raise RequestError("which bus?", expected="BUS, as feetech:/dev/ttyACM0")
    told = journal.everywhere()
    found = [one for one in told if isinstance(one, Change)]
    unread = [one for one in told if isinstance(one, MotorbusError)]
    output.document("motorbus.recover.list/1", {"changes": [_facts(one) for one in found]})
    rows = [(one.bus, _called(one), one.begun, f"motorbus recover {one.bus}") for one in found]
    if rows:
        output.table("", ["bus", "unfinished", "begun", "to end it"], rows)
    elif not unread:
        output.text("nothing is unfinished")
    for error in unread:  # the readable ones have been told
        raise error
    return Exit.OK


def _facts(change: Change) -> dict[str, object]:
    known: dict[str, object] = {
        name: change.facts[name] for name in ("what", "new", "rate", "new_rate") if name in change.facts
    }
    node = change.facts.get("node")
    return {"bus": change.bus, "change": change.verb, "id": node, **known, "begun": change.begun}


def _ending(change: Change) -> str:
    """What is about to be done. What a family calls by its own words is a loan, which nobody can finish."""
    if change.what and change.advice:
        return f"end {change.what}: stop the device"
    if change.what:
        return f"end {change.what}: stop the device, and give back what was there"
    return f"finish {_called(change)}, or take it back"


def _called(change: Change) -> str:
    """What it is, in the words of its family where it has left any; else it is a change of id or rate."""
    facts = change.facts
    if change.what:
        return change.what
    to = f"{facts.get('new_rate')} bit/s" if "baud" in change.verb else f"#{facts.get('new')}"
    node = change.facts.get("node")
    return "a change of which nothing is known" if node is None else f"the change of #{node} to {to}"


def _rehearsed(bus: Bus, change: Change, output: Output, **extra: object) -> None:
    rehearsal = dry.DryBus(bus)
    try:
        face(rehearsal, change.node).recover(change.verb, change.facts, **extra)
    except Unforeseeable as error:
        output.note(f"note: {error.summary}; what is shown is as far as it can be foreseen")
    dry.show(rehearsal, output)
