"""Find servos, and the bit rate of a bus.

A scan reads the node id: of all servos by one broadcast, then of each id that did not answer. It writes nothing: a
write to the target position presets the encoder of some servos. An abort is an answer too. Source of the broadcast: a
public demo driver.

A frame at a wrong bit rate destroys frames of other devices. So at another rate the adapter first listens, without
acknowledging: a valid frame proves the rate, errors disprove it, silence proves nothing; slcan reports no errors.

The `lane` of a reply is the id of the servo that sent it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from enum import Enum
from typing import Final, NamedTuple

from motorbus.core.family import Found, Identity
from motorbus.core.request import ANY, EVERY_LANE, Priority, Request, Response, TimeoutClass
from motorbus.core.scan import BitrateRestored, Skipped, set_or_skip
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, WaitFor, catch, gather
from motorbus.errors import LinkError, LinkLost, NoReply, RequestError, WireError
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.identity import count_replies, identify, is_bus_error
from motorbus.families.kst.driver.node import BusSettings, Node, check_above_zero, checked_ids
from motorbus.families.kst.driver.requests import decoded, upload
from motorbus.families.kst.notifications import BusState
from motorbus.families.kst.profiles import RATES, bit_rate_code

PASSES: Final = 2  # a silent id is read twice: a servo may miss the first frame after power-up
BATCH: Final = 16  # ids that are read at the same time
SHORT_LISTEN: Final = (
    0.25  # s to listen at a rate that the caller has named: traffic of 4 Hz and more is received
)
LISTEN: Final = 1.0  # s to listen at each rate of `scan_bit_rates`
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


class LineActivity(Enum):
    """What an adapter received at one rate."""

    TRAFFIC = "frames came whole: this is the rate of the bus"
    ERRORS = "errors only: the bus is in use at another rate"
    SILENCE = "silence: no frames, or this adapter reports no errors"


class BitRates(NamedTuple):
    """Result of a search: the rate (bit/s; None: not known), what was received at each rate, servos that answered."""

    rate: int | None
    activity: dict[int, LineActivity]
    found: tuple[Found, ...] = ()


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


async def scan_bit_rates(
    settings: BusSettings,
    *,
    rates: Sequence[int] = RATES,
    isolated: bool = False,
    seconds: float = LISTEN,
) -> BitRates:
    """Find the bit rate of a bus: listen `seconds` at each rate, then, only with `isolated`, send at the silent ones.

    The search ends at a rate with a valid frame. `isolated` says that no machine depends on this bus. A rate that the
    adapter lacks is `Skipped`. Raises RequestError for an impossible rate, and, unless `isolated`, for an adapter that
    cannot listen.
    """
    _check_rates(rates)
    check_above_zero("seconds", seconds, "s")

    async def search() -> BitRates:
        activity: dict[int, LineActivity] = {}
        async with BitrateRestored():
            for number, rate in enumerate(rates, 1):
                try:
                    activity[rate] = await listen(settings, rate, seconds)
                except LinkLost:
                    raise
                except LinkError as error:
                    if not isolated:
                        await Emit(
                            Skipped(rate, error.summary)
                        )  # the adapter cannot listen, or lacks this rate
                    continue
                if activity[rate] is LineActivity.TRAFFIC:
                    return BitRates(rate, activity)
                await Emit(Progress(number, len(rates), f"{rate} bit/s: {activity[rate].value}"))
            if not activity and not isolated:
                raise RequestError(
                    "this adapter cannot listen without taking part, so its bit rate is not searched for",
                    expected="an adapter with a listen-only mode, or isolated=True if nothing depends on this bus",
                )
            silence = LineActivity.SILENCE
            for rate in rates if isolated else ():
                if activity.get(rate, silence) is silence and await _select_rate(
                    settings, rate, listen_first=False
                ):
                    found = await _scan_at(settings, (), rate, careful=True)
                    if found:
                        return BitRates(rate, activity, tuple(found))
        return BitRates(None, activity)

    return await Exclusive(search())


# -- rates -----------------------------------------------------------------------------------------------------


def received(settings: BusSettings) -> BusState:
    """What the open bus has received. Raises RequestError for settings of no open bus."""
    if settings.state is None:
        raise RequestError("these settings belong to no open bus", expected="those of settings_of(bus)")
    return settings.state


def _check_rates(rates: Sequence[int]) -> None:
    for rate in rates:
        bit_rate_code(rate)


async def listen(settings: BusSettings, rate: int, seconds: float) -> LineActivity:
    """Listen at this rate without sending, until a report or alarm comes. The rate stays set.

    Replies and frames of other devices are counted too. Raises LinkError when the adapter cannot listen.
    """
    await SetBitrate(rate, listen_only=True)
    state = received(settings)
    frames, errors = state.frames, state.errors
    await WaitFor(lambda notification: not is_bus_error(notification), seconds)
    if state.frames > frames:
        return LineActivity.TRAFFIC
    return LineActivity.ERRORS if state.errors > errors else LineActivity.SILENCE


async def _listen_if_possible(settings: BusSettings, rate: int) -> LineActivity | None:
    try:
        return await listen(settings, rate, SHORT_LISTEN)
    except LinkLost:
        raise
    except LinkError:
        return None  # the adapter cannot listen


async def set_named_rate(settings: BusSettings, rate: int) -> None:
    """Set this rate after listening, if the adapter can. Raises RequestError if the bus is in use at another rate."""
    if await _listen_if_possible(settings, rate) is LineActivity.ERRORS:
        raise RequestError(
            f"nothing is sent at {rate} bit/s: {LineActivity.ERRORS.value}",
            cause="a frame at a wrong rate breaks the frames of other devices",
            advice="connect this servo alone, and call again",
        )
    await SetBitrate(rate)


async def _select_rate(settings: BusSettings, rate: int, *, listen_first: bool) -> bool:
    """Set this rate; or report why it is `Skipped`, and return False."""
    if listen_first and await _listen_if_possible(settings, rate) is LineActivity.ERRORS:
        await Emit(Skipped(rate, LineActivity.ERRORS.value))
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
