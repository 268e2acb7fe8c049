"""What a servo heeds: reading its mode, and changing it such that nothing turns when torque comes on again.

The mode is a setting in EEPROM that takes effect at once, so it is changed on a limp servo, and what the new mode heeds
is set to 0 before anybody switches torque on. SCS have no such register: both limits 0 make a motor of them, and limits
make a servo of it again. Source: STS3215 memory table V3.6; FEETECH SDK, SCSCL.h and hls.py; feetech-cli, measured on
STS3215.
"""

from __future__ import annotations

from collections.abc import Sequence

from motorbus.core.register import RegisterMap
from motorbus.core.request import Effect
from motorbus.errors import RequestError
from motorbus.families.feetech.driver import eeprom
from motorbus.families.feetech.driver.bound import leaving_current_mode
from motorbus.families.feetech.driver.exchanges import Block
from motorbus.families.feetech.driver.identity import prepare, writable
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.rest import at_rest, ordered, unknown_mode, unpublished_duty
from motorbus.families.feetech.driver.torque import disable_torque
from motorbus.families.feetech.table import Mode


async def mode(node: Node) -> Mode:
    """What the servo heeds now, asked anew: position, velocity, pwm, step or current.

    Raises DeviceError when its register map is not known, RequestError for a mode that no source explains.
    """
    await prepare(node)
    await writable(node)
    if node.known_mode is None:
        raise unknown_mode(node)
    return node.known_mode


async def set_mode(node: Node, mode: Mode | str, *, limits: tuple[float, float] | None = None) -> None:
    """Put the servo into a mode, for good; it is limp afterwards, and `enable_torque` begins at rest. The mode that it
    has already is not written again.

    Every map has position and PWM mode; STS and SMBL have velocity and step mode too, SMCL velocity mode, HLS velocity
    and current mode. On SCS PWM mode is both limits 0, and position mode needs `limits` in rad, unless it was this
    object that set them to 0. An HLS that leaves current mode is bounded by its protection current again. Raises
    RequestError for a mode or limits that the map does not have, for PWM mode of HLS, whose duty no source places, and
    errors of a guarded write to EEPROM.
    """
    wanted = _named(mode)
    await prepare(node)
    table = await writable(node)
    if wanted not in node.control.has:
        raise _lacking(node, wanted)
    if wanted is Mode.PWM and not node.control.duty:
        raise unpublished_duty(node)
    blocks = (
        _by_code(node, table, wanted, limits)
        if node.control.modes
        else _by_limits(node, table, wanted, limits)
    )
    if not await eeprom.store(node, table, leaving_current_mode(node, table, wanted, blocks)):
        await disable_torque(node)
    await prepare(node)
    if wanted in (Mode.VELOCITY, Mode.PWM, Mode.CURRENT):
        await ordered(node, table, at_rest(node, table, wanted))


def _named(mode: Mode | str) -> Mode:
    try:
        return Mode(mode)
    except ValueError:
        raise RequestError(
            f"{mode!r} is no mode",
            expected=", ".join(one.value for one in Mode),
            advice="nothing was sent",
        ) from None


def _by_code(
    node: Node, table: RegisterMap, wanted: Mode, limits: tuple[float, float] | None
) -> Sequence[Block]:
    if limits is not None:
        raise RequestError(
            f"node {node.node} has an operating mode, which limits do not change",
            advice="leave limits out, or write(min_position_limit=…, max_position_limit=…); nothing was sent",
            node=node.node,
        )
    code = node.control.code(wanted)
    assert code is not None
    row = table["operating_mode"]
    return [Block(row.address, row.encode(code), Effect.PERSISTENT)]


def _by_limits(
    node: Node, table: RegisterMap, wanted: Mode, limits: tuple[float, float] | None
) -> Sequence[Block]:
    """Both limits 0 for a motor; limits for a servo, which nobody makes up: a wrong one breaks what it moves."""
    low, high = table["min_position_limit"], table["max_position_limit"]
    if wanted is Mode.PWM:
        if node.limits is not None:
            node.former_limits = node.limits
        raws = 0, 0
    else:
        wished = limits or node.limits or node.former_limits
        if wished is None:
            raise _limits_wanted(node, table)
        raws = node.raw(low, wished[0]), node.raw(high, wished[1])
        if not raws[0] < raws[1]:
            raise RequestError(
                f"node {node.node}: limits {wished[0]} to {wished[1]} rad are none",
                expected="the lower one first",
                advice="nothing was sent",
                node=node.node,
            )
    return [Block(low.address, low.encode(raws[0]) + high.encode(raws[1]), Effect.PERSISTENT)]


def _limits_wanted(node: Node, table: RegisterMap) -> RequestError:
    rows = table["min_position_limit"], table["max_position_limit"]
    shipped = [f"{row.to_value(row.default):.4g}" for row in rows if row.default is not None]
    return RequestError(
        f"node {node.node} becomes a servo again by its limits, and nobody here knows which",
        expected="limits=(low, high), in rad" + (f"; shipped are {' to '.join(shipped)}" if shipped else ""),
        advice="give limits that what it moves can bear; nothing was sent",
        node=node.node,
    )


def _lacking(node: Node, wanted: Mode) -> RequestError:
    return RequestError(
        f"node {node.node} has no {wanted.value} mode",
        expected=" or ".join(one.value for one in node.control.has),
        advice="nothing was sent",
        node=node.node,
    )
