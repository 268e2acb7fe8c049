"""One simulated servo by its frames: writes, status, settings of newer firmware, supply, reports, alarms."""

from __future__ import annotations

import pytest

from tests.simulators.kst.host import MOVE, READ_ID, READ_POSITION, SAVE, SET_ID, Host

READ_STATUS = "4005600000000000"
START, STOP, START_STANDARD, STOP_STANDARD = "025#0100", "025#0200", "000#0125", "000#0225"


def test_write_without_length_ignores_further_bytes() -> None:
    host = Host()
    assert host.ask("220360000100FFFF") == ["6003600000000000"]
    assert host[0x25].memory["goal_position"] == 1


@pytest.mark.parametrize(
    ("profile", "load", "celsius", "reply"),
    [
        ("kst-ext", 0.4, 40.4, "4305600064002800"),
        ("kst-ext", -0.4, -5, "430560006400FB00"),
        ("xqpower", 0.4, 25, "43056000E8031900"),
    ],
)
def test_status_has_current_and_temperature(profile: str, load: float, celsius: float, reply: str) -> None:
    """1 A is 100 or 1000 counts; a current has no sign."""
    host = Host(profile=profile)
    host[0x25].load_shaft(load)
    host[0x25].temperature = celsius
    assert host.ask(READ_STATUS) == [reply]


def test_travel_limits_bound_the_target() -> None:
    host = Host(profile="kst-ext")
    host.write(0x300A, -300)
    host.write(0x300B, 200)
    for target, reached in ((900, 200), (-900, -300), (150, 150)):
        assert host.write(0x6003, target) == "6003600000000000"
        host.wait(2.0)
        assert (host.read(0x6003), host.read(0x6002)) == (reached, reached)


@pytest.mark.parametrize("raw", [0, 1])
def test_mid_point_makes_the_position_zero_and_moves_nothing(raw: int) -> None:
    host = Host(profile="kst-ext")
    host[0x25].raw_position = 345
    assert host.write(0x3009, raw) == "6009300000000000"
    assert (host.read(0x6002), host.read(0x6003)) == (0, 0)
    assert host[0x25].status()["moving"] is False
    host.restart()
    assert host.read(0x6002) == 345, "the shaft stands where it stood"
    host.write(0x3009, raw)
    host.restart(save=True)
    assert host.read(0x6002) == 0


def test_bit_5_reverses_position_and_target_and_moves_nothing() -> None:
    host = Host(profile="kst-ext")
    host[0x25].raw_position = 200
    assert host.write(0x300F, 0x73) == "600F300000000000"
    assert host.ask("400F300000000000") == ["4F0F300073000000"]
    assert (host.read(0x6002), host.read(0x6003)) == (-200, -200)
    host.write(0x6003, 300)
    host.wait(1.0)
    host.write(0x300F, 0x53)
    assert host.read(0x6002) == -300
    host.write(0x300A, -500)
    assert host.read(0x300B) == 1000
    host.write(0x300F, 0x20)
    host.write(0x300A, -300)
    assert (host.read(0x300A), host.read(0x300B)) == (-300, 300), "reversed, one limit changes the other"


def test_requests_are_lost_during_a_save() -> None:
    host = Host(profile="xqpower")
    host.send(SAVE)
    assert host.send(READ_POSITION, MOVE, READ_ID, START_STANDARD) == []
    host.wait(0.129)
    assert host.send(READ_POSITION) == []
    host.wait(0.001)
    assert host.ask(READ_POSITION) == ["4B02600000000000"]
    assert (host[0x25].memory["goal_position"], host[0x25].status()["started"]) == (0, False)


def test_unplugged_servo_is_silent_and_returns_restarted() -> None:
    host = Host()
    host.ask(SET_ID, MOVE)
    host[0x25].plug()
    assert host[0x25].memory["goal_position"] == 900, "it was connected"
    host.wait(0.1)
    place = host[0x25].raw_position
    host[0x25].unplug()
    host[0x25].power_cycle()
    assert host.send(READ_POSITION) == []
    host[0x25].plug()
    assert host.ask(READ_ID) == ["4F00300025000000"]
    assert 0 < place == host[0x25].raw_position < 900
    assert host[0x25].status()["moving"] is False


@pytest.mark.parametrize("cut", ["unplug", "power_cycle"])
def test_reply_is_lost_with_the_supply(cut: str) -> None:
    host = Host()
    assert host.timed(READ_POSITION, within=0.00005) == []
    getattr(host[0x25], cut)()
    assert host.wait(0.1) == []


@pytest.mark.parametrize(
    ("profile", "nmt", "vendor", "standard"),
    [
        ("kst", "profile", False, False),
        ("kst-ext", "profile", True, False),
        ("kingmax", "profile", True, False),
        ("xqpower", "profile", False, True),
        ("kst", "vendor", True, False),
        ("kst-ext", "none", False, False),
    ],
)
def test_start_form_belongs_to_profile_or_option(
    profile: str, nmt: str, vendor: bool, standard: bool
) -> None:
    for start, stop, is_started in ((START, STOP, vendor), (START_STANDARD, STOP_STANDARD, standard)):
        host = Host(profile=profile, nmt=nmt)
        host[0x25].raw_position = -109
        assert host.wait(1.0) == []
        reports = host.timed(start, within=0.05)
        assert reports == ([(0.02, "5A5#93FF0000"), (0.04, "5A5#93FF0000")] if is_started else [])
        assert host[0x25].status()["reporting"] is is_started
        assert host.send(stop) + host.wait(1.0) == []
        host.send("026#0100", "000#0126")
        assert host.wait(1.0) == [], "another node was started"
        host.send(start)
        host.restart()
        assert host.wait(1.0) == []


def test_report_interval_is_in_milliseconds() -> None:
    host = Host(profile="kst-ext")
    host.ask("2200220005000000")
    assert [at for at, _ in host.timed(START, within=0.016)] == [0.005, 0.01, 0.015]
    reports = host.timed("2200220064000000", within=0.101)
    assert reports == [(0.0001, "5A5#6000220000000000"), (0.1, "5A5#00000000")]
    host.ask("2200220000000000")
    assert host.wait(1.0) == []


def test_xqpower_raises_a_short_interval() -> None:
    host = Host(profile="xqpower")
    for raw, interval in ((0, 10), (1, 10), (9, 10), (10, 10), (255, 255)):
        assert host.ask(f"22002200{raw:02X}000000") == ["6000220000000000"]
        assert host[0x25].memory["report_interval"] == interval


def test_xqpower_ignores_targets_unless_started() -> None:
    host = Host(profile="xqpower")
    places = []
    for command in ("", START_STANDARD, STOP_STANDARD):
        host.send(*filter(None, [command]))
        host.write(0x6003, 100 if command != STOP_STANDARD else 0)
        host.wait(1.0)
        places.append(host[0x25].raw_position)
    assert places == [0, 100, 100]


def test_report_has_the_identifier_format_of_the_last_request() -> None:
    host = Host(nmt="vendor")
    assert host.send(START) + host.wait(0.0101) == ["5A5#00000000"]
    host.send(f"00000625#{READ_ID}")
    assert host.wait(0.0101) == ["000005A5#00000000"]
