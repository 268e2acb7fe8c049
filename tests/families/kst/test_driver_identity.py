"""Who is there; ids and rates that are in force only after a save and a restart."""

from __future__ import annotations

import pytest

from motorbus.errors import DeviceError, NoReply, RequestError, VerificationFailed
from motorbus.families.kst.driver import identity as driver
from motorbus.families.kst.driver.identity import write_node_id
from motorbus.families.kst.profiles import BIT_RATES, bit_rate_code
from tests.families.kst.bench import abort, bench, node, play

ID = "605#4000300000000000"
FIRMWARE = "605#400A100000000000"
SOFTWARE = "605#400B100000000000"
TOLD = "4f00300005000000"
ABSENT = 0x0602_0000


def test_a_refusal_is_an_answer_and_silence_is_none() -> None:
    assert play(driver.ping(node()), (ID, TOLD)) is True
    assert play(driver.ping(node()), (ID, abort(0x3000, ABSENT))) is True
    assert play(driver.ping(node()), (ID, None)) is False


def test_what_it_is_taken_for_and_what_it_tells() -> None:
    identity = play(driver.identify(node()), (ID, TOLD), (FIRMWARE, "430a1000312e3233"))
    assert (identity.node, identity.table, identity.firmware) == (5, "kst", "1.23")
    assert identity.details == {"profile": "kst", "id_format": "std", "reads_back_id": 5}
    mute = play(driver.identify(node()), (ID, abort(0x3000, ABSENT)), (FIRMWARE, abort(0x100A, 0x0800_0000)))
    assert (mute.firmware, mute.details["reads_back_id"]) == ("unknown", None)
    with pytest.raises(NoReply):
        play(driver.identify(node()), (ID, None))


def test_the_version_is_where_the_profile_says() -> None:
    newer = node("kst-ext")
    assert (
        play(driver.version(newer), (FIRMWARE, abort(0x100A, ABSENT)), (SOFTWARE, "430b100056310000")) == "V1"
    )
    with pytest.raises(DeviceError, match="software_version"):
        play(driver.version(newer), (FIRMWARE, abort(0x100A, ABSENT)), (SOFTWARE, abort(0x100B, ABSENT)))
    with pytest.raises(DeviceError, match="hardware"):
        play(driver.version(newer), (FIRMWARE, abort(0x100A, 0x0606_0000)))
    assert play(driver.version(node()), (FIRMWARE, "430a100001020380")) == "01 02 03 80"


@pytest.mark.parametrize("pending", ["pending", "active"])
def test_an_id_is_in_force_after_save_and_restart_only(pending: str) -> None:
    with bench(pending_id=pending) as there:
        servo = there.servo()
        servo.set_node_id(9)
        assert servo.node_id() == {"pending": 9, "active": 5}[pending]
        there.sim().power_cycle()
        assert (servo.ping(), there.servo(9).ping()) == (True, False)
        servo.set_node_id(9)
        servo.save()
        assert (servo.ping(), there.servo(9).ping()) == (True, False)
        there.sim().power_cycle()
        assert (servo.ping(), there.servo(9).ping()) == (False, True)


def test_an_id_that_reads_back_as_neither_is_told() -> None:
    write = ("605#2200300009000000", "6000300000000000")
    with pytest.raises(VerificationFailed, match="reads back 7"):
        play(write_node_id(node(), 9), write, (ID, "4f00300007000000"))
    play(write_node_id(node(), 9), write, (ID, abort(0x3000, 0x0601_0001)))


def test_d2_two_servos_with_one_id_are_given_no_other() -> None:
    with bench(duplicate="5", duplicate_delay=0.0003) as there:
        with pytest.raises(RequestError, match="two servos answer"):
            there.servo().set_node_id(9)
        with pytest.raises(NoReply):
            there.servo(6).set_node_id(9)
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}


def test_an_id_that_another_servo_has_is_not_given() -> None:
    with bench((5, 9)) as there:
        with pytest.raises(RequestError, match="is taken"):
            there.servo().set_node_id(9)
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}
        there.servo().set_node_id(5)  # its own is no other's


def test_a_rate_is_in_force_after_save_and_restart_only() -> None:
    with bench() as there:
        servo = there.servo()
        servo.set_bit_rate(250_000)
        there.sim().power_cycle()
        assert there.sim().bit_rate == 500_000
        servo.set_bit_rate(250_000)
        servo.save()
        there.sim().power_cycle()
        assert there.sim().bit_rate == 250_000
        assert servo.ping() is False


def test_the_codes_are_those_of_the_manual() -> None:
    assert [bit_rate_code(rate) for rate in BIT_RATES.values()] == list(range(8))
    for rate in (0, 10_000, 5, True):
        with pytest.raises(RequestError, match="no rate"):
            bit_rate_code(rate)
    play(driver.set_bit_rate(node(), 1_000_000), ("605#2201300007000000", "6001300000000000"))


RATE = "605#4001300000000000"


def test_a_rate_is_told_where_it_can_be_read() -> None:
    assert play(driver.bit_rate(node()), (RATE, "4f01300005000000")) == 500_000
    assert play(driver.bit_rate(node()), (RATE, "4f01300009000000")) is None
    for code in (0x0601_0001, 0x0602_0000):
        assert play(driver.bit_rate(node()), (RATE, abort(0x3001, code))) is None
    assert play(driver.bit_rate(node()), (RATE, None), (ID, TOLD)) is None
    with pytest.raises(NoReply):
        play(driver.bit_rate(node()), (RATE, None), (ID, None))
    with pytest.raises(DeviceError):
        play(driver.bit_rate(node()), (RATE, abort(0x3001, 0x0606_0000)))
