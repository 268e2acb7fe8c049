"""Where the KST CAN protocol manual is ambiguous, wrong or silent: what motorbus does, frame by frame.

The tests have the numbers of the list on the KST reference page.
"""

from __future__ import annotations

from math import radians

import pytest

from motorbus.errors import DeviceError, LimitExceeded, NoReply, OutcomeUnknown, RequestError
from motorbus.families.kst import PowerCycleNeeded, RawStatus, ScanWarning, Status
from motorbus.link.base import PerfectLine
from tests.families.kst.bench import Answers, Bench
from tests.simulators.kst.host import SAVE, frame

POSITION = "605#4002600000000000"
ID = "605#4000300000000000"
LIMITS = {"kst": 90, "kst-ext": 100, "kingmax": 100, "xqpower": 800 / 18}
"""Degrees."""


@pytest.mark.parametrize(("form", "start"), [("std", ""), ("ext", "00000")])
def test_erratum_1_identifiers_have_11_bits_or_29_by_setting(form: str, start: str) -> None:
    with Bench(settings={"id_format": form}) as bench:
        assert bench.servo().position() == 0.0
        assert bench.sent() == [f"{start}{POSITION}"]
    other = "ext" if form == "std" else "std"
    with Bench(settings={"id_format": form}, id_format=other) as bench, pytest.raises(NoReply):
        bench.servo().position()


def test_erratum_2_status_is_raw_bytes_where_it_has_the_frame_of_the_position() -> None:
    with Bench(position=0x0907) as bench:
        assert bench.servo().status() == RawStatus(7, 9)
        assert bench.sent() == [POSITION]
    with Bench(profile="kst-ext") as bench:
        assert bench.servo().status() == Status(0.0, 25.0)
        assert bench.sent() == ["605#4005600000000000"]


def test_erratum_3_node_id_is_read_with_zeros() -> None:
    with Bench() as bench:
        assert bench.servo().node_id() == 5
        assert bench.sent() == [ID]


@pytest.mark.parametrize("is_answered", [True, False])
def test_erratum_4_scan_reads_all_at_once_and_silent_ids_one_by_one(is_answered: bool) -> None:
    line = None if is_answered else Answers({"600#4000300000000000": ""})
    with Bench(7, 3, 0x25, line=line) as bench:
        assert [one.node for one in bench.bus.run(bench.bus.driver.scan())] == [3, 7, 0x25]
        with pytest.raises(RequestError, match="0 addresses all servos"):
            bench.servo(0)


@pytest.mark.parametrize("reply", ["none", "ack", "abort"])
def test_erratum_5_save_accepts_a_reply_and_waits_for_the_flash(reply: str) -> None:
    with Bench(save_reply=reply) as bench:
        start = bench.link.now()
        if reply == "abort":
            with pytest.raises(DeviceError, match="stored"):
                bench.servo().save()
        else:
            bench.servo().save()
            assert bench.servo().position() == 0.0
        assert bench.sent()[0] == f"605#{SAVE}"
        assert bench.link.now() - start >= 0.170
        assert bench.bus.statistics.of(5).retries == 0


def test_erratum_6_provision_asks_for_a_power_cycle() -> None:
    with Bench() as bench:
        with pytest.raises(OutcomeUnknown, match="did not come back within 1 s"):
            bench.servo().provision(new_id=9, timeout=1.0)
        assert bench.of(PowerCycleNeeded) == [PowerCycleNeeded(5, 9, 500_000)]
        bench.simulator.servos[0].power_cycle()
        assert bench.servo(9).ping() is True


@pytest.mark.parametrize("reads_back", [9, 5])
def test_erratum_7_either_id_may_be_read_before_the_restart(reads_back: int) -> None:
    line = Answers({ID: [*["585#4F00300005000000"] * 3, f"585#4F003000{reads_back:02X}000000"]})
    with Bench(line=line) as bench:
        servo = bench.servo()
        servo.set_node_id(9)
        assert servo.node_id() == reads_back
        servo.save()
        bench.link.line = PerfectLine()
        assert (servo.ping(), bench.servo(9).ping()) == (True, False)
        bench[5].power_cycle()
        assert (servo.ping(), bench.servo(9).ping()) == (False, True)


def test_errata_8_and_9_save_keeps_settings_and_not_the_target() -> None:
    """After a restart the target is 0, and the shaft stays."""
    with Bench(profile="kst-ext") as bench:
        servo = bench.servo()
        servo.move(radians(45))
        servo.set_bit_rate(1_000_000)
        servo.write(negative_limit=-0.5, positive_limit=1.0)
        bench[5].power_cycle()
        memory = bench[5].memory
        assert (memory["bit_rate_code"], memory["negative_limit"]) == (7, -286)
        assert (memory["goal_position"], memory["present_position"]) == (0, 450)


@pytest.mark.parametrize("code", ["00000206", "06020000"])
def test_erratum_10_abort_code_is_recognised_in_both_byte_orders(code: str) -> None:
    with Bench(line=Answers({POSITION: f"585#80026000{code}"})) as bench:
        with pytest.raises(DeviceError, match="Object does not exist") as raised:
            bench.servo().position()
        assert raised.value.code == int.from_bytes(bytes.fromhex(code), "little")


@pytest.mark.parametrize("place", ["101001", "101000", "000000"])
def test_erratum_11_abort_is_accepted_with_index_and_sub_index_or_less(place: str) -> None:
    line = Answers({f"605#{SAVE}": f"585#80{place}20000008"})
    with Bench(line=line) as bench, pytest.raises(DeviceError, match="refused store"):
        bench.servo().save()


@pytest.mark.parametrize("treatment", ["abort", "clamp"])
@pytest.mark.parametrize(("profile", "limit"), LIMITS.items())
def test_errata_12_and_13_position_outside_the_range_of_the_profile_is_not_sent(
    profile: str, limit: float, treatment: str
) -> None:
    with Bench(profile=profile, out_of_range=treatment) as bench:
        for degrees in (limit, -limit):
            bench.servo().move(radians(degrees))
            assert bench.servo().position() == pytest.approx(radians(degrees))
            bench.sent()
            with pytest.raises(LimitExceeded, match="is out of range"):
                bench.servo().move(radians(1.002 * degrees))
            assert bench.sent() == []


def test_erratum_14_half_a_count_rounds_away_from_zero() -> None:
    with Bench() as bench:
        for degrees, data in ((10.85, "6D00"), (-10.85, "93FF"), (0.05, "0100"), (0.0499, "0000")):
            bench.servo().move(radians(degrees), wait=False)
            assert bench.sent() == [f"605#22036000{data}0000"]


def test_erratum_15_bit_rate_is_not_read() -> None:
    with Bench() as bench:
        assert "bit_rate_code" not in bench.servo().read()
        with pytest.raises(RequestError, match="can only be written"):
            bench.servo().read("bit_rate_code")


@pytest.mark.parametrize("text", ["V1.2", "2"])
def test_erratum_16_a_version_has_at_most_four_characters(text: str) -> None:
    with Bench() as bench:
        bench[5].values["firmware_version"] = int.from_bytes(text.encode(), "little")
        assert bench.servo().version() == text


def test_erratum_17_missing_object_is_refused_by_name_and_left_out_of_all() -> None:
    with Bench(settings={"profile": "kst-ext"}) as bench:
        with pytest.raises(DeviceError, match="refused status: Object does not exist"):
            bench.servo().read("status")
        names = {"firmware_version", "node_id", "present_position", "goal_position"}
        assert set(bench.servo().read()) == names


def test_erratum_18_requests_have_eight_bytes_and_others_no_reply() -> None:
    with Bench() as bench:
        bench.bus.run(bench.bus.driver.scan())
        assert {len(text.partition("#")[2]) for text in bench.sent()} == {16}
        for text in ("605#40026000", "605#40026000000000", "605#"):
            bench.link.write(frame(text))
        assert bench.link.read(bench.link.now() + 0.1) == []


def test_erratum_19_impossible_id_or_rate_is_refused() -> None:
    with Bench() as bench:
        for data in ("2201300008", "22013000FF", "2200300000", "2200300080", "22003000FF"):
            bench.link.write(frame(f"605#{data}000000"))
            (reply,) = bench.link.read(bench.link.now() + 0.1)
            assert str(reply) == f"585#80{data[2:8]}30000906"
        with pytest.raises(RequestError):
            bench.servo().set_node_id(128)
        with pytest.raises(RequestError):
            bench.servo().set_bit_rate(5)
        assert bench.sent() == []


@pytest.mark.parametrize(("ids", "duplicate"), [((5, 5), ""), ((5,), "5")])
def test_erratum_20_two_servos_with_one_id_get_no_other(ids: tuple[int, ...], duplicate: str) -> None:
    """Their unequal replies break each other, or both arrive."""
    with Bench(*ids, duplicate=duplicate) as bench:
        bench.simulator.servos[1].raw_position = 7
        with pytest.raises(RequestError, match=r"two servos answer as 0x05 \(5\)"):
            bench.servo().set_node_id(9)
        assert bench.written() == []
        bench.bus.run(bench.bus.driver.scan((5,)))
        assert "two servos with one id" in bench.of(ScanWarning)[0].what


def test_erratum_21_scan_tries_the_rates_that_are_named() -> None:
    with Bench(bit_rate=250_000) as bench:
        with pytest.raises(NoReply):
            bench.servo().position()
        found = bench.bus.run(bench.bus.driver.scan((), (125_000, 250_000, 1_000_000)))
        assert [(one.node, one.rate) for one in found] == [(5, 250_000)]
        assert (bench.written(), bench.bus.rate) == ([], 500_000)


def test_erratum_22_reply_to_another_request_is_not_accepted() -> None:
    late = ["585#4B0360000B000000", "585#4B0260010B000000", "585#6002600000000000", "585#8003600000000206"]
    for other in late:
        with Bench(line=Answers({POSITION: f"{other} 585#4B02600084030000"})) as bench:
            assert bench.servo().read_raw("present_position") == {"present_position": 900}
        with Bench(line=Answers({POSITION: other})) as bench, pytest.raises(NoReply):
            bench.servo().position()
