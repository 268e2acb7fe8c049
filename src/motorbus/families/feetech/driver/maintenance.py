"""Factory restore, turn count, overload."""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.family import Found
from motorbus.core.scan import BitrateRestored
from motorbus.core.steps import Exclusive, SetBitrate, Sleep, catch
from motorbus.errors import DeviceError, MotorbusError, NoReply, OutcomeUnknown, VerificationFailed, WireError
from motorbus.families.feetech import protocol
from motorbus.families.feetech.driver import feedback
from motorbus.families.feetech.driver.diagnosis import alarms
from motorbus.families.feetech.driver.identity import identify, ping, read_settings, writable
from motorbus.families.feetech.driver.motion import disable_torque, enable_torque
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.requests import PRESENT, STORE, instruct, read_block
from motorbus.families.feetech.registers.codes import BAUD_CODES

DEAF: Final = 1.1  # s without a reply after a factory restore (servolab)
SHIPPED_ID: Final = 1
TRIPS: Final = frozenset(("overload", "current"))  # alarms that outlast their cause
REST: Final = 1.0  # s without torque after which an overload is forgotten # assumption

# -- factory restore -------------------------------------------------------------------------------------------


async def factory_restore(node: Node) -> Found:
    """Torque off, then RESET (0x06): every setting as shipped; gives where the servo answers now.

    The id is kept (servolab) or 1 (feetech-cli), the rate may be that of the factory; the bus keeps its own rate.
    Raises NoReply if it does not answer afterwards, OutcomeUnknown if it answers without having acknowledged: its model
    may lack this.
    """
    table = await writable(node)
    code = table["baud_rate"].default
    shipped = (BAUD_CODES[0], BAUD_CODES[1]) if code is None else (BAUD_CODES[code],)
    try:
        return await Exclusive(_restore(node, shipped))
    finally:
        node.known.forget(written=True)


async def _restore(node: Node, shipped: tuple[int, ...]) -> Found:
    async with BitrateRestored() as before:
        rates = dict.fromkeys((before.rate, *shipped))
        places = [(id, rate) for rate in rates for id in dict.fromkeys((node.node, SHIPPED_ID))]
        own = (node.node, before.rate)
        free = [place for place in places if place == own or not await _answers(*place)]
        await SetBitrate(before.rate)
        await disable_torque(node)
        doubt = await instruct(node, protocol.factory_restore(node.node), repeatable=False)
        await Sleep(DEAF)
        place = next(iter([place for place in free if await _answers(*place)]), None)
        if place is None:
            what = f"node {node.node} does not answer after its factory values were restored"
            cause = "it has the id or rate of another servo now, or takes longer to start"
            raise NoReply(what, cause=cause, advice="scan all ids at all rates", node=node.node)
        if doubt is not None and place == own:
            what = f"node {node.node} has not acknowledged the order to restore its factory values"
            cause = "its model lacks this order, or the acknowledgement was lost"
            fix = "read a register that you had changed"
            raise OutcomeUnknown(what, cause=cause, advice=fix, node=node.node) from doubt
        await SetBitrate(place[1])
        return Found(*place, await identify(Node(place[0], node.facts)))


async def _answers(id: int, rate: int) -> bool:
    await SetBitrate(rate)
    try:
        return await ping(Node(id))
    except WireError:
        return True


# -- turns -----------------------------------------------------------------------------------------------------


async def clear_turns(node: Node) -> float:
    """Forget the counted turns (0x0A); the servo goes limp. Gives its position (rad), within one turn.

    How often it had turned is lost: home the machine. Raises RequestError for a map without it; DeviceError if it stays
    silent (an STS3215 with firmware 3.10 does), VerificationFailed if it still counts. Source: FEETECH SDK, hls.py
    (reset); servolab. 0x06, RESET in some SDKs, is `factory_restore`.
    """
    table = await read_settings(node)
    if not node.traits.clear_turns:
        raise node.refusal(f"has the map {table.name}, which counts no turns", expected="sts, smbl or hls")
    return await Exclusive(_clear_turns(node))


async def _clear_turns(node: Node) -> float:
    row, turn = node.row("present_position"), node.traits.turn
    before = await read_block(node, PRESENT, row.size, row.decode)
    await disable_torque(node)
    doubt = await instruct(node, protocol.clear_turns(node.node))
    here = await read_block(node, PRESENT, row.size, row.decode, timeout=STORE)
    cleared = 0 <= here < turn
    fix = "a power cycle forgets the turns; it is limp now"
    if doubt is not None and (not cleared or 0 <= before < turn):
        what = f"node {node.node} answers, but not to the order to forget its turns (0x0A)"
        cause = "its firmware lacks it, as that of an STS3215 does"
        raise DeviceError(what, cause=cause, advice=fix, node=node.node) from doubt
    if not cleared:
        what = f"node {node.node} still tells the raw position {here}"
        raise VerificationFailed(what, expected=f"0 to {turn - 1}", advice=fix, node=node.node)
    return float(node.value(row, here))


# -- overload --------------------------------------------------------------------------------------------------


class Recovery(NamedTuple):
    """The alarms that had tripped (() for none, and nothing was done), and those that remain, with their figures."""

    tripped: tuple[str, ...]
    remaining: tuple[str, ...]


async def recover_overload(node: Node) -> Recovery:
    """Clear a tripped overload or over-current alarm: limp for 1 s, then it holds where it stands.

    An arm sags meanwhile. Raises DeviceError, with the servo limp, if the alarm stays: then only a power cycle helps
    (open-edge-platform/physical-ai-studio#955). Source: STS3215 memory table V3.6, registers 34 to 36.
    """
    await writable(node)
    tripped = await _tripped(node)
    if tripped:
        await disable_torque(node)
        await Sleep(REST)
        try:
            await enable_torque(node)
            if await _tripped(node):
                raise DeviceError(
                    f"node {node.node}: the alarm {' and '.join(tripped)} is still set",
                    cause="some servos forget an overload only when their supply goes; or it is overloaded again",
                    advice="take its load away, then switch its supply off and on; it is limp now",
                    node=node.node,
                )
        except MotorbusError as error:
            failure = await catch(disable_torque(node))
            if failure is not None:
                error.add_note(f"node {node.node} may still hold: {failure.summary}")
            raise
    return Recovery(tripped, await alarms(node))


async def _tripped(node: Node) -> tuple[str, ...]:
    state = await feedback.telemetry(node)
    return tuple(name for name in state.alarm if name in TRIPS)
