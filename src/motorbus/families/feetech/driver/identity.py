"""Who is there: is it alive, what is it, which register map has it, and how is it set.

The map follows from firmware and byte order, the model gives the name and the byte order (the algorithm of the
vendor's FD 1.9.8.5). A servo whose map is known is read and written by that map. One whose map is unknown is read by
the few rows that all maps share, and never written. A map is never guessed: the same address is the lock in one map and
the torque limit in another.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from motorbus.core.family import Identity
from motorbus.core.register import Access, Register, RegisterMap, changed
from motorbus.core.request import Expected, Priority, Request, TimeoutClass
from motorbus.errors import DeviceError, NoReply
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import ACKNOWLEDGED, acknowledged, read_block
from motorbus.families.feetech.driver.node import IMAGE, Node, Settings, settings_of
from motorbus.families.feetech.table import STS, TABLES, Choice, choose, model_number

_HEAD: Final = 5
_COMMON: Final = frozenset(
    (
        *("firmware_major", "firmware_minor", "byte_order", "model_major", "model_minor", "id", "baud_rate"),
        *(
            "status_return_level",
            "min_position_limit",
            "max_position_limit",
            "max_temperature",
            "max_voltage",
        ),
        *("min_voltage", "max_torque", "phase", "unload_mask", "led_mask", "position_p", "position_d"),
        *("dead_band_cw", "dead_band_ccw", "torque_enable", "goal_position", "goal_velocity"),
        *("present_position", "present_velocity", "present_load", "present_voltage", "present_temperature"),
        *("reg_write_pending", "hardware_error", "moving"),
    )
)
"""Rows that mean the same in every map, as far as FD 1.9.8.5 and the SDK headers tell."""
_ONE_UNIT_IN_ALL_MAPS: Final = ("V", "°C", "fraction")


async def ping(node: Node) -> bool:
    """Is it there? Silence is the answer False; bytes that are no answer raise WireError."""
    try:
        await ping_exchange(node)
    except NoReply:
        return False
    return True


def ping_exchange(node: Node, *, scanning: bool = False) -> Request[None]:
    """PING; silence raises NoReply. `scanning` waits shortly and asks once, for silence is usual then."""
    request = acknowledged(node, wire.ping(node.node))
    return Request(
        request.wire,
        (Expected(node.node, node.node, ACKNOWLEDGED),),  # PING is answered at every status return level
        request.decode,
        priority=Priority.CONFIGURATION if scanning else Priority.POLL,
        reply_within=TimeoutClass.SCAN if scanning else TimeoutClass.REPLY,
        repeatable=True,
    )


def identify(node: Node) -> Request[Identity]:
    """Firmware, byte order, model and register map, in one READ of registers 0 to 4."""

    def take(head: bytes) -> Identity:
        return meet(node, head)

    return read_block(node, 0, _HEAD, take)


def prepare(node: Node) -> Request[Identity]:
    """Read whatever motion and prepared group operations need: identity, limits, mode and units, in one READ.

    It is always the same one for a servo, and kept: who polls one that is not there asks it again and again.
    """
    kept = node.preparation
    if kept is None:

        def take(image: bytes) -> Identity:
            return learn(node, image)

        kept = node.preparation = read_block(node, 0, IMAGE, take)
    return kept


async def known(node: Node) -> RegisterMap:
    """The register map of this servo; asks it when its settings are not known yet."""
    if node.table is not None and node.settings is not None:
        return node.table
    identity = await prepare(node)
    if node.table is None:  # who answered stands for a servo and is none, as in a dry run: its answer says so
        return TABLES[identity.table]
    return node.table


async def writable(node: Node) -> RegisterMap:
    """As `known`, for those who will write. Raises DeviceError when the map is not known."""
    table = await known(node)
    refuse_unless_writable(node)
    return table


def refuse_unless_writable(node: Node) -> None:
    """Raise DeviceError for a servo that has been asked, and whose map is not known."""
    if not node.writable:
        raise unknown_map(node, "refuses to write to it")


def meet(node: Node, head: bytes) -> Identity:
    """Registers 0 to 4 of this servo have been read."""
    node.identity = identity_of(node.node, head)
    node.table = TABLES[node.identity.table] if node.identity.table else common_table(_choice(head).order)
    return node.identity


def learn(node: Node, image: bytes) -> Identity:
    """Registers 0 to 39 of this servo have been read."""
    identity = meet(node, image[:_HEAD])
    if identity.table:
        node.settings = settings_of(TABLES[identity.table], image)
    else:
        node.settings = Settings(answers_writes=image[STS["status_return_level"].address] != 0)
    return identity


def identity_of(node: int, head: bytes) -> Identity:
    """What registers 0 to 4 say."""
    chosen = _choice(head)
    major, minor = head[3], head[4]
    return Identity(
        node,
        chosen.model.name if chosen.model else f"unknown model {major}.{minor}",
        f"{head[0]}.{head[1]}",
        chosen.table,
        {
            "model_number": model_number(major, minor, chosen.order),
            "byte_order": chosen.order,
            "register_map": chosen.table or "unknown",
            "writable": bool(chosen.table),
        },
    )


def _choice(head: bytes) -> Choice:
    return choose((head[0], head[1]), (head[3], head[4]), head[2])


@cache
def common_table(order: str) -> RegisterMap:
    """The rows that all register maps share, read-only; what differs between maps in unit is a plain number."""
    return RegisterMap(
        "common",
        [_commoner(row, order) for row in STS.values() if row.name in _COMMON],
        title="what all FEETECH register maps share; nothing may be written",
    )


def _commoner(row: Register, order: str) -> Register:
    if row.unit in _ONE_UNIT_IN_ALL_MAPS:
        return changed(row, access=Access.READ, order=order)
    return changed(row, access=Access.READ, order=order, unit="", scale=1.0)


def unknown_map(node: Node, refusal: str) -> DeviceError:
    """The error for what needs a register map that this servo's firmware does not tell."""
    identity = node.identity
    assert identity is not None
    return DeviceError(
        f"node {node.node} is {identity.model} with firmware {identity.firmware}, whose register map is not "
        f"described: motorbus {refusal}",
        expected=f"a servo with one of the maps {', '.join(sorted(TABLES))}",
        cause="the same address means different things in different maps, so a guess could damage the servo",
        advice="read() the registers that all maps share, or disable_torque(); nothing was written",
        node=node.node,
    )
