"""Find servos, and the bit rate of a bus.

A scan reads the node id, first by one broadcast that all servos answer, then of each silent id. It writes nothing: a
write to the target position presets the encoder of some servos. An abort counts as presence.

A frame at a wrong bit rate breaks the traffic of the others. So at another rate the adapter first listens, without
acknowledging: a whole frame proves the rate, errors disprove it, silence proves nothing; slcan reports no errors.
Source of the broadcast: a public demo driver; the rest: CiA 301.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from enum import Enum
from typing import Final, NamedTuple

from motorbus.core.family import Found, Identity
from motorbus.core.request import ANY, EVERY_LANE, Priority, Request, Response, TimeoutClass
from motorbus.core.scan import BitrateRestored, Skipped
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, WaitFor, catch, gather
from motorbus.errors import LinkError, LinkLost, NoReply, RequestError, WireError
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.identity import identify, is_bus_error, look
from motorbus.families.kst.driver.node import BusSettings, Node, check_above_zero, checked_ids
from motorbus.families.kst.driver.requests import decoded, upload
from motorbus.families.kst.notifications import BusState
from motorbus.families.kst.profiles import RATES, bit_rate_code

PASSES: Final = 2  # a silent id is read twice: a servo may miss the first frame after power-up
BATCH: Final = 16  # ids that are read at the same time
SHORT_LISTEN: Final = 0.25
"""s to listen at a rate that the caller has named; two periods of traffic at 10 Hz."""
LISTEN: Final = 1.0  # s to listen at each rate of `scan_bit_rates`
WRONG_RATE: Final = "the first frame caused a bus error and had no reply: this bus uses another rate"
OTHER_FORMAT: Final = "no reply; servos with 29-bit identifiers need id_format=ext, others id_format=std"
ERRORS: Final = "two servos with one id, another rate on the bus, bad wiring, or a missing terminator"
TWICE: Final = "two answers to one request: two servos with one id; connect and provision them one at a time"
TORN: Final = "its id comes, its position never: two servos with one id, whose answers break each other"


class Suspicion(NamedTuple):
    """An event: a user should look at this node (0: the bus) at this rate (bit/s)."""

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
    is `Skipped`, and nothing follows a first broadcast that is broken. Reports `Found`, `Progress` and `Suspicion`.
    """
    nodes = checked_ids(ids or sdo.NODES)
    present = await SetBitrate(0)

    async def scan_each() -> list[Found]:
        found: list[Found] = []
        async with BitrateRestored():
            for rate in rates:
                other = rate != present
                if await _use(settings, rate, listens=other):
                    found += await _scan_at(settings, nodes, rate, broadcast=other or not ids, careful=other)
        return found

    if not rates:
        return await _scan_at(settings, nodes, present, broadcast=not ids)
    return await Exclusive(scan_each())


async def scan_bit_rates(
    settings: BusSettings,
    *,
    rates: Sequence[int] = RATES,
    isolated: bool = False,
    seconds: float = LISTEN,
) -> BitRates:
    """Find the bit rate of a bus: listen `seconds` at each rate, then, only with `isolated`, send.

    The search ends at a rate with a whole frame. `isolated` says that no machine depends on this bus. A rate that the
    adapter lacks is `Skipped`. Raises RequestError for an impossible rate, and, unless `isolated`, for an adapter that
    cannot listen.
    """
    for rate in rates:
        bit_rate_code(rate)
    check_above_zero("seconds", seconds, "s")

    async def search() -> BitRates:
        activity: dict[int, LineActivity] = {}
        async with BitrateRestored():
            for number, rate in enumerate(rates, 1):
                what = await catch(listen(settings, rate, seconds))
                if isinstance(what, LineActivity):
                    activity[rate] = what
                    if what is LineActivity.TRAFFIC:
                        return BitRates(rate, activity)
                    await Emit(Progress(number, len(rates), f"{rate} bit/s: {what.value}"))
                elif isinstance(what, LinkError) and not isinstance(what, LinkLost):
                    await Emit(Skipped(rate, what.summary))  # the adapter cannot listen, or lacks this rate
                else:
                    raise what
            if not activity and not isolated:
                raise RequestError(
                    "this adapter cannot listen without taking part, so its bit rate is not searched for",
                    expected="an adapter with a listen-only mode, or isolated=True if nothing depends on this bus",
                )
            activity = activity or dict.fromkeys(rates, LineActivity.SILENCE)
            for rate in activity if isolated else ():
                if activity[rate] is LineActivity.SILENCE and await _use(settings, rate, listens=False):
                    found = await _scan_at(settings, sdo.NODES, rate, broadcast=True, careful=True)
                    if found:
                        return BitRates(rate, activity, tuple(found))
        return BitRates(None, activity)

    return await Exclusive(search())


# -- rates -----------------------------------------------------------------------------------------------------


async def listen(settings: BusSettings, rate: int, seconds: float) -> LineActivity:
    """Listen at this rate without sending. Raises LinkError when the adapter cannot. The rate stays set."""
    await SetBitrate(rate, listen_only=True)
    state = settings.state or BusState()
    frames, errors = state.frames, state.errors
    frame, error = await gather(
        WaitFor(lambda notification: not is_bus_error(notification), seconds), WaitFor(is_bus_error, seconds)
    )
    if frame is not None or state.frames > frames:
        return LineActivity.TRAFFIC
    return LineActivity.ERRORS if error is not None or state.errors > errors else LineActivity.SILENCE


async def set_named_rate(settings: BusSettings, rate: int) -> None:
    """Set this rate after listening, if the adapter can. Raises RequestError if the bus is in use at another rate."""
    activity = None
    try:
        activity = await listen(settings, rate, SHORT_LISTEN)
    except LinkLost:
        raise
    except LinkError:
        pass  # the adapter cannot listen
    if activity is LineActivity.ERRORS:
        raise RequestError(
            f"nothing is sent at {rate} bit/s: {activity.value}",
            cause="a frame at a wrong rate breaks the frames of other devices",
            advice="connect this servo alone, and call again",
        )
    await SetBitrate(rate)


async def _use(settings: BusSettings, rate: int, *, listens: bool) -> bool:
    """Set this rate, or report why it is left out."""
    try:
        await (set_named_rate(settings, rate) if listens else SetBitrate(rate))
    except LinkLost:
        raise
    except LinkError as error:
        await Emit(Skipped(rate, error.summary))
    except RequestError:
        await Emit(Skipped(rate, LineActivity.ERRORS.value))
    else:
        return True
    return False


# -- one rate --------------------------------------------------------------------------------------------------


async def _scan_at(
    settings: BusSettings, ids: Sequence[int], rate: int, *, broadcast: bool, careful: bool = False
) -> list[Found]:
    """The servos that answer at the present rate. With `careful` nothing follows a first frame that is broken."""
    state = settings.state or BusState()
    errors = state.errors
    there: list[int] = []
    if broadcast:
        answer = await broadcast_ids(settings)
        counts = Counter(reply.lane for reply in answer.replies if reply.lane in ids)
        there = list(counts)
        for node, count in counts.items():
            await Emit(Found(node, rate, None))
            if count > 1:
                await Emit(Suspicion(node, rate, TWICE))
        if careful and not there and state.errors > errors:
            await Emit(Suspicion(0, rate, WRONG_RATE))
            return []
    for number in range(PASSES):
        done = number * len(ids)
        for batch in _batches([node for node in ids if node not in there]):
            answers = await gather(*[_answers(Node(node, settings), rate) for node in batch])
            there += [node for node, answered in zip(batch, answers, strict=True) if answered]
            done += len(batch)
            await Emit(Progress(done, PASSES * len(ids), f"ids up to {batch[-1]} at {rate} bit/s"))
    if state.errors > errors:
        await Emit(Suspicion(0, rate, f"{state.errors - errors} bus errors during the scan: {ERRORS}"))
    if not there and not careful:
        await Emit(Suspicion(0, rate, OTHER_FORMAT))
    found: list[Found] = []
    for batch in _batches(sorted(there)):
        nodes = [Node(node, settings) for node in batch]
        if not broadcast:
            for seen in await gather(*map(look, nodes)):
                if seen.replies > 1:
                    await Emit(Suspicion(seen.node, rate, TWICE))
        found += await _identify(nodes, rate)
    return found


def _batches(nodes: Sequence[int]) -> list[Sequence[int]]:
    return [nodes[start : start + BATCH] for start in range(0, len(nodes), BATCH)]


def broadcast_ids(settings: BusSettings, priority: Priority = Priority.CONFIGURATION) -> Request[Response]:
    """Read the node id of all servos; their replies follow each other by arbitration."""
    row = settings.profile.table["node_id"]

    def decode(answer: Response) -> Response:
        pairs = zip(answer.replies, decoded(answer), strict=True)
        mine = tuple(reply for reply, one in pairs if one.index in (row.address, 0))
        return answer._replace(replies=mine)  # without late replies to other requests

    return Request(settings.upload(sdo.BROADCAST, row), ANY, decode, lane=EVERY_LANE, priority=priority)


async def _answers(node: Node, rate: int) -> bool:
    """Whether a servo answers, also with an invalid reply."""
    row, within = node.table["node_id"], TimeoutClass.SCAN
    try:
        await upload(node, row, lambda _: None, priority=Priority.CONFIGURATION, reply_within=within)
    except NoReply:
        return False
    except WireError as error:
        await Emit(Suspicion(node.node, rate, error.summary))
    await Emit(Found(node.node, rate, None))
    return True


async def _identify(nodes: Sequence[Node], rate: int) -> list[Found]:
    identities = await gather(*[catch(identify(node)) for node in nodes])
    positions = await gather(*[catch(position(node)) for node in nodes])
    found: list[Found] = []
    for node, identity, place in zip((one.node for one in nodes), identities, positions, strict=True):
        if not isinstance(identity, Identity):
            found.append(Found(node, rate, None))
            continue
        found.append(Found(node, rate, identity))
        pending = identity.details["reads_back_id"]
        if pending not in (None, node):
            what = f"answers as {node} and reads back the id {pending}: written, in force after a restart"
            await Emit(Suspicion(node, rate, what))
        if isinstance(place, NoReply):
            await Emit(Suspicion(node, rate, TORN))
    return found
