"""One verb for every device that was named: all are visited whatever happens to some, and all are told of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motorbus.cli.exits import Exit, Partial
from motorbus.cli.target import able, everyone, face, gathered, opened
from motorbus.errors import LinkError, MotorbusError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.bus.pump import Bus
    from motorbus.cli.output import Output


def each(what: str, verb: str, devices: tuple[str, ...], options: Mapping[str, str], output: Output) -> Exit:
    """Carry out `verb` on every device. Raises the only error there was, or Partial when some did as asked."""
    results: dict[tuple[str, int], MotorbusError | None] = {}
    for name, nodes in gathered(devices).items():
        with opened(name, options, output) as bus:
            for node in everyone(bus, nodes):
                results[name, node] = _tried(bus, node, verb)
    rows = [
        {"bus": bus, "id": node, "done": error is None, **({"error": error.summary} if error else {})}
        for (bus, node), error in results.items()
    ]
    output.document(f"motorbus.{verb}/1", {"devices": rows})
    shown = [(f"{row['bus']}#{row['id']}", what if row["done"] else row["error"]) for row in rows]
    output.table("", ["device", "result"], shown)
    return _verdict([error for error in results.values() if error], len(results))


def _tried(bus: Bus, node: int, verb: str) -> MotorbusError | None:
    try:
        able(face(bus, node), verb)()
    except LinkError:
        raise
    except MotorbusError as error:
        return error
    return None


def _verdict(errors: list[MotorbusError], visited: int) -> Exit:
    if not errors:
        return Exit.OK
    if len(errors) == visited:
        raise errors[0]
    raise Partial("; ".join(error.summary for error in errors))
