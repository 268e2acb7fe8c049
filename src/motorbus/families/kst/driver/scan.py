"""Find servos.

A scan reads the node id: of all servos by one broadcast, then of each id that did not answer. It writes nothing: a
write to the target position presets the encoder of some servos. An abort is an answer too. Source of the broadcast: a
public demo driver. A frame at a wrong bit rate destroys frames of other devices, so other rates are tried only on
request.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final, NamedTuple

from motorbus.core.family import Found, Identity
from motorbus.core.request import Priority, TimeoutClass
from motorbus.core.scan import scan_rates
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, catch, gather
from motorbus.errors import NoReply, WireError
from motorbus.families.kst import sdo
from motorbus.families.kst.driver.broadcast import broadcast_ping
from motorbus.families.kst.driver.identity import identify
from motorbus.families.kst.driver.node import BusSettings, Node, checked_id
from motorbus.families.kst.driver.provisioning import second_servo
from motorbus.families.kst.driver.requests import upload
from motorbus.families.kst.profiles import bit_rate_code

PASSES: Final = 2  # a silent id is read twice: a servo may miss the first frame after power-up
OTHER_FORMAT: Final = "no reply; servos with 29-bit identifiers need id_format=ext, others id_format=std"


class ScanWarning(NamedTuple):
    """An event: a user should check this node (0: the bus) at this rate (bit/s)."""

    node: int
    rate: int
    what: str


async def scan(settings: BusSettings, ids: Sequence[int] = (), rates: Sequence[int] = ()) -> list[Found]:
    """All servos that answer, with their identity. `ids` (): all; `rates` (): the present one.

    Reports `Found`, `Progress`, `ScanWarning`, and `Skipped` for a rate that the adapter lacks. Raises RequestError for
    an impossible id or rate.
    """
    nodes = list(dict.fromkeys(map(checked_id, ids)))
    for rate in rates:
        bit_rate_code(rate)  # raises
    if rates:
        return await Exclusive(scan_rates(rates, partial(_scan_at, settings, nodes)))
    return await _scan_at(settings, nodes, await SetBitrate(0))  # 0 reads the rate


async def _scan_at(settings: BusSettings, ids: Sequence[int], rate: int) -> list[Found]:
    """The servos that answer at the present rate (bit/s). Without `ids` a broadcast comes first."""
    nodes = ids or sdo.NODES
    answering = list(() if ids else await broadcast_ping(settings))
    for node in answering:
        await Emit(Found(node, rate, None))
    for number in range(1, PASSES + 1):
        silent = [node for node in nodes if node not in answering]
        answers = await gather(*[_answers(Node(node, settings), rate) for node in silent])
        answering += [node for node, answered in zip(silent, answers, strict=True) if answered]
        await Emit(Progress(number, PASSES, f"{rate} bit/s"))
    if not answering:
        await Emit(ScanWarning(0, rate, OTHER_FORMAT))
    return list(await gather(*[_identify(Node(node, settings), rate) for node in sorted(answering)]))


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


async def _identify(servo: Node, rate: int) -> Found:
    """Identify this servo, without identity where that fails; reports two servos, and an id not yet in force."""
    if second := await second_servo(servo):
        what = f"two servos with one id: {second}; connect and provision them one at a time"
        await Emit(ScanWarning(servo.node, rate, what))
    identity = await catch(identify(servo))
    if not isinstance(identity, Identity):
        return Found(servo.node, rate, None)
    pending = identity.details["reads_back_id"]
    if pending not in (None, servo.node):
        what = f"answers as {servo.node} and reads back the id {pending}: written, in force after a restart"
        await Emit(ScanWarning(servo.node, rate, what))
    return Found(servo.node, rate, identity)
