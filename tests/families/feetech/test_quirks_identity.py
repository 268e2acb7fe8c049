"""Quirks of ids and of the lock: two servos of one id, a change that hits both, a lock that stays open.

Each test is named after its number in docs/reference/feetech-quirks.md, and says what real servos were seen to do and
who saw it.
"""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.errors import MotorbusError, RequestError, WireError
from motorbus.link.base import PerfectLine
from tests.families.feetech.quirk_bus import Lossy, bench, instruction, writes_to

ID, LOCK = 5, 55
WRITE = 3


def all_of(there: Any) -> list[Any]:
    """Every simulated servo, those with one id included."""
    return list(there.simulation.simulator.servos)


def test_quirk_03_two_servos_of_one_id_are_found_out_by_listening() -> None:
    """Replies of two servos with one id collide: about 4 of 10 long reads come garbled or doubled, of one alone none.

    servolab, `id_used_twice`, measured on two STS3215; huggingface/lerobot#526.
    """
    with bench("1-2", duplicate="1", reply_jitter=0.0002) as there:
        one, other = (servo for servo in all_of(there) if servo.id == 1)
        one.raw_position, other.raw_position = 1000, 3000
        seen = there.servo(1).duplicates()
        assert seen.suspected
        assert seen.polls <= 200
        alone = there.servo(2).duplicates()
        assert (alone.suspected, alone.polls, alone.signs) == (False, 200, 0)


@pytest.mark.parametrize("jitter", [0.0, 0.0002, 0.001])
def test_quirk_04_an_id_that_two_servos_share_is_not_changed(jitter: float) -> None:
    """A new id given to two servos with one id renumbers both, and "succeeds": feetech-cli, README."""
    with bench("1", duplicate="1", reply_jitter=jitter) as there:
        all_of(there)[1].raw_position = 3000
        refusal = "two servos seem to have the id 1|two nodes with one id"
        with there.traffic() as sent, pytest.raises((RequestError, WireError), match=refusal):
            there.servo(1).set_id(7)
        assert [one for one in sent if instruction(one) == WRITE] == []
        assert [servo.id for servo in all_of(there)] == [1, 1]


@pytest.mark.parametrize("answers", ["new", "old"])
def test_quirk_05_the_lock_is_closed_under_the_new_id(answers: str) -> None:
    """Whoever closes the lock under the old id leaves the EEPROM open: fanhao375/microduck-replica#28.

    There the write of the id was acknowledged from the new id; it may as well come from the old one.
    """
    with bench("1-2", id_ack=answers) as there:
        with there.traffic() as sent:
            found = there.servo(1).set_id(7)
        assert found.node == 7
        moved = there.simulated(7)
        assert moved.memory["lock"] == 1
        assert {one[2] for one in writes_to(sent, LOCK)[-1:]} == {7}
        assert there.servo(7).read("lock") == {"lock": 1}
        moved.power_cycle()
        assert moved.id == 7  # it was stored before it was locked
        assert there.simulated(2).memory["lock"] == 1


def test_quirk_06_the_lock_is_closed_whatever_happens_and_can_be_seen() -> None:
    """An EEPROM left unlocked makes every later write permanent: strands-labs/robots#3858."""
    with bench() as there:
        servo, simulated = there.servo(), there.simulated()
        servo.write(max_temperature=60)
        assert simulated.memory["lock"] == 1
        there.simulation.line = Lossy(lambda reply: bool(simulated.memory["lock"] == 0 and len(reply) == 7))
        with pytest.raises(MotorbusError):
            servo.write(max_temperature=65)  # what would have been read back never came
        there.simulation.line = PerfectLine()
        assert servo.read("lock") == {"lock": 1}
        with there.traffic() as sent, pytest.raises(RequestError, match="later write permanent"):
            servo.write(lock=0)
        assert sent == []
