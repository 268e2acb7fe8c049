"""REG WRITE to several servos and one ACTION for all: everyone begins in the same instant, or nobody moves.

Unlike a SYNC WRITE each servo acknowledges what it was handed, and each may get other registers. ACTION leaves only
when every one has acknowledged, and none of them tells an alarm; otherwise what was handed over is taken back.

No instruction empties the buffer of a servo. What waits is replaced by something that does nothing: the EEPROM lock is
closed, as it is in any case. Nobody has published whether a second REG WRITE replaces the first one or is dropped, so
that is a switch (`replaces`), and what was taken back is also refused at ACTION from here. Source: FEETECH serial bus
servo protocol manual V1.01, 1.3.4 and 1.3.5, which say that one waits until ACTION, and nothing of a second.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple, TypeVar

from motorbus.core.register import RegisterMap, Value
from motorbus.core.setpoint import Deferred
from motorbus.core.steps import Exclusive, catch, with_cleanup
from motorbus.errors import DeviceError, MotorbusError, RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import Block, acknowledged
from motorbus.families.feetech.driver.group import RATE, distinct, prepare_all
from motorbus.families.feetech.driver.identity import refuse_unless_writable
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.orders import check_values
from motorbus.families.feetech.driver.registers import IDLE, action_all, hand_over, to_hand_over, waits

One = TypeVar("One", bound=int | Node)

_CLOSED: Final = b"\1"


class _Share(NamedTuple):
    """What one servo is to be handed."""

    node: Node
    table: RegisterMap
    block: Block


async def reg_write_all(
    values: Mapping[One, Mapping[str, Value]],
    *,
    rate: int = RATE,
    despite_alarms: bool = False,
    replaces: bool = True,
) -> None:
    """REG WRITE to each of these, `{id or servo: {name: value}}` in API units, then ACTION for all: all or nothing.

    Raises what the first of them raises that is silent, refused, or does not acknowledge (OutcomeUnknown): ACTION is
    not sent then, and what the others hold is taken back. A note says whose could not be. DeviceError when one
    acknowledges with an alarm, unless `despite_alarms`. `replaces` says that a second REG WRITE replaces the first one;
    without it RequestError when one waits already, before anything is sent, and after a failure what waits is gone only
    after a power cycle. ACTION itself nobody acknowledges. `rate` is that of the bus in bit/s.
    """
    for orders in values.values():
        check_values(orders)
    nodes = distinct(values)
    errors = await prepare_all(nodes, rate=rate)
    if errors:
        raise next(iter(errors.values()))
    shares = [_share(node, orders) for node, orders in zip(nodes, values.values(), strict=True)]
    await Exclusive(_all_or_nothing(shares, despite_alarms=despite_alarms, replaces=replaces))


def _share(node: Node, orders: Mapping[str, Value]) -> _Share:
    refuse_unless_writable(node)
    assert node.table is not None
    block = to_hand_over(node, node.table, orders)._replace(under=node.settings)
    return _Share(node, node.table, block)


async def _all_or_nothing(shares: Sequence[_Share], *, despite_alarms: bool, replaces: bool) -> None:
    handed: list[_Share] = []
    trouble: list[BaseException] = []
    if not replaces:
        for node, table, _ in shares:
            await _nothing_waits(node, table)
    await with_cleanup(
        _released(shares, handed, trouble, despite_alarms), lambda: _taken_back(handed, trouble, replaces)
    )


async def _released(
    shares: Sequence[_Share], handed: list[_Share], trouble: list[BaseException], despite_alarms: bool
) -> None:
    try:
        for share in shares:
            handed.append(share)
            await hand_over(*share)
            if share.node.alarm and not despite_alarms:
                raise _alarmed(share.node)
        await action_all([share.node for share in shares])
    except BaseException as error:
        trouble.append(error)
        raise


async def _nothing_waits(node: Node, table: RegisterMap) -> None:
    if await waits(node, table) != IDLE:
        raise RequestError(
            f"a REG WRITE waits in node {node.node} already, and may not be replaced by another one",
            expected="servos in which nothing waits",
            cause="it was handed over before, from here or by another program",
            advice="action() carries it out, a power cycle forgets it; nothing was sent",
            node=node.node,
        )


def _alarmed(node: Node) -> DeviceError:
    return DeviceError(
        f"node {node.node} tells an alarm ({', '.join(node.alarm)}), so it may not move with the others",
        expected="an acknowledgement without an alarm",
        advice="alarms() says what it means, despite_alarms=True moves them all the same; no ACTION was sent",
        node=node.node,
    )


async def _taken_back(handed: Sequence[_Share], trouble: list[BaseException], replaces: bool) -> None:
    """Visit everyone who may hold something, whatever happens to some, once something went wrong."""
    if not trouble:
        return
    left = []
    for share in handed:
        _withdraw(share.node)
        failure = await catch(_harmless(share)) if replaces else None
        if isinstance(failure, MotorbusError) or not replaces:
            left.append(str(share.node.node))
    if left:
        trouble[0].add_note(
            f"what servo {', '.join(left)} was handed may wait there still, and whoever sends ACTION lets it go: "
            "a power cycle forgets it"
        )


def _withdraw(node: Node) -> None:
    """From here it is not released any more, whatever the servo makes of a second REG WRITE."""
    if node.pending is not None:
        node.pending = node.pending._replace(withdrawn=True)


async def _harmless(share: _Share) -> None:
    """Put in its place what does nothing. Said again when it is not acknowledged, for twice is as good as once."""
    block = Block(share.table["lock"].address, _CLOSED)
    request = wire.reg_write(share.node.node, block.address, block.data)
    later = Deferred(share.node.node)
    await acknowledged(share.node, request, block, refusal=lambda _: None, later=later)
