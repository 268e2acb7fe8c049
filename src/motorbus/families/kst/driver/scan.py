"""Find servos.

A scan reads the node id: of all servos by one broadcast, then of each id that did not answer. It writes nothing: a
write to the target position presets the encoder of some servos. An abort is an answer too. Source of the broadcast: a
public demo driver.

A frame at a wrong bit rate destroys frames of other devices. So at another rate the adapter first listens, without
acknowledging; where it reports errors and no valid frame, nothing is sent. slcan reports no errors.

The `lane` of a reply is the id of the servo that sent it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple

from motorbus.core.family import Found, Identity
from motorbus.core.request import ANY, EVERY_LANE, Priority, Request, Response, TimeoutClass
from motorbus.core.scan import BitrateRestored, Skipped, set_or_skip
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, WaitFor, catch, gather
from motorbus.errors import LinkError, LinkLost, NoReply, RequestError, WireError
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.identity import count_replies, identify, is_bus_error
from motorbus.families.kst.driver.node import BusSettings, Node, checked_ids
from motorbus.families.kst.driver.requests import decoded, upload
from motorbus.families.kst.notifications import BusState
from motorbus.families.kst.profiles import bit_rate_code

PASSES: Final = 2  # a silent id is read twice: a servo may miss the first frame after power-up
BATCH: Final = 16  # ids that are read at the same time
LISTEN: Final = 0.25  # s to listen at another rate: traffic of 4 Hz and more is received
IN_USE: Final = "errors only: the bus is in use at another rate"
WRONG_RATE: Final = "the first frame caused a bus error and had no reply: this bus uses another rate"
OTHER_FORMAT: Final = "no reply; servos with 29-bit identifiers need id_format=ext, others id_format=std"
ERRORS: Final = "two servos with one id, another rate on the bus, bad wiring, or a missing terminator"
TWO_REPLIES: Final = (
    "two answers to one request: two servos with one id; connect and provision them one at a time"
)
NO_POSITION: Final = (
    "it answers reads of its id, never of its position: two servos with one id, whose replies collide"
)


class ScanWarning(NamedTuple):
    """An event: a user should check this node (0: the bus) at this rate (bit/s)."""

    node: int
    rate: int
    what: str


async def scan(settings: BusSettings, ids: Sequence[int] = (), rates: Sequence[int] = ()) -> list[Found]:
    """All servos that answer, with their identity. `ids` (): all; `rates` (): the present one.

    At another rate than the present one the adapter listens first; a rate at which errors show that the bus is in use
    is `Skipped`. If the first broadcast there causes a bus error, nothing more is sent at that rate. Reports `Found`,
    `Progress` and `ScanWarning`. Raises RequestError for an impossible id or rate.
    """
    checked_ids(ids)
    _check_rates(rates)
    present = await SetBitrate(0)  # 0 reads the rate
    if not rates:
        return await _scan_at(settings, ids, present)

    async def scan_each() -> list[Found]:
        found: list[Found] = []
        async with BitrateRestored():
            for rate in rates:
                other = rate != present
                if await _select_rate(settings, rate, listen_first=other):
                    found += await _scan_at(settings, ids, rate, careful=other)
        return found

    return await Exclusive(scan_each())


# -- rates -----------------------------------------------------------------------------------------------------


def received(settings: BusSettings) -> BusState:
    """What the open bus has received. Raises RequestError for settings of no open bus."""
    if settings.state is None:
        raise RequestError("these settings belong to no open bus", expected="those of settings_of(bus)")
    return settings.state


def _check_rates(rates: Sequence[int]) -> None:
    for rate in rates:
        bit_rate_code(rate)


async def _is_in_use(settings: BusSettings, rate: int) -> bool:
    """Whether the bus is in use at another rate than this one, which stays set; False if the adapter cannot listen."""
    try:
        await SetBitrate(rate, listen_only=True)
    except LinkLost:
        raise
    except LinkError:
        return False
    state = received(settings)
    frames, errors = state.frames, state.errors
    await WaitFor(lambda notification: not is_bus_error(notification), LISTEN)
    return state.frames == frames and state.errors > errors


async def set_named_rate(settings: BusSettings, rate: int) -> None:
    """Set this rate after listening, if the adapter can. Raises RequestError if the bus is in use at another rate."""
    if await _is_in_use(settings, rate):
        raise RequestError(
            f"nothing is sent at {rate} bit/s: {IN_USE}",
            cause="a frame at a wrong rate breaks the frames of other devices",
            advice="connect this servo alone, and call again",
        )
    await SetBitrate(rate)


async def _select_rate(settings: BusSettings, rate: int, *, listen_first: bool) -> bool:
    """Set this rate; or report why it is `Skipped`, and return False."""
    if listen_first and await _is_in_use(settings, rate):
        await Emit(Skipped(rate, IN_USE))
        return False
    return await set_or_skip(rate)


# -- one rate --------------------------------------------------------------------------------------------------


async def _scan_at(
    settings: BusSettings, ids: Sequence[int], rate: int, *, careful: bool = False
) -> list[Found]:
    """The servos that answer at the present rate (bit/s).

    Without `ids`, or if `careful`, a broadcast comes first. With `careful` nothing follows a broadcast that breaks.
    """
    state = received(settings)
    errors = state.errors
    nodes = checked_ids(ids or sdo.NODES)
    counts: Counter[int] = Counter()
    if careful or not ids:
        answer = await broadcast_ids(settings)
        counts.update(reply.lane for reply in answer.replies if reply.lane in nodes)
        for node in counts:
            await Emit(Found(node, rate, None))
        if careful and not counts and state.errors > errors:
            await Emit(ScanWarning(0, rate, WRONG_RATE))
            return []
    answering = list(counts)
    for number in range(PASSES):
        done = number * len(nodes)
        for batch in _batches([node for node in nodes if node not in answering]):
            answers = await gather(*[_answers(Node(node, settings), rate) for node in batch])
            answering += [node for node, answers_now in zip(batch, answers, strict=True) if answers_now]
            done += len(batch)
            await Emit(Progress(done, PASSES * len(nodes), f"ids up to {batch[-1]} at {rate} bit/s"))
    if state.errors > errors:
        await Emit(ScanWarning(0, rate, f"{state.errors - errors} bus errors during the scan: {ERRORS}"))
    if not answering and not careful:
        await Emit(ScanWarning(0, rate, OTHER_FORMAT))
    found: list[Found] = []
    for batch in _batches(sorted(answering)):
        servos = [Node(node, settings) for node in batch]
        for one in await gather(*[count_replies(servo) for servo in servos if servo.node not in counts]):
            counts[one.node] = one.replies
        for node in batch:
            if counts[node] > 1:
                await Emit(ScanWarning(node, rate, TWO_REPLIES))
        found += await _identify(servos, rate)
    return found


def _batches(nodes: Sequence[int]) -> list[Sequence[int]]:
    return [nodes[start : start + BATCH] for start in range(0, len(nodes), BATCH)]


def broadcast_ids(settings: BusSettings, priority: Priority = Priority.CONFIGURATION) -> Request[Response]:
    """Read the node id of all servos; their replies follow each other by arbitration."""
    row = settings.profile.table["node_id"]

    def decode(answer: Response) -> Response:
        pairs = zip(answer.replies, decoded(answer), strict=True)
        mine = tuple(
            reply for reply, one in pairs if one.index in (row.address, 0)
        )  # 0: some aborts name no object
        return answer._replace(replies=mine)  # without late replies to other requests

    return Request(settings.upload(sdo.BROADCAST, row), ANY, decode, lane=EVERY_LANE, priority=priority)


async def _answers(servo: Node, rate: int) -> bool:
    """Whether a servo answers a read of its id, also with an abort or an invalid reply; reports it as `Found`."""
    row, within = servo.table["node_id"], TimeoutClass.SCAN
    try:
        await upload(servo, row, lambda _: None, priority=Priority.CONFIGURATION, reply_within=within)
    except NoReply:
        return False
    except WireError as error:
        await Emit(ScanWarning(servo.node, rate, error.summary))
    await Emit(Found(servo.node, rate, None))
    return True


async def _identify(servos: Sequence[Node], rate: int) -> list[Found]:
    """Identify these servos; one that cannot be identified is found without identity.

    Reports a `ScanWarning` for an id that is written and not in force, and for a position that cannot be read.
    """
    identities = await gather(*[catch(identify(servo)) for servo in servos])
    positions = await gather(*[catch(position(servo)) for servo in servos])
    found: list[Found] = []
    for servo, identity, at in zip(servos, identities, positions, strict=True):
        if not isinstance(identity, Identity):
            found.append(Found(servo.node, rate, None))
            continue
        found.append(Found(servo.node, rate, identity))
        pending = identity.details["reads_back_id"]
        if pending not in (None, servo.node):
            what = (
                f"answers as {servo.node} and reads back the id {pending}: written, in force after a restart"
            )
            await Emit(ScanWarning(servo.node, rate, what))
        if isinstance(at, NoReply):
            await Emit(ScanWarning(servo.node, rate, NO_POSITION))
    return found
