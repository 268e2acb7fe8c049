"""Forgetting the turns that a servo has counted: instruction 0x0A, where its firmware obeys it.

Some SDKs call it RESET, and so they call 0x06, which overwrites every setting: here it is `clear_turns`, and that
one is `factory_restore`. HLS and brushless ST servos obey it; an STS3215 with firmware 3.10 is silent. A limp servo
cannot run back the turns that it has forgotten, so the torque goes off first.
Source: FEETECH SDK, hls.py (reset: clears the turn count); a public STS3215 table (for brushless ones); servolab,
measured on an STS3215 with firmware 3.10 (ignored).
"""

from __future__ import annotations

from motorbus.core.register import Register
from motorbus.core.request import Effect, Priority, TimeoutClass
from motorbus.core.steps import Exclusive
from motorbus.errors import DeviceError, MotorbusError, RequestError, VerificationFailed
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import DOUBTS, PRESENT, Block, acknowledged, read_block
from motorbus.families.feetech.driver.identity import prepare, writable
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.torque import disable_torque
from motorbus.families.feetech.table import CONTROL


async def clear_turns(node: Node) -> float:
    """Forget the turns it has counted; gives the position (rad) afterwards, which lies within one turn.

    It goes limp and stays so. Where it stands within its turn is as before, but how often it had turned is lost: home
    the machine again before it moves. Raises RequestError, with nothing sent, where no servo of its map is known to
    obey; DeviceError when it stays silent, VerificationFailed when it acknowledges and still counts turns.
    """
    await prepare(node)
    table = await writable(node)
    if not CONTROL[table.name].clear_turns:
        raise _unknown(node, table.name)
    return await Exclusive(_cleared(node, table["present_position"], CONTROL[table.name].turn))


async def _cleared(node: Node, position: Register, turn: int) -> float:
    before = await read_block(node, PRESENT, position.size, position.decode)
    await disable_torque(node)
    order = Block(0, b"", Effect.PERSISTENT)
    doubt: MotorbusError | None = None
    try:
        await acknowledged(
            node,
            wire.clear_turns(node.node),
            order,
            priority=Priority.CONFIGURATION,
            timeout=TimeoutClass.STORE,
        )
    except DOUBTS as error:
        doubt = error

    def told(data: bytes) -> float:
        here = position.decode(data)
        within = 0 <= here < turn
        if doubt is not None and not (within and not 0 <= before < turn):
            raise _silent(node) from doubt
        if not within:
            raise _still(node, here, turn)
        return float(node.value(position, here))

    return await read_block(node, PRESENT, position.size, told, timeout=TimeoutClass.STORE)


def _still(node: Node, here: int, turn: int) -> VerificationFailed:
    return VerificationFailed(
        f"node {node.node} still tells the raw position {here} after its turns were to be forgotten",
        expected=f"0 to {turn - 1}",
        cause="its firmware does not obey this instruction, or answers it without doing anything",
        advice="a power cycle forgets the turns; it is limp now",
        node=node.node,
    )


def _silent(node: Node) -> DeviceError:
    assert node.identity is not None
    return DeviceError(
        f"node {node.node} ({node.identity.model}, firmware {node.identity.firmware}) answers, but not to the order "
        "to forget its turns (0x0A)",
        cause="not every firmware knows it: an STS3215 with firmware 3.10 ignores it, HLS and brushless ST servos obey",
        advice="a power cycle forgets the turns; it is limp now",
        node=node.node,
        code=int(wire.Instruction.CLEAR_TURNS),
    )


def _unknown(node: Node, register_map: str) -> RequestError:
    known = sorted(name for name, control in CONTROL.items() if control.clear_turns)
    return RequestError(
        f"node {node.node}: no servo with the register map {register_map} is known to count turns and to forget them",
        expected=f"a servo with one of the maps {', '.join(known)}",
        advice="nothing was sent",
        node=node.node,
    )
