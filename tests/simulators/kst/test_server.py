"""The SDO server: lengths, segments, refusals in the middle of a transfer, one request at a time."""

from __future__ import annotations

import pytest

from motorbus.families.kst.simulator.server import MAILBOX
from tests.simulators.kst.host import Host

VERSION = "625#400A100000000000"
FIRST, SECOND = "625#6000000000000000", "625#7000000000000000"


@pytest.mark.parametrize("stated", ["2F", "27", "23"])
def test_a_stated_length_must_be_that_of_the_object(stated: str) -> None:
    code = "13000706" if stated == "2F" else "12000706"
    assert Host().say(f"625#{stated}03600001000000") == [f"5A5#80036000{code}"]


def test_22_takes_the_length_of_the_object_and_ignores_the_rest() -> None:
    host = Host()
    assert host.say("625#220360000100FFFF") == ["5A5#6003600000000000"]
    assert host[0x25].memory["goal_position"] == 1
    assert host.say("625#2200300026FFFFFF") == ["5A5#6000300000000000"]
    assert host[0x25].memory["node_id"] == 0x26


def test_writes_that_state_their_length_may_be_unknown_to_it() -> None:
    requests = {"2B03600001000000": "036000", "2F01300004000000": "013000", "2310100173617665": "101001"}
    for request, multiplexer in requests.items():
        accepted = [] if multiplexer == "101001" else [f"5A5#60{multiplexer}00000000"]
        assert Host().say(f"625#{request}") == accepted
        assert Host(accept_sized="no").say(f"625#{request}") == [f"5A5#80{multiplexer}01000405"]


def test_writes_that_do_not_state_their_length_may_be_refused_where_it_is_not_four_bytes() -> None:
    host = Host(accept_unsized="no", save_reply="ack")
    assert host.say("625#2203600001000000") == ["5A5#8003600010000706"]
    assert host.say("625#2B03600001000000") == ["5A5#6003600000000000"]
    assert host.say("625#2210100173617665") == ["5A5#6010100100000000"]


def test_objects_of_one_two_and_four_bytes_are_told_as_such() -> None:
    host = Host(profile="kst-ext")
    answers = host.say("625#400F300000000000", "625#400A300000000000", "625#4005600000000000")
    assert [answer[4:6] for answer in answers] == ["4F", "4B", "43"]


def test_a_short_version_is_filled_up_with_nothing() -> None:
    assert Host(firmware="1").say(VERSION) == ["5A5#430A100031000000"]


def test_segments_carry_seven_bytes_and_the_last_says_so() -> None:
    host = Host(firmware="0123456789ABCD")
    assert host.say(VERSION) == ["5A5#410A10000E000000"]
    assert host.say(FIRST) == ["5A5#0030313233343536"]
    assert host.say(SECOND) == ["5A5#1137383941424344"]
    assert host.say(FIRST) == ["5A5#8000000001000405"], "nothing is under way any more"


def test_a_toggle_that_does_not_turn_ends_the_transfer() -> None:
    host = Host(firmware="0123456789")
    host.say(VERSION, FIRST)
    assert host.say(FIRST) == ["5A5#800A100000000305"]
    assert host.say(SECOND) == ["5A5#8000000001000405"]


def test_a_client_that_gives_up_is_heeded_and_not_answered() -> None:
    host = Host(firmware="0123456789")
    host.say(VERSION)
    assert host.say("625#800A100000000405") == []
    assert host.say(FIRST) == ["5A5#8000000001000405"]


def test_another_request_ends_what_was_under_way() -> None:
    host = Host(firmware="0123456789")
    host.say(VERSION)
    assert host.say("625#4000300000000000") == ["5A5#4F00300025000000"]
    assert host.say(FIRST) == ["5A5#8000000001000405"]


def test_a_restart_ends_what_was_under_way() -> None:
    host = Host(firmware="0123456789")
    host.say(VERSION)
    host[0x25].power_cycle()
    assert host.say(FIRST) == ["5A5#8000000001000405"]


def test_the_signature_of_a_save_must_be_right() -> None:
    host = Host(profile="kst")
    host.say("625#2200300026000000")
    assert host.say("625#2210100165766173") == ["5A5#8010100120000008"]
    assert host[0x25].status()["saving"] is False
    assert host.say("625#4000300000000000"), "and no flash is written"


def test_an_answer_begins_a_turnaround_after_its_request() -> None:
    assert Host().timed("625#4002600000000000") == [(0.0001, "5A5#4B02600000000000")]


def test_one_servo_serves_one_request_after_the_other_and_two_serve_two_at_once() -> None:
    host = Host(1, 2)
    heard = host.timed(*["601#4000300000000000"] * 3, "602#4000300000000000")
    assert [(at, text[:3]) for at, text in heard] == [
        (0.0001, "581"),
        (0.0001, "582"),
        (0.0002, "581"),
        (0.0003, "581"),
    ]


def test_a_flood_fills_the_mailbox_and_the_rest_is_lost() -> None:
    host = Host()
    assert len(host.timed(*["625#4000300000000000"] * 100)) == MAILBOX + 1
    assert host.say("625#4000300000000000"), "and it is served again at once"
