"""The template: refusals that are shorter than the reply, lengths of probes, interrupted moves."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from motorbus_template import FAMILY, driver
from motorbus_template.protocol import REPLY, Command, encode
from motorbus_template.registers import TABLE
from motorbus_template.simulator import Metronomes

from motorbus.bus.sync import SyncTable
from motorbus.core.request import ANY, Expected, Request
from motorbus.errors import DeviceError
from motorbus.link.memory import MemoryLink
from tests.support.world import Interrupting, make_bus, world


def test_refused_read_and_write_raise_device_error_with_the_code() -> None:
    bus = make_bus(MemoryLink(FAMILY.simulator((1,)), rate=FAMILY.link.rate), FAMILY.open())
    servo = FAMILY.devices.blocking(bus, 1)
    unknown = driver.request(servo, Command.READ, bytes((0x40, 4)), size=4, decode=bytes)
    locked = driver.write_row(servo, TABLE["min_position"], 0)
    for request, code, words in ((unknown, 1, "no such register"), (locked, 4, "locked")):
        with pytest.raises(DeviceError, match=words) as raised:
            bus.run(request)
        assert raised.value.code == code
    assert bus.statistics.of(1).retries == 0
    assert servo.ping() is True
    bus.close()


def test_refused_stop_is_no_acknowledgement() -> None:
    simulator = Metronomes((1,))
    bus = make_bus(MemoryLink(simulator, rate=FAMILY.link.rate), FAMILY.open())
    FAMILY.devices.blocking(bus, 1).ping()
    simulator.nodes[1].reply = lambda *_: encode(REPLY, 1, 5)  # type: ignore[method-assign]
    outcome = bus.estop()
    assert (outcome.acknowledged, outcome.silent) == ((), (1,))
    bus.close()


def test_node_that_owes_a_reply_also_owes_its_refusal() -> None:
    table = SyncTable(FAMILY.open())
    table.mark_owed(0, Expected(1, 1, 11, 7), 0.0)
    assert table.take_owed(0, 1, 7)
    assert table.take_owed(0, 1, 11)
    assert not table.take_owed(0, 1, 9)


def test_probe_reply_has_length_of_no_other_reply() -> None:
    def lengths(requests: list[Request[Any]]) -> set[int]:
        return {expected.length for one in requests if one.expected is not ANY for expected in one.expected}

    node = driver.Node(1)
    rows = [driver.read_row(node, row) for row in TABLE.values()]
    probes = lengths([driver.probe(node, attempt) for attempt in range(16)])
    assert len(probes) == 16
    assert probes.isdisjoint(lengths([*rows, driver.health(node), driver.stop(node)]))


@pytest.mark.parametrize("moment", range(1, 9))
def test_move_stops_servo_when_interrupted_at_any_frame(moment: int) -> None:
    with world(FAMILY, ids=(1,), link=Interrupting) as there:
        servo = there.device(1)
        link: Any = there.link
        servo.enable_torque()
        link.countdown, link.after = moment, True
        with pytest.raises(KeyboardInterrupt):
            servo.move(1.0)
        link.advance(2.0)
        assert servo.position() < 0.1


def test_interrupted_move_does_not_stop_later_move() -> None:
    async def move_twice() -> float:
        bus = there.async_bus()
        servo = FAMILY.devices.awaiting(bus, 1)
        await servo.enable_torque()
        first = asyncio.ensure_future(servo.move(1.5))
        await asyncio.sleep(0)
        await servo.move(-0.5, wait=False)
        first.cancel()
        await asyncio.wait([first])
        there.link.advance(2.0)
        position: float = await servo.position()
        await bus.close()
        return position

    with world(FAMILY, ids=(1,)) as there:
        assert asyncio.run(move_twice()) == pytest.approx(-0.5, abs=0.01)
