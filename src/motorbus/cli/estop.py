"""`motorbus estop`: stop a bus now, also one that another motorbus process holds, also one whose program hangs."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

from cyclopts import App, Parameter

from motorbus.cli import faces
from motorbus.cli.each import with_notes
from motorbus.cli.exits import Exit, Partial
from motorbus.cli.machine import axes_at, is_address, machine, machine_file
from motorbus.cli.output import Output
from motorbus.cli.target import everyone, opened, said, targets
from motorbus.core.request import Effect
from motorbus.errors import LinkError, MotorbusError, NoReply, PortNotFound, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.bus.stop_socket import StopOutcome
    from motorbus.core.family import Family
    from motorbus.link.errors import Owner

ANYBODY: Final = 1
"""An id that a device of any family can have."""
TRIES: Final = 5
"""Stops sent to a named device until it acknowledges, as in the rounds of an open bus."""
OPENING: Final = 1.0
"""s that a process which is opening a port may need until it offers a stop."""
BY_HAND: Final = "cut the power by hand"
NAME_THEM: Final = "name the devices, as BUS#1-6, and each is asked; or cut the power by hand"
MEND: Final = "correct the machine file: its own buses are stopped only if they are open"
ALL: Final = "acknowledged by all known"

app = App(
    name="estop",
    help_epilogue="""THE ARM WILL SAG: an emergency stop cuts the torque of FEETECH servos, and
nothing holds them up then, but for axes whose machine file says estop = "hold"
(or --estop-hold IDS). `motorbus stop` decelerates and holds instead. KST
servos have no torque switch: their target becomes the place where they were
last seen, or asked for now, and they hold there. A stepper controller is told
to end its project and to stop its motor, as fast as its stop mode says.

A bus that another motorbus process holds is stopped by that process, even if
its event loop hangs, and stays stopped until that process says reset(). A bus
that nobody holds is opened and stopped from here; the stop reaches everyone,
but only devices that are named (BUS#1-6), or known because they answered
before, can acknowledge it. Ends with exit code 0 when all of them did, 6 when
some did, 5 when nobody did, or the process that holds the bus does not answer,
3 where the ports are gone. A port that a foreign program holds cannot be
reached: the error names that program, and the code is 4. Devices that were not
asked are counted: they got the broadcast and confirmed nothing, exit code 6.

Without BUS, every open bus on a real port is stopped, and every bus of the
machine file, simulated or not. Other simulated buses that are open are named
and not stopped; --all stops them too. By its names, a group or an axis stops
its whole buses. An error in the file prevents the stop of no open bus: exit code 6.

From here KST servos must say where they are before they can be held there. On
a bus without ids everyone is asked who is there first, and the answers are
waited for (0.15 s); name the servos (BUS#1-6), and that is left out.

Examples:

    motorbus estop
    motorbus estop feetech:/dev/ttyACM0
    motorbus estop feetech:/dev/ttyACM0#1-6
    motorbus estop arm""",
)


@app.default
def estop(
    bus: Annotated[str, Parameter(name="BUS[#ID]")] = "",
    /,
    *,
    everything: Annotated[bool, Parameter(name="--all", negative="")] = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Emergency stop: stop a bus at once, from any shell. Where torque is cut, an arm sags.

    Parameters
    ----------
    bus
        FAMILY:PORT or a name; every open bus on a real port, and those of the machine file, when left out.
    everything
        Stop every other open bus too, also simulated ones.
    options
        Any option of the bus string, as a flag.
    """
    broken = None if bus and is_address(bus) else _file_error()
    if broken is not None:
        bus = ""  # the file has no names then: every open bus is stopped
    words: tuple[str, ...] = (bus,) if bus else ()
    if not bus and broken is None and machine_file().path is not None:
        words = tuple(machine().buses)
    wanted = _wanted(words)
    failures: list[MotorbusError] = []
    stops: list[dict[str, Any]] = []
    left: list[dict[str, Any]] = []
    if everything or not bus:
        left = _stop_open(wanted, options, stops, failures, everything=everything)
    stops += _stop_each(wanted, options, output, failures)
    output.document("motorbus.estop/1", {"buses": stops, "not_stopped": left})
    for one in stops:
        output.text("\n  ".join(_lines(one)))
    if not stops:
        nothing = _nothing_to_stop(left)
        raise with_notes(broken, [nothing]) if broken is not None else nothing
    for one in left:
        output.text(f"{one['bus']}: not stopped: simulated, held by {one['by']}; `--all` stops it too")
    return _verdict(stops, broken, failures)


class Wanted(NamedTuple):
    """A bus to be stopped, its family, whom to name on it, and whether whoever else is there is stopped too."""

    bus: str
    family: Family
    nodes: tuple[int, ...]
    others: bool


def _wanted(words: Iterable[str]) -> list[Wanted]:
    """The buses of these words, each once. Raises RequestError for a word or a machine file that is wrong.

    The name of a bus names the devices of its axes, and stops every other device too.
    """
    found: dict[str, Wanted] = {}
    for one in (one for word in words for one in targets(word)):
        before = found.get(one.bus, Wanted(one.bus, one.family, (), False))
        nodes = tuple(dict.fromkeys((*before.nodes, *(one.nodes or axes_at(one.bus)))))
        found[one.bus] = before._replace(nodes=nodes, others=before.others or not one.nodes)
    return list(found.values())


def _file_error() -> RequestError | None:
    """The error of the machine file, if there is one with an error."""
    try:
        _ = machine_file().path is not None and machine()
    except RequestError as error:
        return error
    return None


def _lines(one: dict[str, Any]) -> list[str]:
    heard = f"stop sent; acknowledged by {_list(one['acknowledged'], 'nobody')}"
    silent = [f"silent: {_list(one['silent'])}"] if one["silent"] or not one["others"] else []
    more = [one["promise"], "; ".join([f"by {one['by']}", *silent, *_others(one)]), one["note"]]
    return [f"{one['bus']}: {one['error'] or heard}", *(line for line in more if line)]


def _others(one: Mapping[str, Any]) -> list[str]:
    return [f"{len(one['not_asked']) or 'others'} {one['others']}"] if one["others"] else []


def _stop(wanted: Wanted, options: dict[str, str], output: Output) -> dict[str, Any]:
    from motorbus import session
    from motorbus.link.lock import PortLock

    port = session.lock_name(wanted.bus, said(options))
    if not port:  # a channel of this process's own
        return _stop_ourselves(wanted, options, output)
    owner = PortLock(port).owner()
    try:
        outcome = _ask(port, owner)
    except PortNotFound:
        return _stop_ourselves(wanted, options, output)
    unheard = {*outcome.silent, *wanted.nodes} - {*outcome.acknowledged}
    by = f"process {owner.pid} ({owner.program})" if owner else "its owner"
    unknown = sorted(unheard - {*outcome.silent})
    note = "" if wanted.nodes else "only devices that that process knows can acknowledge"
    if unknown:
        note = f"{by} does not know {_list(unknown)}, so it asked for no acknowledgement"
    facts = _facts(wanted.bus, by, outcome._replace(silent=tuple(sorted(unheard))), note)
    if wanted.family.link.only is None:
        _count_others(facts, wanted, all_known=True)  # it knows every device that it moves
    return facts


def _ask(port: str, owner: Owner | None) -> StopOutcome:
    """Let whoever holds this port stop it. Raises PortNotFound for nobody, NoReply for a process that is not heard."""
    from motorbus.bus.stop_socket import request_estop
    from motorbus.link.lock import PortLock, socket_path

    limit = time.monotonic() + OPENING
    while True:
        try:
            return request_estop(socket_path(port))
        except (
            PortNotFound
        ):  # a process that is opening the port has its lock first and offers the stop later
            if PortLock(port).owner() is None or time.monotonic() > limit:
                raise
        except LinkError as error:
            raise _unheard(port, owner, error) from error
        time.sleep(0.01)


def _unheard(port: str, owner: Owner | None, error: LinkError) -> NoReply:
    who = "the process" if owner is None else f"process {owner.pid} ({owner.program})"
    ends = "" if owner is None else f"; `kill -KILL {owner.pid}` gives the port back, then estop again"
    return NoReply(
        f"{who} that holds {port} does not answer, so nobody knows whether it has stopped anything",
        expected="what came of the stop",
        cause=f"it is suspended, or hangs where nothing of it runs: {error.summary}",
        advice=f"cut the supply now{ends}",
    )


def _stop_ourselves(wanted: Wanted, options: dict[str, str], output: Output) -> dict[str, Any]:
    """Nobody offers the stop: send it from here, then have each device that was named confirm it."""
    with opened(wanted.bus, options, output) as opening:
        unmet, asked_all = _meet(opening, wanted, output)
        outcome = opening.estop()
        confirmed, silent = set(outcome.acknowledged), set(outcome.silent)
        for node in wanted.nodes:
            (confirmed if node in confirmed or _confirms(opening, node) else silent).add(node)
        if unmet is not None and not confirmed and not silent:
            raise unmet
    outcome = outcome._replace(
        acknowledged=tuple(sorted(confirmed)), silent=tuple(sorted(silent - confirmed))
    )
    note = "" if wanted.nodes else f"only devices that are named ({wanted.bus}#1-6) or known can acknowledge"
    facts = _facts(wanted.bus, "this process", outcome, note)
    if opening.family.link.only is None and not asked_all:
        _count_others(facts, wanted, all_known=bool(wanted.nodes))
    return facts


def _meet(opening: Bus, wanted: Wanted, output: Output) -> tuple[MotorbusError | None, bool]:
    """Where a device can be stopped only at a place that is known, ask it, or everyone, where it is.

    The error where everyone was asked and that failed: whoever is named is stopped all the same. And whether every
    device of the bus was asked.
    """
    needs = [request.reports_position for request in opening.driver.stop({ANYBODY: None}).requests]
    if not needs or not all(needs):
        return None, False
    _ask_where(opening, wanted.nodes)
    called = faces.offer(opening.family.name, "ping_everyone")
    try:
        found = called(opening) if called and wanted.others else ()
        found = found or (() if wanted.nodes else everyone(wanted.bus, opening, (), output))
    except MotorbusError as error:
        return error, False
    _ask_where(opening, [node for node in dict.fromkeys(found) if node not in wanted.nodes])
    return None, wanted.others


def _ask_where(opening: Bus, nodes: Iterable[int]) -> None:
    for node in nodes:
        for request in opening.driver.stop({node: None}).requests:
            with suppress(MotorbusError):  # the stop itself will say who is silent
                opening.run(request)


def _confirms(opening: Bus, node: int) -> bool:
    """Stop this node, up to `TRIES` times; whether it has acknowledged."""
    return any(_stop_node(opening, node) for _ in range(TRIES))


def _stop_node(opening: Bus, node: int) -> bool:
    """Send this node what its family stops it with; has it acknowledged?"""
    answers = []
    requests = opening.driver.stop({node: None}).requests
    for request in (one for one in requests if one.effect is not Effect.NONE):
        try:
            opening.run(request)
        except MotorbusError:
            answers.append(False)
        else:
            answers += [True] if request.expected else []  # nobody answers what is said to everyone
    return bool(answers) and all(answers)


def _stop_each(
    wanted: list[Wanted], options: dict[str, str], output: Output, failures: list[MotorbusError]
) -> list[dict[str, Any]]:
    """Several buses one after the other; one that is out of reach keeps nobody waiting, and is told in `failures`."""
    stops = []
    for one in wanted:
        try:
            stops.append(_stop(one, options, output))
        except MotorbusError as error:
            failures.append(error)
            stops.append(_failed(one.bus, "this process", error))
    return stops


def _stop_open(
    wanted: list[Wanted],
    options: dict[str, str],
    stops: list[dict[str, Any]],
    failures: list[MotorbusError],
    *,
    everything: bool,
) -> list[dict[str, Any]]:
    """Stop every bus that a motorbus process holds and `wanted` does not name; append what came of each to `stops`.

    Returns the simulated buses, which are left alone unless `everything` is asked for. Puts those in `wanted` that are
    held before those that are to be opened.
    """
    from motorbus.link.lock import holders, is_simulated, real_name

    owners = {real_name(owner.port): owner for owner in holders()}
    wanted.sort(key=lambda one: _port(one.bus, options) not in owners)
    left: list[dict[str, Any]] = []
    for port in owners.keys() - {_port(one.bus, options) for one in wanted}:
        owner = owners[port]
        by = f"process {owner.pid} ({owner.program})"
        if is_simulated(owner.port) and not everything:
            left.append({"bus": owner.port, "by": by, "simulated": True})
            continue
        try:
            stops.append(_facts(owner.port, by, _ask(owner.port, owner)))
        except MotorbusError as error:
            failures.append(error)
            stops.append(_failed(owner.port, by, error))
    return left


def _nothing_to_stop(left: list[dict[str, Any]]) -> RequestError:
    if left:
        listed = ", ".join(f"{one['bus']} (simulated, held by {one['by']})" for one in left)
        return RequestError(
            f"no bus on a real port is open; not stopped: {listed}",
            advice="`motorbus estop --all` stops simulated buses too; nothing was sent",
        )
    return RequestError(
        "no motorbus process holds a bus",
        expected="BUS, as feetech:/dev/ttyACM0",
        advice="name the bus, and it is opened and stopped from here",
    )


def _port(bus: str, options: dict[str, str]) -> str:
    """The real name of its port; "" for an address or options that cannot be, as the stop itself will say."""
    from motorbus import session
    from motorbus.link.lock import real_name

    try:
        return real_name(session.lock_name(bus, said(options)))
    except RequestError:
        return ""


def _count_others(facts: dict[str, Any], wanted: Wanted, *, all_known: bool) -> None:
    """Add which devices of the machine file were not asked, and what was sent to all that were not."""
    broadcast = any(not request.expected for request in wanted.family.open().stop({}).requests)
    facts["not_asked"] = sorted({*axes_at(wanted.bus)} - {*facts["acknowledged"], *facts["silent"]})
    facts["others"] = "not asked, broadcast sent" if broadcast else "not asked, no stop sent"
    if facts["acknowledged"] and (facts["not_asked"] or not all_known):
        facts["outcome"] = "acknowledged by some"


def _failed(bus: str, by: str, error: MotorbusError) -> dict[str, Any]:
    heard = {"acknowledged": [], "silent": [], "not_asked": [], "others": "", "promise": "", "note": ""}
    return {"bus": bus, "by": by, "outcome": "failed", **heard, "error": error.summary}


def _facts(bus: str, by: str, outcome: StopOutcome, note: str = "") -> dict[str, Any]:
    """What came of one stop, as plain data. A promise is one of those who acknowledged; nobody, no promise."""
    some = "acknowledged by some" if outcome.silent else ALL
    reached = some if outcome.acknowledged else "acknowledged by nobody"
    return {
        "bus": bus,
        "by": by,
        "outcome": reached if outcome.rounds else "failed",
        "acknowledged": sorted(outcome.acknowledged),
        "silent": sorted(outcome.silent),
        "not_asked": [],
        "others": "",
        "promise": outcome.promise if outcome.acknowledged else "",
        "note": note,
        "error": "" if outcome.rounds else "no stop was sent",
    }


def _list(nodes: list[int], nothing: str = "none") -> str:
    return ", ".join(f"#{node}" for node in nodes) or nothing


def _verdict(stops: list[dict[str, Any]], broken: RequestError | None, failures: list[MotorbusError]) -> Exit:
    failed = [f"{one['bus']}: {one['error']}" for one in stops if one["error"]]
    missing = [one for one in stops if not one["error"] and one["outcome"] != ALL]
    silent = [f"{one['bus']}: {_missing(one)}" for one in missing]
    told = "; ".join([*failed, *silent, *([broken.summary] if broken is not None else [])])
    if failed and len(failed) == len(stops):
        raise _all_failed(failures, told)
    if not any(one["acknowledged"] for one in stops):
        raise NoReply(told, advice=BY_HAND)
    if told:
        unasked = not any(one["silent"] or not one["acknowledged"] for one in missing)
        by_hand = [NAME_THEM if unasked and not failed else BY_HAND] if failed or silent else []
        of_file = [MEND] if broken is not None else []
        raise Partial(told, advice="; ".join([*by_hand, *of_file]))
    return Exit.OK


def _missing(one: Mapping[str, Any]) -> str:
    if one["acknowledged"] and not one["silent"]:
        return "; ".join(_others(one))
    why = f" ({one['note']})" if one["silent"] and one["note"] else ""
    return f"no acknowledgement from {_list(one['silent'], 'any device')}{why}"


def _all_failed(failures: list[MotorbusError], told: str) -> MotorbusError:
    """The first of the errors, whose exit code it is as with `motorbus stop`, and in its summary all that happened."""
    first = failures[0]
    first.summary = told if len(failures) > 1 else first.summary
    if not isinstance(first, RequestError) and "cut " not in first.advice:
        first.advice = f"{first.advice}; {BY_HAND}" if first.advice else BY_HAND
    return first
