"""One verb for every device that was named: all are visited whatever happens to some, and all are told of."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Any, Final

from motorbus.cli import faces
from motorbus.cli.dry import DryBus, show
from motorbus.cli.exits import Exit, Partial
from motorbus.cli.machine import axes_at, axes_called, is_address, name_of
from motorbus.cli.target import able, everyone, face, gathered, offers, opened, target
from motorbus.cli.wording import in_words_of_the_shell
from motorbus.errors import LinkError, MotorbusError, PortBusy

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output

    Look = Callable[[Sequence[dict[str, Any]], Mapping[str, str], Output], list[MotorbusError]]


BROADCAST: Final = "torque off was broadcast to every device on the bus; no device acknowledges a broadcast"


def each(
    what: str,
    verb: str,
    devices: tuple[str, ...],
    options: Mapping[str, str],
    output: Output,
    *,
    dry_run: bool = False,
    look: Look | None = None,
) -> Exit:
    """Carry out `verb` on every device. Raises the only error there was, or Partial when some did as asked.

    Where a family has no such verb nothing is opened: RequestError. A bus that fails keeps nobody on another waiting. A
    bus that is called by its name means its axes in the file, and its address every device that answers. Where one
    broadcast does it, a whole bus gets that first and is not scanned. A dry run shows what would be sent, and sends
    none of it. `look` is asked when every device was visited:
    what it finds wrong with what was achieved is raised before anything else.
    """
    results: list[dict[str, Any]] = []
    errors: list[MotorbusError] = []
    wanted, called = gathered(devices), axes_called(devices)
    for name in wanted:
        offers(target(name).family, verb)
    for name, nodes in wanted.items():
        everyone_at_once = None if nodes else faces.offer(target(name).family.name, f"{verb}_everyone")
        expected = nodes or tuple(node for bus, node in called if bus == name)
        if everyone_at_once is not None and not expected:
            called |= {(name, node): axis for node, axis in axes_at(name).items()}
            expected = tuple(node for bus, node in called if bus == name)
        there: list[dict[str, Any]] = []
        try:
            with opened(name, options, output) as bus:
                rehearsal = DryBus(bus)
                if everyone_at_once is not None:
                    (rehearsal.apart() if dry_run else bus).run(everyone_at_once())
                    if any(is_address(word) and target(word).bus == name for word in devices):
                        there.append({"bus": name, "id": None, "done": True, "promise": BROADCAST})
                elif not expected:
                    expected = everyone(name, bus, (), output)
                for node in expected:
                    carrier = rehearsal.apart() if dry_run else bus
                    there.append({"bus": name, "id": node, **_tried(carrier, node, verb, errors)})
                if dry_run:
                    show(rehearsal, output)
        except MotorbusError as error:
            _advise(error, name)
            if len(wanted) == 1 and not there:
                raise
            seen = {one["id"] for one in there}
            rest = tuple(node for node in expected if node not in seen)
            there += _unvisited(name, rest or (None,), error, errors)
        results += [{**one, **_named(called, name, one["id"])} for one in there]
    doubts = look(results, options, output) if look is not None and not dry_run else []
    if not dry_run:
        output.document(f"motorbus.{verb}/1", {"devices": results})
        shown = [(_shown(one), _came_of(one) or what) for one in results]
        output.table("", ["device", "result"], shown)
    if doubts:
        raise with_notes(doubts[0], [*doubts[1:], *errors])
    return _verdict(errors, len(results))


def _advise(error: MotorbusError, bus: str) -> None:
    """Say what reaches the devices of a bus that another process holds."""
    if isinstance(error, PortBusy):
        ends = f", or SIGTERM to process {error.owner}," if error.owner is not None else ""
        error.advice += (
            f". If it is a motorbus command, Ctrl-C there{ends} ends it: its axes stop, and those whose `exit` is "
            f"hold keep their torque; a stepper program runs on; `motorbus estop {name_of(bus)}` stops the bus at "
            "once, and cuts the torque of servos"
        )


def _unvisited(
    bus: str, nodes: tuple[int | None, ...], error: MotorbusError, errors: list[MotorbusError]
) -> list[dict[str, Any]]:
    """What is told of those that a bus keeps out of reach; one entry without an id where nobody knows who is there."""
    errors += [error] * len(nodes)
    return [{"bus": bus, "id": node, "done": False, "error": error.summary} for node in nodes]


def _named(called: Mapping[tuple[str, int], str], bus: str, node: int | None) -> dict[str, str]:
    """The name of the axis, where the device was named by one."""
    return {"axis": called[bus, node]} if node is not None and (bus, node) in called else {}


def _shown(one: Mapping[str, Any]) -> str:
    device = one["bus"] if one["id"] is None else f"{one['bus']}#{one['id']}"
    return f"{one['axis']} ({device})" if "axis" in one else device


def _came_of(one: Mapping[str, Any]) -> str:
    said: str = one.get("error") or one.get("promise") or ""
    return f"{said}; {one['evidence']}" if "evidence" in one else said


def _tried(bus: Bus | DryBus, node: int, verb: str, errors: list[MotorbusError]) -> dict[str, Any]:
    try:
        promise = able(face(bus, node), verb)()
    except LinkError:
        raise
    except MotorbusError as error:
        in_words_of_the_shell(error, bus.family)
        errors.append(error)
        return {"done": False, "error": error.summary}
    return {"done": True, **({"promise": promise.value} if isinstance(promise, Enum) else {})}


def _verdict(errors: Sequence[MotorbusError], visited: int) -> Exit:
    """Raises Partial, or where nobody did as asked the first error, with the others as its notes."""
    if not errors:
        return Exit.OK
    summaries = list(dict.fromkeys(error.summary for error in errors))
    if len(errors) == visited:
        raise with_notes(errors[0], errors[1:])
    advice = "; ".join(dict.fromkeys(error.advice for error in errors if error.advice))
    raise Partial("; ".join(summaries), advice=advice)


def with_notes(first: MotorbusError, others: Sequence[MotorbusError]) -> MotorbusError:
    """The first of several errors, with the others as its notes."""
    for other in dict.fromkeys(error.summary for error in others):
        if other != first.summary:
            first.add_note(f"also: {other}")
    return first
