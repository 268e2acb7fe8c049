"""From the words BUS and BUS#ID to an open bus and its devices; what all commands share."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

from motorbus.errors import NoReply, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from motorbus.bus.pump import Bus
    from motorbus.cli.output import Output


class Target(NamedTuple):
    """A bus as the user wrote it, and the nodes named on it; () when none was named."""

    bus: str
    nodes: tuple[int, ...]


def target(text: str) -> Target:
    """BUS or BUS#ID or BUS#1-3+7. Raises RequestError when it is neither."""
    from motorbus import session

    address = session.parse_address(text)
    return Target(text.partition("#")[0], address.nodes)


def device(text: str) -> tuple[str, int]:
    """BUS#ID with exactly one id. Raises RequestError otherwise."""
    found = target(text)
    if len(found.nodes) != 1:
        raise RequestError(
            f"{text}: exactly one device is needed", expected=f"{found.bus}#ID, as {found.bus}#1"
        )
    return found.bus, found.nodes[0]


def gathered(texts: Iterable[str]) -> dict[str, tuple[int, ...]]:
    """Several targets by bus, in the order they were named, each node once."""
    found: dict[str, dict[int, None]] = {}
    for one in map(target, texts):
        found.setdefault(one.bus, {}).update(dict.fromkeys(one.nodes))
    return {bus: tuple(nodes) for bus, nodes in found.items()}


@contextmanager
def opened(bus: str, options: Mapping[str, str], output: Output) -> Iterator[Bus]:
    """An open bus, closed at the end; says what the user ought to know about the port."""
    from motorbus import session

    with session.open(bus, **options) as found:
        output.simulated = output.simulated or found.link.simulated
        for warning in found.link.warnings:
            output.note(f"note: {warning}")
        yield found


def face(bus: Bus, node: int) -> Any:
    """The device with its verbs; what it can do depends on its family."""
    return bus.family.devices.blocking(bus, node)


def able(one: Any, verb: str) -> Any:
    """A verb of a device. Raises RequestError when this kind of device lacks it."""
    try:
        return getattr(one, verb)
    except AttributeError:
        raise RequestError(
            f"{one.bus.family.name} devices have no {verb.replace('_', ' ')}", advice="nothing was sent"
        ) from None


def everyone(bus: Bus, nodes: tuple[int, ...]) -> tuple[int, ...]:
    """The nodes that were named, or every node that answers at the present rate."""
    if nodes:
        return nodes
    found = tuple(one.node for one in bus.run(bus.family.scan()))
    if not found:
        raise nobody(bus)
    return found


def nobody(bus: Bus) -> NoReply:
    """The error for a bus on which nobody answered."""
    return NoReply(
        f"{bus.link.name}: no device answers at {bus.link.rate} bit/s",
        cause="no power, a loose cable, or devices set to another rate",
        advice=f"`motorbus scan {bus.family.name}:{bus.link.name} --baud all` looks at every rate",
    )
