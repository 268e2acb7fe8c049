"""Every exchange that the driver has with a FEETECH servo, of both byte orders; each judges what it is told.

What is written is another value each time. Success must mean that the servo holds it; after a failure it holds the old
value or the new one, and never a third. What does not name a servo leaves it as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

from motorbus.core.request import Expected, Reply, Request, Response, TimeoutClass
from motorbus.errors import MotorbusError
from motorbus.families.feetech import FAMILY, Servo, protocol
from motorbus.families.feetech.driver.bus import HELD, hold_request
from motorbus.families.feetech.driver.requests import (
    PRESENT,
    Block,
    acknowledged,
    read_block,
    unanswered,
    verified,
    write_block,
)
from tests.support.rigs.feetech import FEEDBACK, IDS, Rig, ping
from tests.support.single_faults import Overheard

GOAL_TIME = 44  # on HLS the goal torque; a word of RAM that moves nothing while a servo is limp
GROUP = (1, 2, 3)


class Kind(NamedTuple):
    """An exchange: how it is carried out and judged, how many bytes it has there and back, and what is done before."""

    act: Callable[[Rig], None]
    there: int
    back: int
    before: Callable[[Rig], None] = lambda rig: None
    sure: bool = True  # it may be said again, so it gets over any single fault


def reading(count: int) -> Kind:
    """READ from the position on; the bytes behind it do not change."""

    def act(rig: Rig) -> None:
        raw = rig.stir()
        memory = rig.servos[1].memory
        block = read_block(Servo(rig.bus, 1), 56, count, bytes)
        plain: Request[Response] = Request(block.wire, block.expected, repeatable=True)
        told = rig.bus.run(plain).replies[0].data
        assert told[4] == 0, "an alarm that nobody has"
        assert told[5:-1] == (rig.code(raw) + memory.read(58, FEEDBACK)[: max(0, count - 2)])[:count]

    return Kind(act, 8, 6 + count)


def _written(rig: Rig, exchange: Request[Any], held: Callable[[], object], new: object) -> None:
    others = {id: bytes(servo.memory.live) for id, servo in rig.servos.items() if id not in GROUP}
    old = held()
    try:
        rig.bus.run(exchange)
    except MotorbusError:
        assert held() in (old, new), "it was made to hold what nobody has sent"
        raise
    finally:
        assert others == {id: bytes(rig.servos[id].memory.live) for id in others}, "somebody else has obeyed"
    assert held() == new, "a false success"


def _word(rig: Rig) -> bytes:
    rig.count += 1
    return rig.code(rig.count * 7919 % 1000)


def writing(count: int) -> Kind:
    """WRITE of one byte, or of a word."""

    def act(rig: Rig) -> None:
        data, memory = _word(rig)[-count:], rig.servos[1].memory
        exchange = write_block(Servo(rig.bus, 1), Block(GOAL_TIME, data))
        _written(rig, exchange, lambda: memory.read(GOAL_TIME, count), data)

    return Kind(act, 7 + count, 6)


def write_and_read_back(rig: Rig) -> None:
    """As what matters is written: an acknowledgement alone proves that something was heard."""
    data, memory = _word(rig), rig.servos[1].memory
    servo, block = Servo(rig.bus, 1), Block(GOAL_TIME, data)

    async def both() -> None:
        await write_block(servo, block)
        await verified(servo, block)

    rig.bus.run(both())
    assert memory.read(GOAL_TIME, 2) == data, "a false success"


def reg_write(rig: Rig) -> None:
    """Success means that it waits in the servo."""
    data, servo = _word(rig), rig.servos[1]
    block = Block(GOAL_TIME, data, repeatable=False)
    exchange = acknowledged(Servo(rig.bus, 1), protocol.reg_write(1, GOAL_TIME, data), block)
    _written(rig, exchange, lambda: servo.pending, (GOAL_TIME, data))


def action(rig: Rig) -> None:
    """Success means that what waited is done."""
    servo = rig.servos[1]
    assert servo.pending is not None
    data = servo.pending[1]
    exchange = acknowledged(Servo(rig.bus, 1), protocol.action(1), Block(0, b"", repeatable=False))
    _written(rig, exchange, lambda: servo.memory.read(GOAL_TIME, 2), data)
    assert servo.pending is None


def sync_write(rig: Rig) -> None:
    """Nobody answers it, so success means that it was sent; a servo obeys it, or has not heard it."""
    data = [_word(rig) for _ in GROUP]
    before = [rig.servos[id].memory.read(GOAL_TIME, 2) for id in GROUP]
    rig.bus.run(
        unanswered(protocol.sync_write(GOAL_TIME, list(zip(GROUP, data, strict=True))), Block(0, b"").effect)
    )
    rig.link.advance(0.1)
    after = [rig.servos[id].memory.read(GOAL_TIME, 2) for id in GROUP]
    assert after in (before, data), "some have obeyed what was not said"


def sync_read(rig: Rig) -> None:
    """A node may be missing; one that is there is right."""
    raw = rig.stir()
    dues = tuple(Expected(node, node, 8) for node in GROUP)
    answer: Response = rig.bus.run(Request[Response](protocol.sync_read(56, 2, GROUP), dues, repeatable=True))
    told = {reply.data[2]: reply.data[5:7] for reply in answer.replies}
    assert told == dict.fromkeys(set(GROUP) - set(answer.missing), rig.code(raw))


def _once(rig: Rig, packet: bytes) -> Request[Any]:
    """An instruction that is not sent twice."""
    block = Block(0, b"", repeatable=False)
    return acknowledged(Servo(rig.bus, 1), packet, block, timeout=TimeoutClass.STORE)


def restore(rig: Rig) -> None:
    """RESET, known as factory restore: what was set is as shipped."""
    memory = rig.servos[1].memory
    exchange = _once(rig, protocol.factory_restore(1))
    shipped = memory.shipped[13]
    _written(rig, exchange, lambda: memory.live[13], shipped)


def _set_apart(rig: Rig) -> None:
    rig.link.advance(2.0)  # a servo is deaf while it restores itself
    memory = rig.servos[1].memory
    memory.live[13] = memory.shipped[13] - 1


def calibration(position: int | None) -> Kind:
    """CALIBRATE 0x0B: where it stands reads as was asked for, or as the middle of the turn."""

    def act(rig: Rig) -> None:
        servo = rig.servos[1]
        request = protocol.calibrate(1, b"" if position is None else rig.code(position))
        exchange = _once(rig, request)
        _written(rig, exchange, lambda: servo.raw_position, 2048 if position is None else position)

    return Kind(act, 6 if position is None else 8, 6, lambda rig: _stand(rig, 1000), sure=False)


def _stand(rig: Rig, raw: int) -> None:
    rig.link.advance(0.2)  # what it stores takes its time
    servo = rig.servos[1]
    servo.memory["homing_offset"] = 0  # at one pose the offset that a calibration needs does not fit
    servo.set_zero()
    servo.raw_position = raw


def clear_turns(rig: Rig) -> None:
    """CLEAR TURNS 0x0A: it tells a position within one turn."""
    servo = rig.servos[1]
    exchange = _once(rig, protocol.clear_turns(1))
    _written(rig, exchange, lambda: servo.raw_position, servo.raw_position % 4096)


TORQUE, GOAL = 40, 42


def _let_be(rig: Rig) -> None:
    """What is late has come by then. Neither a stop waits for that, nor who listens for more than one answer."""
    rig.link.advance(0.1)


def _stiff(rig: Rig) -> None:
    """Everyone has torque, so that it shows who was let go."""
    _let_be(rig)
    for servo in rig.servos.values():
        servo.memory.live[TORQUE] = 1


def _switches(rig: Rig) -> dict[int, int]:
    return {id: servo.memory.live[TORQUE] for id, servo in rig.servos.items()}


def limp(rig: Rig) -> None:
    """What an emergency stop says to each by its name."""
    memory = rig.servos[1].memory
    exchange = FAMILY.open().stop({1: None}).requests[1]
    _written(rig, exchange, lambda: memory.live[TORQUE], 0)


def limp_unanswered(number: int, whom: Collection[int]) -> Kind:
    """What it says to many at once: nobody answers, so they are all let go, or have not heard it."""
    driver = FAMILY.open() if len(whom) == len(IDS) else FAMILY.open(estop_hold="4")
    exchange = driver.stop(dict.fromkeys(() if len(whom) == len(IDS) else whom)).requests[number]
    assert isinstance(exchange.wire, bytes)

    def act(rig: Rig) -> None:
        before = _switches(rig)
        rig.bus.run(exchange)
        rig.link.advance(0.1)
        after = {id: 0 if id in whom else torque for id, torque in before.items()}
        assert _switches(rig) in (before, after), "somebody else has obeyed, or only some"

    return Kind(act, len(exchange.wire), 0, _stiff)


def ask_to_hold(rig: Rig) -> None:
    """READ of all that decides what holds a servo."""
    raw = rig.stir()
    answer: Response = rig.bus.run(hold_request(1, None))
    assert [reply.data[5:-1] for reply in answer.replies] == [_image(rig, raw)]


def _image(rig: Rig, raw: int) -> bytes:
    return rig.servos[1].memory.read(0, PRESENT) + rig.code(raw)


def hold(rig: Rig) -> None:
    """What it is told then: to be where it is. Success means that this is its goal."""
    raw, memory = rig.stir(), rig.servos[1].memory
    told = Reply(1, 1, protocol.frame(1, 0, _image(rig, raw)))
    exchange = hold_request(1, Response((told,), (), rig.link.now()))
    assert exchange.wire == protocol.write(1, GOAL, rig.code(raw))
    _written(rig, exchange, lambda: memory.read(GOAL, 2), rig.code(raw))


_COMMON = {
    "ping": Kind(ping, 6, 6),
    "read 1 byte": reading(1),
    "read 2 bytes": reading(2),
    "read 4 bytes": reading(4),
    "read 15 bytes": reading(FEEDBACK),
    "write 1 byte": writing(1),
    "write 2 bytes": writing(2),
    "write 2 bytes and read back": Kind(write_and_read_back, 9, 6),
    "reg write": Kind(reg_write, 9, 6, sure=False),
    "action": Kind(action, 6, 6, reg_write, sure=False),
    "sync write": Kind(sync_write, 8 + 3 * len(GROUP), 0),
    "restore": Kind(restore, 6, 6, _set_apart, sure=False),
    "stop: one is let go": Kind(limp, 8, 6, _stiff, sure=False),  # a stop says it again in its next round
    "stop: all are let go": limp_unanswered(0, IDS),
    "stop: some are let go": limp_unanswered(0, GROUP),
}
KINDS: dict[str, dict[str, Kind]] = {
    "sts3215": {
        **_COMMON,
        "sync read 3 x 2 bytes": Kind(sync_read, 11, 24),
        "calibrate": calibration(None),
        "stop: one is asked for what holds it": Kind(ask_to_hold, 8, 6 + HELD, _stiff, sure=False),
        "stop: one is held": Kind(hold, 9, 6, _stiff, sure=False),
    },
    "scs215": _COMMON,
    "hls3606": {
        "calibrate to a position": calibration(300),
        "clear turns": Kind(clear_turns, 6, 6, lambda rig: _stand(rig, 5000), sure=False),
    },
}
"""By model: little-endian, big-endian, and one that obeys what the others do not."""


def another_request(heard: Overheard) -> bool:
    """Is there, in what the servos heard, a packet with a right sum that nobody has sent?"""
    data = heard.heard
    for start in range(len(data) - 5):
        size = data[start + 3] + 4
        packet = data[start : start + size]
        sound = packet[:2] == b"\xff\xff" and len(packet) == size >= 6 and sum(packet[2:]) & 0xFF == 0xFF
        if sound and packet not in heard.said:
            return True
    return False
