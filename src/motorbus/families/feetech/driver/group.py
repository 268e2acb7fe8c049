"""Many servos in one packet: SYNC READ with partial results, SYNC WRITE split to what a packet can carry.

A silent servo costs its own value and nobody else's. Ids alone say nothing of register maps, limits and units, so
whoever is named by id is read first (registers 0 to 39, by SYNC READ as well); a servo object that is prepared
costs nothing more. Trains of replies are kept short, for a stop must wait until a train has passed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple, TypeVar

from motorbus.core.register import RegisterMap, Value, shown
from motorbus.core.request import ExactDecoder, Expected, Request, Response
from motorbus.core.setpoint import Setpoint
from motorbus.core.steps import catch
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import (
    Block,
    changed_since,
    read_block,
    told_by,
    unanswered,
)
from motorbus.families.feetech.driver.gauge import blocks
from motorbus.families.feetech.driver.identity import learn, unknown_map
from motorbus.families.feetech.driver.node import IMAGE, Node, as_nodes
from motorbus.families.feetech.driver.orders import check_names, check_values, only_block, orders_of
from motorbus.families.feetech.driver.registers import Span, decode, rows_of, spans

T = TypeVar("T")
One = TypeVar("One", bound=int | Node)

RATE: Final = 1_000_000
"""bit/s taken for granted where nobody says otherwise: how STS servos ship."""
AIR: Final = 0.004
"""s of air that one train of replies may need, so that a stop need not wait longer."""
_MOST_IDS: Final = 251
_BITS: Final = 10


class GroupResult(NamedTuple):
    """What a group read brought: values by id and name in API units, the error of each id that is missing, the
    alarm bits by id, and when the last reply came (s on the link's clock; -inf when none did)."""

    values: dict[int, dict[str, Value]]
    errors: dict[int, MotorbusError]
    alarms: dict[int, tuple[str, ...]]
    at: float


# -- read ----------------------------------------------------------------------------------------------------


async def sync_read(
    names: Sequence[str], ids: Iterable[int | Node], *, rate: int = RATE, air: float = AIR
) -> GroupResult:
    """These registers of all these servos, by as few SYNC READs as keep each train of replies within `air` s.

    Servos that know no SYNC READ are read one by one; maps may be mixed, and each value is read by the servo's own map.
    `rate` is the rate of the bus in bit/s. Who does not answer has an error in the result, and the others their
    values. Raises RequestError for an unknown name; nothing is sent then.
    """
    check_names(names)
    nodes = distinct(ids)
    errors = await prepare_all(nodes, rate=rate, air=air)
    raws: dict[int, dict[str, int]] = {node.node: {} for node in nodes if node.node not in errors}
    for table, group in _by_table(node for node in nodes if node.node in raws):
        for span in spans(rows_of(table, names)):
            await _sync_read_span(span, group, raws, errors, rate, air)
    answered = [node for node in nodes if node.node not in errors]
    return GroupResult(
        {node.node: _values(node, names, raws[node.node]) for node in answered},
        errors,
        {node.node: node.alarm for node in answered},
        max((node.at for node in answered), default=float("-inf")),
    )


async def prepare_all(
    ids: Iterable[int | Node], *, rate: int = RATE, air: float = AIR
) -> dict[int, MotorbusError]:
    """Read identity, limits, mode and units of all of these that are not known yet; the errors by id."""
    nodes = [node for node in distinct(ids) if node.table is None or node.settings is None]
    errors: dict[int, MotorbusError] = {}
    for part in trains(nodes, IMAGE, rate, air):
        images = await collected(part, 0, IMAGE, errors)
        for node in part:
            if node.node in images:
                learn(node, images[node.node])
    return errors


async def _sync_read_span(
    span: Span,
    group: Sequence[Node],
    raws: dict[int, dict[str, int]],
    errors: dict[int, MotorbusError],
    rate: int,
    air: float,
) -> None:
    here = [node for node in group if node.node not in errors]
    for part in trains(here, span.size, rate, air):
        found = await collected(part, span.address, span.size, errors)
        for id, data in found.items():
            raws[id].update(decode(span, data))


def block_of_each(
    nodes: Sequence[Node], address: int, count: int, *, kept: bool = False
) -> Request[dict[int, bytes]]:
    """SYNC READ one block of each; the value holds the bytes of those who answered. `kept`: it is run again."""

    def read(answer: Response) -> dict[int, bytes]:
        return {id: data[:count] for id, data in _heard(by_id, answer)}

    def whole(size: int) -> ExactDecoder[dict[int, bytes]] | None:
        return blocks(nodes, count, size) if kept and size > 0 else None

    by_id = {node.node: node for node in nodes}
    return sync_exchange(nodes, address, count, read, whole=whole)


def sync_exchange(
    nodes: Sequence[Node],
    address: int,
    count: int,
    read: Callable[[Response], T],
    places: Callable[[Response], Mapping[int, float]] | None = None,
    whole: Callable[[int], ExactDecoder[T] | None] = lambda _: None,
) -> Request[T]:
    """SYNC READ one block of each of these, in this order.

    `places` says where they are by what was read last. `whole` as for `read_block`.
    """
    by_id = {node.node: node for node in nodes}
    ids = list(by_id)
    return Request(
        wire.sync_read(address, count, ids),
        tuple(Expected(id, id, wire.OVERHEAD + count) for id in ids),
        read,
        repeatable=True,
        reports_position=places or told_by(by_id, address, count),
        decode_exact=whole(count),
    )


async def collected(
    nodes: Sequence[Node], address: int, count: int, errors: dict[int, MotorbusError]
) -> dict[int, bytes]:
    """One block of each: by SYNC READ, and by READ of those whom it did not bring; the errors of the rest by id.

    Those whose map is known to have no SYNC READ are not asked by it, and wait for nobody. What servos do whose
    predecessor in the list is silent is not documented.
    """
    able = [node for node in nodes if node.control.sync_read]
    heard = await catch(block_of_each(able, address, count)) if able else {}
    found = {} if isinstance(heard, MotorbusError) else heard
    for node in nodes:
        if node.node not in found:
            data = await catch(read_block(node, address, count, bytes))
            if isinstance(data, MotorbusError):
                errors[node.node] = data
            else:
                found[node.node] = data
    return found


def trains(nodes: Sequence[Node], count: int, rate: int, air: float) -> Iterator[Sequence[Node]]:
    """Divide nodes so that the replies of each part, with `count` bytes each, need at most `air` s (but one may)."""
    each = (wire.OVERHEAD + count) * _BITS / rate
    most = int(min(max(air / each, 1), _MOST_IDS))
    for start in range(0, len(nodes), most):
        yield nodes[start : start + most]


def distinct(ids: Iterable[int | Node]) -> list[Node]:
    """Each as a node. Raises RequestError when one is there twice or there is none, and for what is no list of them."""
    try:
        wanted = list(ids)
    except TypeError:
        if isinstance(ids, Iterable):
            raise
        raise RequestError(
            f"{shown(ids)} is no list of servos",
            expected="a list of servos, also where there is only one",
            advice="put it into brackets; nothing was sent",
        ) from None
    nodes = as_nodes(wanted)
    if len(nodes) == len(wanted) > 0:
        return nodes
    raise RequestError(
        "an id is named twice" if nodes else "no servo is named",
        advice="name each servo once; nothing was sent",
    )


def _heard(by_id: Mapping[int, Node], answer: Response) -> Iterator[tuple[int, bytes]]:
    for reply in answer.replies:
        frame = reply.data
        by_id[frame[2]].heard(frame[4], answer.at)
        yield frame[2], frame[5:-1]


def _by_table(nodes: Iterable[Node]) -> Iterator[tuple[RegisterMap, list[Node]]]:
    groups: dict[str, tuple[RegisterMap, list[Node]]] = {}
    for node in nodes:
        assert node.table is not None
        key = f"{node.table.name} {node.table['present_position'].order}"
        groups.setdefault(key, (node.table, []))[1].append(node)
    yield from groups.values()


def _values(node: Node, names: Sequence[str], raws: Mapping[str, int]) -> dict[str, Value]:
    assert node.table is not None
    return {row.name: node.value(row, raws[row.name]) for row in rows_of(node.table, names)}


# -- write ---------------------------------------------------------------------------------------------------


async def sync_write(
    values: Mapping[One, Mapping[str, Value]],
    *,
    rate: int = RATE,
    air: float = AIR,
) -> None:
    """Write the same adjoining RAM registers of many servos: `{id or servo: {name: value}}`, in API units.

    One packet serves up to 83 servos with two bytes each; more are split, and so are servos in whose maps the registers
    lie elsewhere; then it is not simultaneous. Maps and byte orders may be mixed otherwise. Nobody acknowledges a SYNC
    WRITE: follow it with sync_read() when it matters. All or nothing: raises NoReply or DeviceError, with nothing
    written, when a servo that must be asked first is silent or unknown; and the goals of all packets are judged before
    the first one leaves. What ends it between two packets, as a stop, has a note that says who was written to.
    """
    for orders in values.values():
        check_values(orders)
    nodes = distinct(values)
    errors = await prepare_all(nodes, rate=rate, air=air)
    if errors:
        raise next(iter(errors.values()))
    refuse_other_names(nodes, list(values.values()))
    blocks = [
        block_of(node, orders)._replace(under=node.settings)
        for node, orders in zip(nodes, values.values(), strict=True)
    ]
    await written_all(list(sync_writes(nodes, blocks)))


async def written_all(requests: Sequence[Request[None]]) -> None:
    """These one after the other; an error of a later one is told with a note that the first ones have left."""
    for sent, request in enumerate(requests):
        try:
            await request
        except MotorbusError as error:
            if sent:
                error.add_note(f"{sent} of {len(requests)} packets had left before this one")
            raise


def sync_writes(nodes: Sequence[Node], blocks: Sequence[Block]) -> Iterator[Request[None]]:
    """These blocks as few SYNC WRITEs as can carry them: one for each place and length, unless they are too many.

    One is not sent once a servo that it or a later one is for has other settings than when it was made; and each is
    judged by the goals of the later ones besides, so that the first does not leave when the last is refused.
    """
    parts = list(_parts(nodes, blocks))
    for index, part in enumerate(parts):
        left = [one for later in parts[index:] for one in later]
        goals: tuple[Setpoint, ...] = tuple(goal for _, block in left for goal in block.goals)
        items = [(node.node, block.data) for node, block in part]
        yield unanswered(
            wire.sync_write(part[0][1].address, items),
            max(block.effect for _, block in left),
            goals,
            refusal=changed_since([(node, block.under) for node, block in left]),
        )


def _parts(nodes: Sequence[Node], blocks: Sequence[Block]) -> Iterator[list[tuple[Node, Block]]]:
    """What one packet carries, of all packets."""
    places: dict[tuple[int, int], list[tuple[Node, Block]]] = {}
    for node, block in zip(nodes, blocks, strict=True):
        places.setdefault((block.address, len(block.data)), []).append((node, block))
    for (_, size), group in places.items():
        capacity = wire.sync_write_capacity(size)
        for start in range(0, len(group), capacity):
            yield group[start : start + capacity]


def refuse_other_names(nodes: Sequence[Node], values: Sequence[Mapping[str, Value]]) -> None:
    """Raise RequestError where one is to get other registers than the first."""
    for node, orders in zip(nodes, values, strict=True):
        if set(orders) != set(values[0]):
            raise RequestError(
                f"node {node.node} is to get other registers than node {nodes[0].node}",
                expected="the same registers for every servo of a SYNC WRITE",
                advice="write() them one by one; nothing was sent",
                node=node.node,
            )


def block_of(node: Node, values: Mapping[str, Value]) -> Block:
    """What these values come to in the registers of a servo that is known. Raises as `sync_write`."""
    if not node.writable:
        raise unknown_map(node, "refuses to write to it")
    assert node.table is not None
    return only_block(node, orders_of(node, node.table, values), "SYNC WRITE")
