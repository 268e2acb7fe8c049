"""Where the manual is ambiguous, wrong or silent: what the simulator does, point by point, and its other choice.

One test or more for each point of our list of its errata, by their numbers.
"""

from __future__ import annotations

import pytest

from tests.simulators.kst.host import ERROR, Host

READ = "4002600000000000"
READ_ID = "4000300000000000"
MOVE = "2203600084030000"
SAVE = "2210100173617665"


def test_erratum_1_identifiers_of_four_bytes_get_the_form_they_were_asked_in() -> None:
    host = Host()
    assert host.say(f"625#{READ}") == ["5A5#4B02600000000000"]
    assert host.say(f"00000625#{READ}") == ["000005A5#4B02600000000000"]


@pytest.mark.parametrize(("form", "std", "ext"), [("std", 1, 0), ("ext", 0, 1), ("asked", 1, 1)])
def test_erratum_1_a_servo_that_takes_one_form_only(form: str, std: int, ext: int) -> None:
    host = Host(id_format=form)
    assert (len(host.say(f"625#{READ}")), len(host.say(f"00000625#{READ}"))) == (std, ext)


def test_erratum_2_status_and_position_share_a_frame() -> None:
    assert Host(position=256).say(f"625#{READ}") == ["5A5#4B02600000010000"]
    assert Host(position=256, status_6002="x1x2", x1=7, x2=9).say(f"625#{READ}") == ["5A5#4B02600007090000"]
    assert Host(profile="kst-ext").say("625#4005600000000000") == ["5A5#4305600000001900"]


def test_erratum_3_the_data_of_a_read_are_ignored() -> None:
    assert Host().say("625#400030007F112233") == ["5A5#4F00300025000000"]


def test_erratum_4_a_broadcast_read_is_answered_by_everyone_in_order() -> None:
    host = Host(7, 3, 0x25)
    assert host.say(f"600#{READ_ID}") == [
        "583#4F00300003000000",
        "587#4F00300007000000",
        "5A5#4F00300025000000",
    ]
    assert Host(7, 3, broadcast_read="no").say(f"600#{READ_ID}") == []


@pytest.mark.parametrize(
    ("reply", "heard", "saved"),
    [("none", [], True), ("ack", ["5A5#6010100100000000"], True), ("abort", ["5A5#8010100120000008"], False)],
)
def test_erratum_5_a_save_is_not_answered_or_is(reply: str, heard: list[str], saved: bool) -> None:
    host = Host(save_reply=reply)
    host.say("625#2200300026000000")
    assert host.say(f"625#{SAVE}") == heard
    host.wait(0.2)
    assert host[0x25].status()["saved"] is saved


def test_erratum_5_while_the_flash_is_written_requests_are_lost() -> None:
    host = Host()
    host.say(f"625#{SAVE}")
    assert host.say(f"625#{READ}", f"625#{MOVE}", f"625#{READ_ID}") == []
    host.wait(0.129)
    assert host.say(f"625#{READ}") == []
    host.wait(0.001)
    assert host.say(f"625#{READ}") == ["5A5#4B02600000000000"]
    assert host[0x25].memory["goal_position"] == 0


@pytest.mark.parametrize(("cut", "node"), [("old", 0x25), ("new", 0x26)])
def test_erratum_5_a_restart_in_the_middle_of_a_save(cut: str, node: int) -> None:
    host = Host(flash_cut=cut)
    host.say("625#2200300026000000")
    host.say(f"625#{SAVE}")
    host[0x25].power_cycle()
    assert list(host.bus.nodes) == [node]


def test_erratum_6_only_the_supply_restarts_a_servo() -> None:
    host = Host()
    host.say("625#2200300026000000", f"625#{SAVE}")
    host.wait(1.0)
    assert host.say("000#8125", "000#8100", "025#8100") == []
    assert list(host.bus.nodes) == [0x25]
    host[0x25].power_cycle()
    assert list(host.bus.nodes) == [0x26]


@pytest.mark.parametrize(("pending", "told"), [("pending", 0x26), ("active", 0x25)])
def test_erratum_7_a_new_id_reads_at_once_and_the_servo_answers_under_the_old_one(
    pending: str, told: int
) -> None:
    host = Host(pending_id=pending)
    host.say("625#2200300026000000")
    assert host.say(f"625#{READ_ID}", f"626#{READ_ID}") == [f"5A5#4F003000{told:02X}000000"]
    assert host[0x25].memory["node_id"] == told


def test_erratum_8_a_save_keeps_configuration_and_never_the_target() -> None:
    host = Host(profile="kst-ext")
    host.say("625#2200300026000000", "625#2201300007000000", f"625#{MOVE}", "625#2200220064000000")
    host.say("625#220A300038FF0000", "625#220B300064000000", "625#220F300020000000", f"625#{SAVE}")
    host.wait(1.0)
    host[0x25].power_cycle()
    servo = host[0x26]
    kept = ("bit_rate_code", "negative_limit", "positive_limit", "function_enable")
    assert [servo.memory[name] for name in kept] == [7, -200, 100, 0x20]
    assert (servo.memory["goal_position"], servo.memory["report_interval"]) == (0, 20)


def test_erratum_9_after_a_restart_the_target_is_a_default_and_the_shaft_stays() -> None:
    host = Host()
    host.say(f"625#{MOVE}")
    host.wait(2.0)
    host[0x25].power_cycle()
    host.wait(2.0)
    assert (host[0x25].memory["goal_position"], host[0x25].raw_position) == (0, 900)


def test_erratum_10_an_abort_code_stands_low_byte_first() -> None:
    assert Host().say("625#4005600000000000") == ["5A5#8005600000000206"]


def test_erratum_4_a_broadcast_write_is_executed_and_acknowledged() -> None:
    host = Host(1, 2)
    assert len(host.say(f"600#{MOVE}")) == 2
    assert [servo.memory["goal_position"] for servo in host.bus.servos] == [900, 900]


def test_erratum_11_a_refusal_names_the_object() -> None:
    assert Host().say("625#4003600500000000") == ["5A5#8003600511000906"]


def test_erratum_15_the_bit_rate_cannot_be_read() -> None:
    assert Host().say("625#4001300000000000") == ["5A5#8001300001000106"]


@pytest.mark.parametrize(("raw", "code"), [("8503", "31000906"), ("7BFC", "32000906")])
def test_erratum_12_out_of_range_is_refused_or_taken_as_the_nearest(raw: str, code: str) -> None:
    host = Host()
    assert host.say(f"625#22036000{raw}0000") == [f"5A5#80036000{code}"]
    assert host[0x25].memory["goal_position"] == 0
    host = Host(out_of_range="clamp")
    assert host.say(f"625#22036000{raw}0000") == ["5A5#6003600000000000"]
    assert abs(host[0x25].memory["goal_position"]) == 900


@pytest.mark.parametrize(
    ("profile", "limit"), [("kst", 900), ("kst-ext", 1000), ("kingmax", 1000), ("xqpower", 800)]
)
def test_erratum_13_the_range_belongs_to_the_profile(profile: str, limit: int) -> None:
    host = Host(profile=profile)
    host.say("000#0125")
    for raw, first in ((limit, "60"), (-limit, "60"), (limit + 1, "80"), (-limit - 1, "80")):
        reply = host.say(f"625#22036000{raw.to_bytes(2, 'little', signed=True).hex()}0000")[0]
        assert reply.startswith(f"5A5#{first}036000")


def test_erratum_14_a_position_is_exact_in_counts() -> None:
    host = Host(position=-900)
    for raw in range(-900, 901, 37):
        host.say(f"625#22036000{raw.to_bytes(2, 'little', signed=True).hex()}0000")
        host.wait(2.0)
        (reply,) = host.say(f"625#{READ}")
        assert int.from_bytes(bytes.fromhex(reply[12:16]), "little", signed=True) == raw


def test_erratum_16_a_version_of_more_than_four_characters_comes_in_segments() -> None:
    host = Host(firmware="KST V1.234")
    assert host.say("625#400A100000000000") == ["5A5#410A10000A000000"]
    assert host.say("625#6000000000000000") == ["5A5#004B53542056312E"]
    assert host.say("625#7000000000000000") == ["5A5#1932333400000000"]


def test_erratum_17_what_is_not_there_is_refused_by_its_own_code() -> None:
    asked = {
        "4018100000000000": "00000206",
        "4002600100000000": "11000906",
        "2202600000000000": "02000106",
        "4001300000000000": "01000106",
        "2102600000000000": "01000405",
    }
    for request, code in asked.items():
        assert Host().say(f"625#{request}") == [f"5A5#80{request[2:8]}{code}"]


def test_erratum_18_a_request_that_has_not_eight_bytes_is_ignored() -> None:
    host = Host()
    assert host.say("625#40026000", "625#40026000000000", "625#") == []


@pytest.mark.parametrize("request_", ["2201300008", "22013000FF", "2200300000", "2200300080", "22003000FF"])
def test_erratum_19_impossible_codes_and_ids_are_refused(request_: str) -> None:
    host = Host()
    assert host.say(f"625#{request_}000000") == [f"5A5#80{request_[2:8]}30000906"]
    assert host[0x25].status()["saved"] is True


def test_erratum_20_of_two_as_shipped_equal_answers_are_one_and_unequal_ones_break() -> None:
    host = Host(duplicate=0x25)
    assert host.say(f"625#{READ_ID}") == ["5A5#4F00300025000000"]
    host[1002].raw_position = 1
    assert set(host.say(f"625#{READ}")) == {ERROR}
    assert [servo.errors for servo in host.bus.servos] == [16, 16]


def test_erratum_21_at_another_rate_there_is_no_answer_but_broken_frames() -> None:
    host = Host(bit_rate=250_000)
    assert host.say(f"625#{READ}") == [ERROR]
    assert host[0x25].errors == 1
    host.bus.tune(250_000)
    assert host.say(f"625#{READ}") == ["5A5#4B02600000000000"]


def test_erratum_22_replies_say_what_they_answer() -> None:
    host = Host()
    assert host.say("625#2203600001000000", "625#2201300005000000", "625#4003600000000000") == [
        "5A5#6003600000000000",
        "5A5#6001300000000000",
        "5A5#4B03600001000000",
    ]
