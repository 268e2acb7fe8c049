"""A refusal may be shorter than the reply: the template shows how a driver says so."""

from __future__ import annotations

import pytest
from motorbus_template import FAMILY, driver
from motorbus_template.protocol import Command, encode_reply
from motorbus_template.registers import TABLE
from motorbus_template.simulator import Metronomes

from motorbus.bus.sync import SyncTable
from motorbus.core.request import Expected
from motorbus.errors import DeviceError
from motorbus.link.memory import MemoryLink
from tests.support.world import make_bus


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
    simulator.nodes[1].reply = lambda *_: (0.0003, encode_reply(1, 5))  # type: ignore[method-assign]
    outcome = bus.estop()
    assert (outcome.acknowledged, outcome.silent) == ((), (1,))
    bus.close()


def test_node_that_owes_a_reply_also_owes_its_refusal() -> None:
    table = SyncTable(FAMILY.open())
    table.mark_owed(0, Expected(1, 1, 11, 7), 0.0)
    assert table.take_owed(0, 1, 7)
    assert table.take_owed(0, 1, 11)
    assert not table.take_owed(0, 1, 9)
