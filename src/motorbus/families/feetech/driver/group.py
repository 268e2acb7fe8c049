"""Several servos in one packet: SYNC READ with partial results, SYNC WRITE, REG WRITE with one ACTION.

A silent servo costs its own value only. Servos of maps without SYNC READ, and those that answer READ and not SYNC READ,
are read one by one. Replies of one request take at most 4 ms, for a stop waits until they have passed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import gt, lt, mul, truediv
from struct import Struct
from typing import Any, Final, NamedTuple, TypeVar

from motorbus.core.family import Positions
from motorbus.core.register import Register, RegisterMap, Value
from motorbus.core.request import (
    ExactDecoder,
    Expected,
    Priority,
    Request,
    Response,
    SetpointGroup,
    SetpointWrite,
)
from motorbus.core.setpoint import Setpoint, torque_off
from motorbus.core.steps import Emit, Exclusive, SetBitrate, catch, with_cleanup
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver.access import (
    GAP,
    GROUPS,
    action_all,
    check_names,
    ram_block,
    reg_write_block,
    rows_of,
    spans,
)
from motorbus.families.feetech.driver.goals import position_goal
from motorbus.families.feetech.driver.identity import learn, unknown_map
from motorbus.families.feetech.driver.motion import LIMP, disable_torque
from motorbus.families.feetech.driver.node import IMAGE, Node, as_nodes
from motorbus.families.feetech.driver.requests import (
    DATA,
    PRESENT,
    SOUND,
    Block,
    outdated,
    read_block,
    reports_position,
    unanswered,
    unchanged,
)

T = TypeVar("T")
One = TypeVar("One", bound=int | Node)

AIR: Final = 0.004  # s of replies of one request
BITS: Final = 10  # of a byte on the wire
MOST_IDS: Final = 251
NUMBERS: Final = frozenset((float, int))


class GroupResult(NamedTuple):
    """Values by id and name in API units, errors by id, alarms by id, arrival of the last reply (s, -inf for none)."""

    values: dict[int, dict[str, Value]]
    errors: dict[int, MotorbusError]
    alarms: dict[int, tuple[str, ...]]
    at: float


class ReadsAlone(NamedTuple):
    """An event: this servo answers READ and not SYNC READ, so it is read by itself from now on."""

    node: int


# -- read ------------------------------------------------------------------------------------------------------


async def sync_read(names: Sequence[str], ids: Iterable[int | Node]) -> GroupResult:
    """These registers of all these servos, by few SYNC READs; maps may be mixed.

    Errors of single servos are in the result. Raises RequestError for an unknown name.
    """
    check_names(names)
    nodes = as_nodes(ids)
    errors = await prepare_all(nodes)
    groups: dict[tuple[str, str], list[Node]] = {}
    for node in nodes:
        if node.node not in errors:
            table = _table(node)
            groups.setdefault((table.name, table["present_position"].order), []).append(node)
    values: dict[int, dict[str, Value]] = {}
    for group in groups.values():
        table = _table(group[0])
        if lacking := [name for name in names if name not in GROUPS and name not in table]:
            what = f"has the map {table.name}, which has no {', '.join(lacking)}"
            errors.update({node.node: node.refusal(what) for node in group})
            continue
        rows = rows_of(table, names)
        raws: dict[int, dict[str, int]] = {node.node: {} for node in group}
        for span in spans(rows, GAP):
            answering = [node for node in group if node.node not in errors]
            for part in await divided(answering, span.size):
                for id, data in (await collect(part, span.address, span.size, errors)).items():
                    raws[id] |= span.decode(data)
        for node in group:
            if node.node not in errors:
                values[node.node] = {row.name: node.value(row, raws[node.node][row.name]) for row in rows}
    answered = [node for node in nodes if node.node in values]
    return GroupResult(
        {node.node: values[node.node] for node in answered},
        errors,
        {node.node: node.alarm for node in answered},
        max((node.known.at for node in answered), default=float("-inf")),
    )


async def prepare_all(ids: Iterable[int | Node]) -> dict[int, MotorbusError]:
    """Identify those of these servos that are unknown; the errors by id."""
    nodes = [node for node in as_nodes(ids) if node.settings is None]
    errors: dict[int, MotorbusError] = {}
    for part in await divided(nodes, IMAGE):
        images = await collect(part, 0, IMAGE, errors)
        for node in part:
            if node.node in images:
                learn(node, images[node.node])
    return errors


async def divided(nodes: Sequence[Node], count: int) -> list[Sequence[Node]]:
    """Divide nodes so that the replies of each part, with `count` bytes each, take at most `AIR` s at this rate."""
    each = (protocol.OVERHEAD + count) * BITS / await SetBitrate(0)
    most = int(min(max(AIR / each, 1), MOST_IDS))
    return [nodes[start : start + most] for start in range(0, len(nodes), most)]


async def collect(
    nodes: Sequence[Node], address: int, count: int, errors: dict[int, MotorbusError]
) -> dict[int, bytes]:
    """One block of each: by SYNC READ, then by READ of those that it did not return; errors of the rest by id."""
    able = [node for node in nodes if can_sync_read(node)]
    found = await _sync_blocks(able, address, count) if len(able) > 1 else {}
    for node in nodes:
        if node.node in found:
            node.known.reads_alone = False
            continue
        data = await catch(read_block(node, address, count, bytes))
        if isinstance(data, MotorbusError):
            errors[node.node] = data
            continue
        found[node.node] = data
        asked = len(able) > 1 and node in able and node.table is not None
        if asked and not await _sync_blocks([node], address, count):
            node.known.reads_alone = True
            await Emit(ReadsAlone(node.node))
    return found


async def _sync_blocks(nodes: Sequence[Node], address: int, count: int) -> dict[int, bytes]:
    def decode(answer: Response) -> dict[int, bytes]:
        return {id: data[:count] for id, data in _replies(nodes, answer)}

    found = await catch(sync_request(nodes, address, count, decode))
    return {} if isinstance(found, MotorbusError) else found


def can_sync_read(node: Node) -> bool:
    """It answers SYNC READ, as far as is known."""
    return node.traits.sync_read and not node.known.reads_alone


def sync_request(
    nodes: Sequence[Node],
    address: int,
    count: int,
    decode: Callable[[Response], T],
    decode_exact: ExactDecoder[T] | None = None,
) -> Request[T]:
    """SYNC READ one block of each of these, in this order. Raises RequestError for a servo without SYNC READ."""
    for node in nodes:
        if not can_sync_read(node):
            raise node.refusal("has no SYNC READ", "use sync_read(), which reads such servos one by one")
    ids = [node.node for node in nodes]
    return Request(
        protocol.sync_read(address, count, ids),
        tuple(Expected(id, id, protocol.OVERHEAD + count) for id in ids),
        decode,
        repeatable=True,
        reports_position=reports_position({node.node: node for node in nodes}, address, count),
        decode_exact=decode_exact,
    )


def _replies(nodes: Sequence[Node], answer: Response) -> Iterator[tuple[int, bytes]]:
    """Id and data of each reply."""
    by_id = {node.node: node for node in nodes}
    for reply in answer.replies:
        frame = reply.data
        by_id[frame[2]].note_reply(frame[4], answer.at)
        yield frame[2], frame[DATA:-1]


def positions_request(nodes: Sequence[Node]) -> Request[Positions]:
    """The present positions (rad) of identified servos with SYNC READ, in one request that may be kept."""
    by_id = {node.node: (node, known_row(node, "present_position")) for node in nodes}

    def decode(answer: Response) -> Positions:
        values = {}
        for id, data in _replies(nodes, answer):
            node, row = by_id[id]
            values[id] = float(node.value(row, row.decode(data[: row.size])))
        return Positions(values, answer.missing, answer.at)

    exact = _exact_positions(nodes, [row for _, row in by_id.values()])
    return sync_request(nodes, PRESENT, 2, decode, exact)


def _exact_positions(nodes: Sequence[Node], rows: Sequence[Register]) -> ExactDecoder[Positions] | None:
    """Decode a SYNC READ if its bytes are all replies, in order, valid, without an alarm, none negative.

    None for mixed byte orders, and modes that leave the offset in.
    """
    made = [(node.known, node.settings) for node in nodes]
    if len({row.order for row in rows}) > 1 or any(
        settings is None or settings.shift for _, settings in made
    ):
        return None
    unpack = Struct(("<" if rows[0].order == "little" else ">") + "5xHx" * len(nodes)).unpack
    ids = [node.node for node in nodes]
    scales = [float(node.value(row, 1)) for node, row in zip(nodes, rows, strict=True)]
    size = protocol.OVERHEAD + 2
    heads = [protocol.HEADER + bytes((id, 4, 0)) for id in ids]
    parts = [(slice(number * size, (number + 1) * size), head) for number, head in enumerate(heads)]

    def decode(data: Any, at: float) -> Positions | None:
        if len(data) != size * len(ids):
            return None
        for part, head in parts:
            frame = data[part]
            if not frame.startswith(head) or sum(frame) & 0xFF != SOUND:
                return None
        raws = unpack(data)
        if max(raws) >= 0x8000:  # negative
            return None
        for known, settings in made:
            if known.settings is not settings:
                return None
            known.at, known.alarm = at, ()
        return Positions(dict(zip(ids, map(mul, raws, scales))), (), at)  # noqa: B905 - as many

    return decode


def _table(node: Node) -> RegisterMap:
    assert node.table is not None
    return node.table


def known_row(node: Node, name: str) -> Register:
    """A row of an identified servo. Raises RequestError if it is not, DeviceError for an unknown map."""
    if node.table is None or node.settings is None:
        raise node.refusal("is not identified, so its limits and units are unknown", "run prepare_all()")
    if not node.table[name].unit:
        raise unknown_map(node)
    return node.row(name)


# -- write -----------------------------------------------------------------------------------------------------


async def sync_write(values: Mapping[One, Mapping[str, Value]]) -> None:
    """Write the same adjoining RAM registers of many servos: `{id or servo: {name: value}}`, in API units.

    No servo acknowledges it. One packet carries up to 83 servos with two bytes each. Nothing is written if a servo is
    silent or unknown, or a value cannot be written.
    """
    await sync_write_request(await _blocks(values, "SYNC WRITE"))


async def reg_write_all(values: Mapping[One, Mapping[str, Value]]) -> None:
    """REG WRITE to each of these, `{id or servo: {name: value}}` in API units, then ACTION for all.

    ACTION is not sent unless all have acknowledged; a note says which hold a REG WRITE then.
    """
    blocks = await _blocks(values, "REG WRITE")

    async def write_all() -> None:
        written: list[str] = []
        for node, block in blocks.items():
            written.append(str(node.node))
            try:
                await reg_write_block(node, block)
            except MotorbusError as error:
                error.add_note(
                    f"servos {', '.join(written)} may hold a REG WRITE, which the next ACTION would carry out"
                )
                raise
        await action_all(list(blocks))

    await Exclusive(write_all())


async def _blocks(values: Mapping[One, Mapping[str, Value]], what: str) -> dict[Node, Block]:
    """The servos, identified, and the block of each."""
    nodes = as_nodes(values)
    for error in (await prepare_all(nodes)).values():
        raise error
    return {node: ram_block(node, each, what) for node, each in zip(nodes, values.values(), strict=True)}


def sync_write_request(blocks: Mapping[Node, Block]) -> Request[None]:
    """These blocks in one SYNC WRITE. Raises RequestError if they lie at different addresses, or are too many."""
    places = {(block.address, len(block.data)) for block in blocks.values()}
    if len(places) > 1:
        raise RequestError(
            "SYNC WRITE takes registers in one place in the maps of all servos",
            advice="write the servos of each map by themselves",
        )
    ((address, _),) = places
    return unanswered(
        protocol.sync_write(address, [(node.node, block.data) for node, block in blocks.items()]),
        max(block.effect for block in blocks.values()),
        tuple(goal for block in blocks.values() for goal in block.goals),
        unless=unchanged(blocks),
    )


class GoalWriter:
    """Makes SYNC WRITEs of goal positions of identified servos for a loop; see `__call__`.

    Raises RequestError unless all are in position mode and fit one packet.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        self._rows: Final = [known_row(node, "goal_position") for node in nodes]
        for node in nodes:
            position_goal(node, 0.0)
        if len(nodes) > protocol.sync_write_capacity(2):
            raise RequestError(f"{len(nodes)} servos are too many for one packet", advice="divide them")
        self._made: Final = [(node, node.settings) for node in nodes]
        self._nodes: Final = nodes
        cells = [_cell(node, row) for node, row in zip(nodes, self._rows, strict=True)]
        self._scales, self._lows, self._highs = zip(*cells, strict=True)
        self._pack: Final = Struct("<" + "BH" * len(nodes)).pack
        self._big: Final = [number for number, row in enumerate(self._rows) if row.order == "big"]
        self._ids: Final = [node.node for node in nodes]
        head = bytes((protocol.BROADCAST, 4 + 3 * len(nodes), 0x83, self._rows[0].address, 2))
        self._head: Final = protocol.HEADER + head
        self._sum: Final = sum(head)
        self._group: Final = SetpointGroup(self._ids, self._setpoints, unchanged(nodes))

    def holds(self) -> bool:
        """Whether the settings of all servos are those that it was made by."""
        return all(node.known.settings is settings for node, settings in self._made)

    def __call__(self, goals: Sequence[float]) -> Request[None]:
        """The packet with these goals (rad), one for each servo; the gate judges the limits.

        Raises RequestError for another number of goals, LimitExceeded for what no register holds.
        """
        if len(goals) != len(self._nodes):
            raise RequestError(f"{len(goals)} goals for {len(self._nodes)} servos")
        if not NUMBERS.issuperset(map(type, goals)):
            return self._checked(goals)
        try:
            raws = list(map(round, map(truediv, goals, self._scales)))
        except (ValueError, OverflowError):  # not finite
            return self._checked(goals)
        if any(map(lt, raws, self._lows)) or any(map(gt, raws, self._highs)):
            return self._checked(goals)
        codes = raws.copy()
        for number in self._big:
            codes[number] = (raws[number] & 0xFF) << 8 | raws[number] >> 8
        body = self._pack(*[part for pair in zip(self._ids, codes) for part in pair])  # noqa: B905 - as many
        return SetpointWrite(self._head + body + bytes((~(self._sum + sum(body)) & 0xFF,)), self._group, raws)

    def _setpoints(self, raws: Sequence[int]) -> tuple[Setpoint, ...]:
        return tuple(
            Setpoint(node.node, "position", node.value(row, raw), *(node.limits or (None, None)))
            for node, row, raw in zip(self._nodes, self._rows, raws, strict=True)
        )

    def _checked(self, goals: Sequence[float]) -> Request[None]:
        """The packet with a negative goal, or one outside the limits, which the gate judges."""
        for node, settings in self._made:
            if node.known.settings is not settings:
                raise outdated(node.node)
        blocks = {}
        for node, row, goal in zip(self._nodes, self._rows, goals, strict=True):
            raw, order = position_goal(node, goal)
            blocks[node] = Block(row.address, row.encode(raw), row.effect, (order,))
        return sync_write_request(blocks)


def _cell(node: Node, row: Register) -> tuple[float, int, int]:
    """The unit (rad), lowest and highest raw goal within the limits whose code is the number itself."""
    scale, (low, high) = float(node.value(row, 1)), node.limits or (0.0, 0.0)
    least, most = max(0, row.low, round(low / scale)), min(row.high, round(high / scale))
    least += node.value(row, least) < low
    most -= node.value(row, most) > high
    return scale, least, most


class ServoGroup:
    """Identified servos of one bus for a loop; its requests may be kept and run again.

    Raises RequestError for a servo that is not identified; `read` and `positions` for one without SYNC READ.
    """

    def __init__(self, servos: Sequence[Node]) -> None:
        self.servos: Final = as_nodes(servos)
        for node in self.servos:
            known_row(node, "present_position")

    @property
    def positions(self) -> Request[Positions]:
        """The present positions (rad)."""
        return positions_request(self.servos)

    def read(self, *names: str) -> Request[dict[int, dict[str, Value]]]:
        """These registers of all servos that answer, by id and name; they must lie alike in the maps of all."""
        found = {node.node: list(spans(rows_of(_table(node), names), GAP)) for node in self.servos}
        places = {(span.address, span.size) for each in found.values() for span in each}
        if len(places) > 1:
            raise RequestError(f"{', '.join(names)} are not in one place", advice="read fewer registers")
        ((address, size),) = places
        by_id = {node.node: node for node in self.servos}

        def decode(answer: Response) -> dict[int, dict[str, Value]]:
            values = {}
            for id, data in _replies(self.servos, answer):
                node, (span,) = by_id[id], found[id]
                raws = span.decode(data)
                values[id] = {
                    row.name: node.value(row, raws[row.name]) for row in rows_of(_table(node), names)
                }
            return values

        return sync_request(self.servos, address, size, decode)

    def write(self, *names: str) -> Callable[[Sequence[Any]], Request[None]]:
        """A function of one value for each servo, or one sequence of values in the order of the names."""
        if names == ("goal_position",):
            return GoalWriter(self.servos)

        def make(values: Sequence[Any]) -> Request[None]:
            if len(values) != len(self.servos):
                raise RequestError(f"{len(values)} values for {len(self.servos)} servos")
            blocks = {}
            for node, value in zip(self.servos, values, strict=True):
                row = (value,) if len(names) == 1 else value
                blocks[node] = ram_block(node, dict(zip(names, row, strict=True)), "SYNC WRITE")
            return sync_write_request(blocks)

        return make


# -- torque off ------------------------------------------------------------------------------------------------


def disable_torque_everyone() -> Request[None]:
    """Torque off for every servo on the line, in one broadcast without replies."""
    wire = protocol.write(protocol.BROADCAST, LIMP.address, LIMP.data)
    return unanswered(wire, LIMP.effect, priority=Priority.STOP)


def limp_requests(ids: Sequence[int], most: int) -> list[Request[None]]:
    """Torque off for these servos by SYNC WRITE, at most so many in one packet."""
    parts = [ids[start : start + most] for start in range(0, len(ids), most)]
    return [
        unanswered(
            protocol.sync_write(LIMP.address, [(id, LIMP.data) for id in part]),
            LIMP.effect,
            tuple(map(torque_off, part)),
            priority=Priority.STOP,
        )
        for part in parts
    ]


async def disable_torque_all(ids: Iterable[int | Node]) -> dict[int, MotorbusError]:
    """Torque off for all of these: by SYNC WRITE, then one by one until acknowledged; the errors by id.

    Every servo is visited, also after an interruption, which is raised then.
    """
    waiting = as_nodes(ids)
    errors: dict[int, MotorbusError] = {}

    async def at_once() -> None:
        for request in limp_requests([node.node for node in waiting], protocol.sync_write_capacity(1)):
            await catch(request)

    async def one_by_one() -> None:
        while waiting:
            failure = await catch(disable_torque(waiting[0]))
            if failure is not None:
                errors[waiting[0].node] = failure
            del waiting[0]

    await with_cleanup(at_once(), one_by_one)
    return errors
