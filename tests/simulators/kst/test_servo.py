"""One servo as a test pokes it: supply, restart, starts and reports, alarm, and what it says of itself."""

from __future__ import annotations

import json

import pytest

from tests.simulators.kst.host import Host

READ = "4002600000000000"
MOVE = "2203600084030000"
SAVE = "2210100173617665"
START, STOP = "025#0100", "025#0200"
NMT_START, NMT_STOP = "000#0125", "000#0225"


# --- supply -----------------------------------------------------------------------------------------------------


def test_an_unplugged_servo_is_silent_and_comes_back_restarted() -> None:
    host = Host()
    host.say("625#2200300026000000")
    host[0x25].unplug()
    assert host.say(f"625#{READ}") == []
    host[0x25].power_cycle()
    assert host.say(f"625#{READ}") == [], "without its cable a power cycle is none"
    host[0x25].plug()
    assert host.say("625#4000300000000000") == ["5A5#4F00300025000000"]


@pytest.mark.parametrize(("cut", "node"), [("old", 0x25), ("new", 0x26)])
def test_a_write_to_flash_ends_with_the_supply_however_long_it_is_away(cut: str, node: int) -> None:
    host = Host(flash_time=0.15, flash_cut=cut)
    host.say("625#2200300026000000")
    host.say(f"625#{SAVE}")
    host[0x25].unplug()
    host.wait(1.0)
    host.bus.servos[0].plug()
    assert host.bus.servos[0].node == node


def test_a_start_during_a_write_to_flash_is_lost() -> None:
    host = Host(profile="xqpower", flash_time=0.15)
    host.say(f"625#{SAVE}")
    host.say(NMT_START)
    assert host[0x25].started is False
    host.wait(0.2)
    host.say(NMT_START)
    assert host[0x25].started is True


def test_plugging_what_is_plugged_does_nothing() -> None:
    host = Host()
    host.say(f"625#{MOVE}")
    host[0x25].plug()
    assert host[0x25].memory["goal_position"] == 900


@pytest.mark.parametrize("cut", ["unplug", "power_cycle"])
def test_an_answer_on_its_way_is_lost_with_the_supply(cut: str) -> None:
    host = Host()
    assert host.timed(f"625#{READ}", within=0.00005) == []
    getattr(host[0x25], cut)()
    assert host.heard(0.1) == []


@pytest.mark.parametrize("cut", ["unplug", "power_cycle"])
def test_without_supply_the_shaft_stays_where_it_is(cut: str) -> None:
    host = Host()
    host.say(f"625#{MOVE}")
    host.wait(0.1)
    place = host[0x25].raw_position
    assert 0 < place < 900
    getattr(host[0x25], cut)()
    host.wait(1.0)
    assert host[0x25].raw_position == place
    assert host[0x25].motion.moving(host.now) is False


def test_it_says_of_itself_what_is_in_force_and_what_is_to_come() -> None:
    host = Host()
    host.say("625#2200300026000000", "625#2201300007000000", f"625#{MOVE}")
    status = host[0x25].status()
    assert json.loads(json.dumps(status)) == status
    told = {name: status[name] for name in ("node", "pending_node", "bit_rate", "pending_bit_rate", "saved")}
    assert told == {
        "node": 37,
        "pending_node": 38,
        "bit_rate": 500_000,
        "pending_bit_rate": 1_000_000,
        "saved": False,
    }
    assert (status["raw_target"], status["moving"], status["plugged"], status["errors"]) == (
        900,
        True,
        True,
        0,
    )
    host.say(f"625#{SAVE}")
    assert host[0x25].status()["saving"] is True


# --- start, stop, reports ---------------------------------------------------------------------------------------


def test_a_vendor_start_makes_it_report_where_it_is_until_a_stop() -> None:
    host = Host(profile="kst-ext", position=-109)
    assert host.heard(1.0) == []
    assert host.timed(START, within=0.05) == [(0.02, "5A5#93FF0000"), (0.04, "5A5#93FF0000")]
    assert host[0x25].status()["reporting"] is True
    assert host.say(STOP) == []
    assert host.heard(1.0) == []


def test_a_start_for_everyone_is_heeded_and_one_for_another_is_not() -> None:
    host = Host(1, 2, profile="kst-ext")
    host.say("003#0100")
    assert host.heard(0.1) == []
    host.say("000#0100", "002#0200")
    assert host.heard(0.02) == ["581#00000000"]


@pytest.mark.parametrize(
    ("profile", "nmt", "vendor", "standard"),
    [
        ("kst", "profile", False, False),
        ("kst-ext", "profile", True, False),
        ("kingmax", "profile", True, False),
        ("xqpower", "profile", False, True),
        ("kst", "vendor", True, False),
        ("kst", "standard", False, True),
        ("kst-ext", "none", False, False),
    ],
)
def test_which_start_it_obeys_is_a_matter_of_profile_or_switch(
    profile: str, nmt: str, vendor: bool, standard: bool
) -> None:
    for text, obeyed in ((START, vendor), (NMT_START, standard)):
        host = Host(profile=profile, nmt=nmt)
        host.say(text)
        assert host[0x25].started is obeyed
        assert bool(host.heard(0.1)) is obeyed


def test_the_interval_is_written_in_milliseconds() -> None:
    host = Host(profile="kst-ext")
    host.say("625#2200220005000000")
    assert [round(at, 9) for at, _ in host.timed(START, within=0.016)] == [0.005, 0.01, 0.015]
    heard = host.timed("625#2200220064000000", within=0.101)
    assert [(round(at, 9), text) for at, text in heard] == [
        (0.0001, "5A5#6000220000000000"),
        (0.1, "5A5#00000000"),
    ]
    host.say("625#2200220000000000")
    assert host.heard(1.0) == []


@pytest.mark.parametrize(("written", "kept"), [(0, 10), (1, 10), (9, 10), (10, 10), (255, 255)])
def test_xqpower_raises_a_short_interval_to_10_ms(written: int, kept: int) -> None:
    host = Host(profile="xqpower")
    assert host.say(f"625#22002200{written:02X}000000") == ["5A5#6000220000000000"]
    assert host[0x25].memory["report_interval"] == kept


def test_reports_of_old_restart_in_silence_and_those_from_power_up_on_with_it() -> None:
    host = Host(profile="kst-ext")
    host.say(START)
    host[0x25].power_cycle()
    assert host.heard(1.0) == []
    host = Host(reports_ms="2")
    host.wait(0.0015)
    host[0x25].power_cycle()
    assert [round(at - host.now, 6) for at, _ in host.wait(0.005)] == [-0.003, -0.001]


def test_what_it_says_unasked_has_the_form_of_identifier_it_was_last_asked_in() -> None:
    host = Host(reports_ms=5)
    assert host.heard(0.0051) == ["5A5#00000000"]
    host.say(f"00000625#{READ}")
    assert host.heard(0.0051) == ["000005A5#00000000"]
    assert Host(reports_ms=5, id_format="ext").heard(0.0051)[-1] == "000005A5#00000000"


def test_xqpower_acknowledges_positions_and_ignores_them_until_it_is_started() -> None:
    host = Host(profile="xqpower")
    assert host.say("625#2203600064000000") == ["5A5#6003600000000000"]
    host.wait(1.0)
    assert (host[0x25].raw_position, host[0x25].memory["goal_position"]) == (0, 0)
    host.say(NMT_START, "625#2203600064000000")
    host.wait(1.0)
    assert host[0x25].raw_position == 100
    host.say(NMT_STOP, "625#2203600000000000")
    host.wait(1.0)
    assert host[0x25].raw_position == 100


# --- alarm ------------------------------------------------------------------------------------------------------


def test_a_supply_that_falls_too_low_is_told_once() -> None:
    host = Host()
    host[0x25].voltage = 6.0
    assert host.heard(1.0) == []
    host[0x25].voltage = 5.9
    assert host.heard(1.0) == ["3A5#0A020000"]
    host[0x25].voltage = 5.5
    assert host.heard(1.0) == []
    host[0x25].voltage = 7.0
    host[0x25].voltage = 5.0
    assert host.heard(1.0) == ["3A5#0A020000"]
    assert host[0x25].status()["voltage"] == 5.0


def test_an_alarm_can_be_raised_and_an_unplugged_servo_raises_none() -> None:
    host = Host()
    host[0x25].alarm()
    host[0x25].alarm(b"\x0a\x01\x00\x00")
    assert host.heard(0.1) == ["3A5#0A020000", "3A5#0A010000"]
    host[0x25].unplug()
    host[0x25].alarm()
    host[0x25].voltage = 1.0
    assert host.heard(0.1) == []
