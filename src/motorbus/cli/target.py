"""From the words BUS and BUS#ID, or from names of the machine file, to an open bus and its devices; what all share.

Whatever can be refused without the port is refused before the port is opened.
"""

from __future__ import annotations

import inspect
import logging
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

from motorbus import families
from motorbus.cli import faces
from motorbus.cli.estops import with_estops
from motorbus.cli.fenced import fenced
from motorbus.cli.machine import addresses
from motorbus.cli.traced import traced
from motorbus.cli.wording import in_words_of_the_shell, shell_words
from motorbus.core.steps import Progress
from motorbus.errors import DeviceError, MotorbusError, NoReply, RequestError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from motorbus.bus.blocking import Bus
    from motorbus.cli.dry import DryBus
    from motorbus.cli.output import Output
    from motorbus.core.family import Family
    from motorbus.core.register import RegisterMap


LOG = logging.getLogger("motorbus.cli")


class Target(NamedTuple):
    """A bus by its address, its family, and the nodes named on it; () when none was named and there may be many."""

    bus: str
    family: Family
    nodes: tuple[int, ...]


def target(text: str) -> Target:
    """BUS or BUS#ID or BUS#1-3+7, or a name of the machine file for what is on one bus.

    Where a line has one device only, that is named by naming the bus. Raises RequestError for a bad address, an unknown
    family, an impossible id, a name that is in no file, and a group on several buses.
    """
    first, *more = targets(text)
    if more:
        raise RequestError(
            f"{text} is on {len(more) + 1} buses, and this goes for one",
            expected="a bus, or an axis",
            advice="nothing was sent",
        )
    return first


def targets(text: str) -> list[Target]:
    """The same for what may be on several buses, as a group is. Raises RequestError as `target` does."""
    return [_target(address) for address in addresses(text)]


def _target(text: str) -> Target:
    from motorbus import session

    address = session.parse_address(text)
    family = families.load(address.family)
    for node in address.nodes:
        family.devices.blocking(None, node)  # checks its id when it is made; needs no bus for that
    only = family.link.only
    return Target(address.bus, family, address.nodes or (() if only is None else (only,)))


def device(text: str) -> Target:
    """BUS#ID with exactly one id, or BUS where a line has one device only. Raises RequestError otherwise."""
    found = target(text)
    if len(found.nodes) != 1:
        raise RequestError(
            f"{text}: exactly one device is needed",
            expected=f"BUS#ID, as {found.bus}#1",
            advice="nothing was sent",
        )
    return found


def gathered(texts: Iterable[str]) -> dict[str, tuple[int, ...]]:
    """Several targets by bus, in the order they were named, each node once; () for whom a whole bus was named.

    Raises RequestError for none.
    """
    found: dict[str, dict[int, None]] = {}
    whole: set[str] = set()
    for one in (one for text in texts for one in targets(text)):
        found.setdefault(one.bus, {}).update(dict.fromkeys(one.nodes))
        whole |= set() if one.nodes else {one.bus}
    if not found:
        raise RequestError(
            "which bus?", expected="BUS or BUS#ID, as feetech:/dev/ttyACM0#3, or a name of the machine file"
        )
    return {bus: () if bus in whole else tuple(nodes) for bus, nodes in found.items()}


@contextmanager
def opened(bus: str, options: Mapping[str, str], output: Output) -> Iterator[Bus]:
    """An open bus, closed at the end; says what the user ought to know about the port, and what its operations tell."""
    from motorbus import session
    from motorbus.motion.safety import Gate

    def tell(event: object) -> None:
        say = faces.offer(found.family.name, "say")
        if say is not None and (text := say(event)):
            output.note(f"note: {text}")

    estops = with_estops(bus, said(options))
    with session.open(bus, report=tell, interlock=Gate(), **estops) as found, traced(found):
        output.simulated = output.simulated or found.simulated
        LOG.info("%s is open at %d bit/s", bus, found.rate)
        fenced(found, bus, output)
        for warning in found.warnings:
            output.note(f"note: {shell_words(warning, found.family, bus)}")
        try:
            yield found
        except (MotorbusError, KeyboardInterrupt) as error:
            in_words_of_the_shell(error, found.family, bus)
            raise
        finally:
            for node, counts in sorted(found.statistics.nodes.items()):
                LOG.info("#%d: sent %d, ok %d, retries %d", node, counts.sent, counts.ok, counts.retries)


def said(options: Mapping[str, str]) -> dict[str, str]:
    """Options of the bus string as they were said by flags: --id-format is id_format."""
    return {name.replace("-", "_"): value for name, value in options.items()}


def face(bus: Bus | DryBus, node: int) -> Any:
    """The device with its verbs; what it can do depends on its family."""
    return bus.family.devices.blocking(bus, node)


def able(one: Any, verb: str) -> Any:
    """A verb of a device. Raises RequestError when this kind of device lacks it."""
    try:
        return getattr(one, verb)
    except AttributeError:
        raise _lacks(one.bus.family, verb) from None


def offers(family: Family, verb: str) -> None:
    """Raises RequestError when the devices of this family lack a verb; needs no bus."""
    if not hasattr(family.devices.blocking, verb):
        raise _lacks(family, verb)


def _lacks(family: Family, verb: str) -> RequestError:
    what = "torque switch" if verb.endswith("able_torque") else verb.replace("_", " ")
    return RequestError(f"{family.name} devices have no {what}", advice="nothing was sent")


def takes(one: Any, verb: str, options: Iterable[str]) -> None:
    """Raises RequestError when a verb of this device lacks one of these options."""
    function = getattr(getattr(type(one), verb, None), "function", None) or able(one, verb)
    known = inspect.signature(function).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values()):
        return
    for name in options:
        if name not in known:
            raise RequestError(
                f"the {verb.replace('_', ' ')} of {one.bus.family.name} devices has no {name}",
                advice="leave it out; nothing was sent",
            )


def table_of(one: Any) -> RegisterMap:
    """The register map of a device, by its own firmware. Raises DeviceError when nobody knows it."""
    identity = one.identify()
    tables: Mapping[str, RegisterMap] = one.bus.family.registers
    known: RegisterMap | None = getattr(one, "table", None) or tables.get(identity.table)
    if known is None:
        raise DeviceError(
            f"#{one.node} is {identity.model} with firmware {identity.firmware}, whose registers nobody has described",
            node=one.node,
        )
    return known


def check_names(family: Family, names: Iterable[str]) -> None:
    """Raise RequestError, with suggestions, for a register that no device of this family has."""
    tables = list(family.registers.values())
    for name in names:
        if not any(name in table for table in tables):
            try:
                tables[0][name]
            except RequestError as error:
                error.summary = f"{family.name} devices have no register {name!r}"
                raise


def everyone(name: str, bus: Bus, nodes: tuple[int, ...], output: Output) -> tuple[int, ...]:
    """The nodes that were named, or every node that answers at the present rate. Raises NoReply for none."""
    if nodes:
        return nodes
    with output.progress("looking for devices") as bar:

        def listen(event: object) -> None:
            if isinstance(event, Progress):
                bar.advance(event.done, event.total)
            elif bus.report is not None:
                bus.report(event)  # some families tell what they send to find anybody

        found = bus.run(bus.driver.scan(), report=listen)
    if not found:
        raise nobody(name)
    return tuple(one.node for one in found)


def nobody(bus: str) -> NoReply:
    """The error for a bus on which nobody answered."""
    family = target(bus).family
    cause, advice = (
        "no power, or a loose cable",
        "see to the power and the cable, and that this is the right port",
    )
    if len(family.link.rates) > 1:
        cause = "no power, a loose cable, or devices set to another rate"
        advice = f"`motorbus scan {bus} --{rate_word(family)} all` looks for every id at every rate"
    return NoReply(f"{bus}: no device answers", cause=cause, advice=advice)


def rate_word(family: Family) -> str:
    """What the rate of such a bus is called, in its options and in flags."""
    return "baud" if family.link.kind == "bytes" else "bitrate"


def id_shown(node: int, family: Family) -> str:
    """An id as people of this family know it: on CAN in hexadecimal too, for so it stands in every identifier."""
    return str(node) if family.link.kind == "bytes" else f"{node} (0x{node:02X})"
