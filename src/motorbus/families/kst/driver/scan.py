"""Find servos, and the bit rate of a bus.

A scan reads the node id, first by one broadcast that all servos answer, then of each silent id. It writes nothing: a
write to the target position presets the encoder of some servos. An abort counts as presence.

A frame at a wrong bit rate breaks the traffic of the others. So at an unknown rate the adapter first listens, without
acknowledging: a whole frame proves the rate, errors disprove it, silence proves nothing. Some adapters (slcan) report
no errors. Source of the broadcast: a public demo driver; the rest: CiA 301.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from functools import partial
from typing import Final, NamedTuple

from motorbus.core.family import Found, Identity
from motorbus.core.request import (
    ANY,
    EVERY_LANE,
    Notification,
    Priority,
    Request,
    Response,
    TimeoutClass,
)
from motorbus.core.scan import BitrateRestored, Skipped, scan_rates
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, WaitFor, catch, gather
from motorbus.errors import LinkError, LinkLost, NoReply, RequestError, WireError
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.feedback import position
from motorbus.families.kst.driver.identity import identify, is_bus_error, look
from motorbus.families.kst.driver.node import DEFAULT, BusSettings, Node, check_above_zero, checked_ids
from motorbus.families.kst.driver.requests import NODE_ID
from motorbus.families.kst.profiles import RATES, bit_rate_code
from motorbus.families.kst.sdo import SdoReply

PASSES: Final = 2
"""A silent id is read twice: a servo may miss the first frame after power-up."""
BATCH: Final = 16
"""Ids that are read at the same time."""
SHORT_LISTEN: Final = 0.25
"""s to listen at a rate that the caller has named; two periods of traffic at 10 Hz."""
LISTEN: Final = 1.0
"""s to listen at each rate of `scan_bit_rates`."""
WRONG_RATE: Final = (
    "the first frame caused a bus error and had no reply, so no more were sent: this bus uses another rate"
)
OTHER_FORMAT: Final = "no reply; servos with 29-bit identifiers need id_format=ext, others id_format=std"
TWICE: Final = (
    "two answers to one request: two servos with one id; connect them one at a time, and provision one"
)
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


async def scan(
    ids: Sequence[int] = (), rates: Sequence[int] = (), settings: BusSettings = DEFAULT
) -> list[Found]:
    """All servos that answer, with their identity. `ids` (): all; `rates` (): the present one.

    At another rate than the present one the adapter listens first; a rate at which errors show that the bus is in use
    is left out (`Skipped`). One broadcast is sent first there, and no more if it was broken. The rate is restored.
    Reports `Found`, `Progress` and `Suspicion`.
    """
    asked = checked_ids(ids or sdo.NODES)
    present = await SetBitrate(0)
    if not rates or tuple(rates) == (present,):
        return await _scan_at(settings, asked, present, broadcast=not ids)
    shares = {rate: (index, len(rates)) for index, rate in enumerate(rates)}

    async def scan_one(rate: int) -> list[Found]:
        careful = rate != present
        return await _scan_at(
            settings, asked, rate, broadcast=not ids or careful, careful=careful, share=shares[rate]
        )

    async def everywhere() -> list[Found]:
        async with BitrateRestored():
            usable = []
            for rate in rates:
                if rate != present and await _is_in_use(settings, rate):
                    await Emit(Skipped(rate, LineActivity.ERRORS.value))
                else:
                    usable.append(rate)
            return await scan_rates(usable, scan_one)

    return await Exclusive(everywhere())


async def scan_bit_rates(
    settings: BusSettings = DEFAULT,
    *,
    rates: Sequence[int] = RATES,
    isolated: bool = False,
    seconds: float = LISTEN,
) -> BitRates:
    """Find the bit rate of a bus: listen `seconds` at each rate, then, only with `isolated`, send.

    The search ends at a rate with a whole frame. If all are silent, nothing is sent unless the caller says that the
    bus is isolated: no machine depends on it. A rate that the adapter lacks is reported as `Skipped`. The rate is
    restored. Raises RequestError for an impossible rate, and for an adapter that cannot listen, unless `isolated`.
    """
    for rate in rates:
        bit_rate_code(rate)
    check_above_zero("seconds", seconds, "s")

    async def search() -> BitRates:
        async with BitrateRestored():
            return await _search(settings, tuple(rates), isolated, seconds)

    return await Exclusive(search())


# -- listen ----------------------------------------------------------------------------------------------------


async def listen(settings: BusSettings, rate: int, seconds: float) -> LineActivity:
    """Listen at this rate without sending. Raises LinkError when the adapter cannot. The rate stays set."""
    await SetBitrate(rate, listen_only=True)
    state = settings.state
    before = (state.frames, state.errors) if state else (0, 0)
    frame, error = await gather(WaitFor(_is_frame, seconds), WaitFor(is_bus_error, seconds))
    after = (state.frames, state.errors) if state else (0, 0)
    if frame is not None or after[0] > before[0]:
        return LineActivity.TRAFFIC
    return LineActivity.ERRORS if error is not None or after[1] > before[1] else LineActivity.SILENCE


def _is_frame(notification: Notification) -> bool:
    return not is_bus_error(notification)


async def set_named_rate(settings: BusSettings, rate: int) -> None:
    """Set a rate that the caller has named, after listening where the adapter can.

    Raises RequestError when errors show that the bus is in use at another rate.
    """
    if await _is_in_use(settings, rate):
        raise RequestError(
            f"nothing is sent at {rate} bit/s: {LineActivity.ERRORS.value}",
            cause="other devices speak on this bus, and a frame at a wrong rate breaks theirs",
            advice="connect this servo alone, and call again; nothing was written",
        )
    await SetBitrate(rate)


async def _is_in_use(settings: BusSettings, rate: int) -> bool:
    """Whether errors show that the bus is in use at another rate; False with an adapter that cannot listen."""
    try:
        return await listen(settings, rate, SHORT_LISTEN) is LineActivity.ERRORS
    except LinkLost:
        raise
    except LinkError:
        return False


async def _search(settings: BusSettings, rates: Sequence[int], isolated: bool, seconds: float) -> BitRates:
    activity: dict[int, LineActivity] = {}
    unable: LinkError | None = None
    for number, rate in enumerate(rates):
        try:
            activity[rate] = await listen(settings, rate, seconds)
        except LinkLost:
            raise
        except LinkError as error:  # it cannot listen, or lacks this rate
            unable = error
            await Emit(Skipped(rate, error.summary))
            continue
        if activity[rate] is LineActivity.TRAFFIC:
            return BitRates(rate, activity)
        await Emit(Progress(number + 1, len(rates), f"{rate} bit/s: {activity[rate].value}"))
    if unable is not None and not activity:
        if not isolated:
            raise RequestError(
                "this adapter cannot listen without taking part, so its bit rate is not searched for",
                cause=unable.summary,
                expected="an adapter with a listen-only mode, or a bus on which nothing depends",
                advice="if nothing depends on this bus, say isolated=True; nothing was sent",
            ) from unable
        activity = dict.fromkeys(rates, LineActivity.SILENCE)
    for rate in [rate for rate, what in activity.items() if what is LineActivity.SILENCE] if isolated else ():
        scan_one = partial(_scan_all, settings)
        if found := await scan_rates([rate], scan_one):
            return BitRates(rate, activity, tuple(found))
    return BitRates(None, activity)


async def _scan_all(settings: BusSettings, rate: int) -> list[Found]:
    return await _scan_at(settings, sdo.NODES, rate, broadcast=True, careful=True)


# -- one rate --------------------------------------------------------------------------------------------------


async def _scan_at(
    settings: BusSettings,
    asked: Sequence[int],
    rate: int,
    *,
    broadcast: bool,
    careful: bool = False,
    share: tuple[int, int] = (0, 1),
) -> list[Found]:
    """The servos that answer at the present rate, `rate`. `share`: number of this rate and of all rates.

    With `careful` nothing follows a broadcast without a reply that causes bus errors.
    """
    state = settings.state
    errors = state.errors if state else 0
    there = await _scan_by_broadcast(settings, asked, rate) if broadcast else []
    if careful and not there and state and state.errors > errors:
        await Emit(Suspicion(0, rate, WRONG_RATE))
        return []
    for number in range(PASSES):
        done = (PASSES * share[0] + number) * len(asked)
        silent = [node for node in asked if node not in there]
        for batch in _batches(silent):
            looks = await gather(*[_scan_id(Node(node, settings), rate) for node in batch])
            there += [node for node in looks if node is not None]
            done += len(batch)
            progress = f"ids up to {batch[-1]} at {rate} bit/s"
            await Emit(Progress(done, PASSES * share[1] * len(asked), progress))
    if state and state.errors > errors:
        what = (
            f"{state.errors - errors} bus errors during the scan: two servos with one id, another rate on the bus, bad "
            "wiring, or a missing terminator"
        )
        await Emit(Suspicion(0, rate, what))
    if not there and not careful:
        await Emit(Suspicion(0, rate, OTHER_FORMAT))
    if not broadcast:
        for batch in _batches(sorted(there)):
            seen = await gather(*[look(Node(node, settings)) for node in batch])
            for node, one in zip(batch, seen, strict=True):
                if one.several:
                    await Emit(Suspicion(node, rate, TWICE))
    return await _identify_all(settings, sorted(there), rate)


def _batches(nodes: Sequence[int]) -> list[Sequence[int]]:
    return [nodes[start : start + BATCH] for start in range(0, len(nodes), BATCH)]


async def _scan_by_broadcast(settings: BusSettings, asked: Sequence[int], rate: int) -> list[int]:
    """The asked ids that answer a broadcast read of the node id."""
    replies: dict[int, list[SdoReply | None]] = {}
    for reply in (await broadcast_ids(settings.extended)).replies:
        if reply.lane in asked:
            replies.setdefault(reply.lane, []).append(sdo.decode_reply(reply.data))
    for node, found in replies.items():
        await Emit(Found(node, rate, None))
        if len(found) > 1:
            await Emit(Suspicion(node, rate, TWICE))
        await _report_other_id(node, rate, found[0])
    return list(replies)


def broadcast_ids(extended: bool, priority: Priority = Priority.CONFIGURATION) -> Request[Response]:
    """Read the node id of all servos; their replies follow each other by arbitration."""

    def decode(answer: Response) -> Response:
        found = [(reply, sdo.decode_reply(reply.data)) for reply in answer.replies]
        mine = tuple(reply for reply, one in found if one is not None and one.index in (NODE_ID, 0))
        return answer._replace(replies=mine)  # without late replies to other requests

    frame = sdo.encode_upload(sdo.BROADCAST, NODE_ID, extended=extended)
    return Request(frame, ANY, decode, lane=EVERY_LANE, priority=priority)


async def _scan_id(node: Node, rate: int) -> int | None:
    """The id if a servo answers, also with an invalid reply or twice."""
    reply: SdoReply | None = None
    try:
        reply = await Request(
            sdo.encode_upload(node.node, NODE_ID, extended=node.settings.extended),
            (sdo.upload_due(node.node, NODE_ID),),
            lambda answer: sdo.decode_reply(answer.replies[0].data),
            lane=node.node,
            priority=Priority.CONFIGURATION,
            reply_within=TimeoutClass.SCAN,
            repeatable=True,
        )
    except NoReply:
        return None
    except WireError as error:
        await Emit(Suspicion(node.node, rate, f"{TWICE} ({error.summary})"))
    await Emit(Found(node.node, rate, None))
    await _report_other_id(node.node, rate, reply)
    return node.node


async def _report_other_id(node: int, rate: int, reply: SdoReply | None) -> None:
    if reply is not None and reply.kind == "upload" and reply.data[:1] != bytes((node,)):
        what = f"answers as {node} and reads back the id {reply.data[0]}: written, and not in force before a restart"
        await Emit(Suspicion(node, rate, what))


async def _identify_all(settings: BusSettings, nodes: Sequence[int], rate: int) -> list[Found]:
    found: list[Found] = []
    for batch in _batches(nodes):
        identities = await gather(*[catch(identify(Node(node, settings))) for node in batch])
        positions = await gather(*[catch(position(Node(node, settings))) for node in batch])
        for node, identity, place in zip(batch, identities, positions, strict=True):
            found.append(Found(node, rate, identity if isinstance(identity, Identity) else None))
            if isinstance(identity, Identity) and isinstance(place, NoReply):
                await Emit(Suspicion(node, rate, TORN))
    return found
