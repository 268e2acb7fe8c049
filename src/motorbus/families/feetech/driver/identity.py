"""Whether a servo is there, what it is, how it is set, and whether it is alone; the scan of a line.

The register map follows from firmware and byte order; the model gives the name and the byte order (algorithm of FD
1.9.8.5). A servo of an unknown map is read by the rows that all maps share, and never written: the same address is the
lock in one map and the torque limit in another.

A scan reads each id in order: every servo answers READ, and boards exist that lack PING. A broadcast PING is not used:
the replies of servos with one return delay collide, SCS do not answer it, and its window is 0.8 s. A silent id is asked
once. A reply that comes late disturbs the request to the next id, so both are identified then, with the normal
time-out. A servo at another rate is silent.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Final, NamedTuple

from motorbus.core.family import Found, Identity
from motorbus.core.register import Access, RegisterMap, changed
from motorbus.core.request import Expected, Request, Response, TimeoutClass
from motorbus.core.scan import scan_rates
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, Sleep, catch
from motorbus.errors import DeviceError, LinkError, NoReply, RequestError, WireError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver.node import IMAGE, BusFacts, Node, Settings, as_nodes, settings_of
from motorbus.families.feetech.driver.requests import STORE, read_block, read_id
from motorbus.families.feetech.models import Choice, choose, model_number
from motorbus.families.feetech.registers import STS, TABLES

ALONE: Final = 12  # reads that show two servos with one id; 4 of 10 short reads were garbled (servolab)
SILENCE: Final = 1.0
"""s without a reply after which settings are read again: another servo may be there by now."""
DRAIN: Final = 0.02  # s of quiet at a new rate: a servo may answer what it has buffered (feetech-cli)
COMMON: Final = frozenset(
    (
        *("firmware_major", "firmware_minor", "byte_order", "model_major", "model_minor", "id", "baud_rate"),
        *("status_return_level", "min_position_limit", "max_position_limit", "max_temperature"),
        *("max_voltage", "min_voltage", "max_torque", "phase", "unload_mask", "led_mask"),
        *("position_p", "position_d", "dead_band_cw", "dead_band_ccw"),
        *("torque_enable", "goal_position", "goal_velocity", "present_position", "present_velocity"),
        *("present_load", "present_voltage", "present_temperature", "reg_write_pending"),
        *("hardware_error", "moving"),
    )
)
"""Rows that mean the same in every map. Source: FD 1.9.8.5 and the SDK headers."""


class ScanWarning(NamedTuple):
    """An event: a user should check this id at this rate (bit/s)."""

    node: int
    rate: int
    what: str


async def ping(node: Node) -> bool:
    """Whether it answers. Raises WireError for bytes that are no reply."""

    def decode(answer: Response) -> None:
        node.note_reply(answer.replies[0].data[4], answer.at)

    expected = Expected(node.node, node.node, protocol.OVERHEAD)
    try:
        await Request(protocol.ping(node.node), (expected,), decode, repeatable=True)
    except NoReply:
        return False
    return True


def identify(node: Node) -> Request[Identity]:
    """Read identity, limits, mode and units, registers 0 to 39, in one READ."""
    return read_block(node, 0, IMAGE, lambda image: learn(node, image))


async def known(node: Node) -> RegisterMap:
    """Its register map; it is read unless its settings are known and it has answered in the last second."""
    silent = await Sleep(0) - node.known.at > SILENCE
    if node.table is None or node.settings is None or silent:
        await identify(node)
    assert node.table is not None
    return node.table


async def writable(node: Node) -> RegisterMap:
    """As `known`. Raises DeviceError for an unknown map."""
    table = await known(node)
    check_map(node)
    return table


async def read_settings(node: Node) -> RegisterMap:
    """As `writable`, with settings that are read now: another program may have changed them."""
    await identify(node)
    return await writable(node)


def check_map(node: Node) -> None:
    """Raise DeviceError for a servo of an unknown map."""
    if not node.is_writable:
        raise unknown_map(node)


def learn(node: Node, image: bytes) -> Identity:
    """Take registers 0 to 39 of this servo."""
    chosen = choose((image[0], image[1]), (image[3], image[4]), image[2])
    found = node.known
    if chosen.table:
        found.table = TABLES[chosen.table]
        arc = node.facts.arcs.get(node.node, chosen.model.arc if chosen.model else None)
        settings = settings_of(found.table, image, arc)
    else:
        found.table = common_table(chosen.order)
        settings = Settings()
    if "second_id" in found.table:
        found.second_id = image[found.table["second_id"].address]
    found.identity = _identity(node, chosen, image, settings)
    found.learn(settings)
    return found.identity


def _identity(node: Node, chosen: Choice, image: bytes, settings: Settings) -> Identity:
    major, minor = image[3], image[4]
    details: dict[str, object] = {
        "model_number": model_number(major, minor, chosen.order),
        "byte_order": chosen.order,
        "register_map": chosen.table or "unknown",
        "writable": bool(chosen.table),
    }
    if chosen.table:
        details["mode"] = settings.mode.value if settings.mode else f"unknown ({settings.mode_code})"
        details["arc"] = settings.arc
        if chosen.model is not None and chosen.model.arc_doubt and node.node not in node.facts.arcs:
            details["arc_doubt"] = chosen.model.arc_doubt
    name = chosen.model.name if chosen.model else f"unknown model {major}.{minor}"
    return Identity(node.node, name, f"{image[0]}.{image[1]}", chosen.table, details)


@cache
def common_table(order: str) -> RegisterMap:
    """The rows that all maps share, read-only; a unit that differs between maps is left out."""
    rows = [
        changed(row, access=Access.READ, order=order)
        if row.unit in ("V", "°C", "fraction")
        else changed(row, access=Access.READ, order=order, unit="", scale=1.0)
        for row in STS.values()
        if row.name in COMMON
    ]
    return RegisterMap("common", rows, title="what all FEETECH register maps share; read-only")


def unknown_map(node: Node) -> DeviceError:
    """The error for what needs a register map that the firmware of this servo does not tell."""
    identity = node.identity
    assert identity is not None
    return DeviceError(
        f"node {node.node} is {identity.model} with firmware {identity.firmware}, whose register map is unknown: "
        "its values have no known unit, and nothing is written",
        expected=f"a servo with one of the maps {', '.join(sorted(TABLES))}",
        cause="the same address means different things in different maps",
        advice="read() gives the registers that all maps share; disable_torque() works",
        node=node.node,
    )


async def check_alone(node: Node) -> bytes:
    """Registers 0 to 39. Raises RequestError if two servos seem to have this id: their replies collide or differ."""
    images: set[bytes] = set()
    garbled = 0
    for _ in range(ALONE):
        try:
            images.add(await read_block(node, 0, IMAGE, bytes, timeout=STORE))
        except WireError:
            garbled += 1
    if len(images) == 1 and garbled < 2:
        return images.pop()
    raise RequestError(
        f"two servos seem to have the id {node.node}: of {ALONE} replies {garbled} were garbled, "
        f"{len(images)} different",
        cause="new servos all have the id 1; noise and a loose cable look alike",
        advice="connect one servo at a time",
        node=node.node,
    )


# -- scan ------------------------------------------------------------------------------------------------------


async def scan(
    ids: Sequence[int] = (), rates: Sequence[int] = (), facts: BusFacts | None = None
) -> list[Found]:
    """All servos that answer, with their identity; () means all ids, or the present rate, which is restored.

    Reports `Found` when one answers, `Progress`, a `ScanWarning` where two servos seem to share an id, and `Skipped`
    for a rate that the adapter lacks. Writes nothing.
    """
    nodes = [Node(node.node, facts) for node in as_nodes(ids or range(protocol.MAX_ID + 1))]
    if rates:
        return await Exclusive(scan_rates(rates, partial(_scan_rate, nodes)))
    return await _scan_rate(nodes, await SetBitrate(0))


async def _scan_rate(nodes: Sequence[Node], rate: int) -> list[Found]:
    await Sleep(DRAIN)
    answering: set[int] = set()
    doubtful: set[int] = set()
    for done, node in enumerate(nodes, 1):
        try:
            await read_id(node.node, within=TimeoutClass.SCAN)
        except NoReply:
            pass
        except WireError:
            doubtful |= {node.node, node.node - 1}
        else:
            answering.add(node.node)
            await Emit(Found(node.node, rate, None))
        await Emit(Progress(done, len(nodes), f"id {node.node} at {rate} bit/s"))
    suspects = [node for node in nodes if node.node in answering | doubtful]
    found = [await _identify_found(node, rate, sure=node.node in answering) for node in suspects]
    return [one for one in found if one is not None]


async def _identify_found(node: Node, rate: int, *, sure: bool) -> Found | None:
    """What answers, None for nothing; reports a suspected second servo."""
    identity = await catch(identify(node))
    if isinstance(identity, NoReply) and not sure:
        return None
    alone = await catch(check_alone(node))
    for result in (identity, alone):
        if isinstance(result, LinkError):
            raise result
    if isinstance(alone, RequestError):
        await Emit(ScanWarning(node.node, rate, alone.summary))
    return Found(node.node, rate, identity if isinstance(identity, Identity) else None)
