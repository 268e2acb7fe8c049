"""Who hears whom: rates, identifier forms, twins, broken frames, order, and what garbage does (nothing)."""

from __future__ import annotations

import pytest

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, Audience, CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.kst.simulator import simulate
from tests.simulators.kst.host import ERROR, Host

READ = "4002600000000000"
READ_ID = "4000300000000000"


def at_rate(*rates: int, **options: object) -> Host:
    """Servos 1, 2 … each set to its own rate; the host has the first one's."""
    host = Host(*range(1, len(rates) + 1), rate=rates[0], **options)
    for servo, rate in zip(host.bus.servos, rates, strict=True):
        servo.bit_rate = rate
    return host


# --- rates --------------------------------------------------------------------------------------------------


def test_at_another_rate_a_servo_neither_hears_nor_is_heard_and_breaks_what_it_sees() -> None:
    host = Host(rate=1_000_000)
    assert host.say("625#2203600084030000", "625#2203600084030000") == [ERROR, ERROR]
    assert (host[0x25].errors, host[0x25].status()["errors"]) == (2, 2)
    assert host[0x25].memory["goal_position"] == 0


def test_a_host_that_only_listens_breaks_nothing() -> None:
    host = Host(rate=1_000_000)
    assert host.heard(10.0) == []
    assert host[0x25].errors == 0


def test_a_host_that_listens_at_another_rate_sees_reports_as_broken_frames() -> None:
    host = Host(rate=250_000, reports_ms=10)
    assert host.heard(0.0451) == [ERROR] * 4
    assert host[0x25].errors == 0
    host.bus.tune(500_000)
    assert host.heard(0.01) == ["5A5#00000000"]


def test_servos_of_two_rates_on_one_bus_disturb_until_they_are_error_passive() -> None:
    host = at_rate(500_000, 250_000)
    heard = [host.say(f"601#{READ_ID}") for _ in range(20)]
    assert heard[:16] == [[ERROR, "581#4F00300001000000"]] * 16
    assert heard[16:] == [["581#4F00300001000000"]] * 4
    assert [servo.errors for servo in host.bus.servos] == [0, 20]


def test_a_passive_servo_alone_leaves_frames_without_an_acknowledgement() -> None:
    host = Host(rate=250_000)
    assert [host.say(f"625#{READ}") for _ in range(40)] == [[ERROR]] * 40


def test_an_unplugged_servo_breaks_nothing_and_a_restart_clears_its_count() -> None:
    host = Host(rate=250_000)
    host.say(f"625#{READ}")
    host[0x25].unplug()
    assert host.say(f"625#{READ}") == []
    host[0x25].plug()
    assert host[0x25].errors == 0


def test_a_bus_that_nobody_has_tuned_hears_everyone() -> None:
    host = Host(bit_rate=20_000)
    host.bus.tune(0)
    assert host.say(f"625#{READ}") == ["5A5#4B02600000000000"]


def test_an_answer_that_comes_after_the_host_was_tuned_away_is_a_broken_frame() -> None:
    host = Host()
    host.bus.receive(CanFrame(0x625, bytes.fromhex(READ)), 1.0)
    host.bus.tune(250_000)
    assert host.heard(0.01) == [ERROR]


# --- two with one id -------------------------------------------------------------------------------------------


def test_twins_are_both_reachable_and_follow_their_ids() -> None:
    host = Host(0x25, 0x25, 3)
    assert list(host.bus.nodes) == [0x25, 1002, 3]
    assert [host[0x25].unit, host[1002].unit, host[1002].node] == [1, 2, 0x25]
    host[0x25].unplug()
    host.say("625#2200300026000000", "625#2210100173617665")
    host.wait(0.2)
    host[1002].power_cycle()
    assert list(host.bus.nodes) == [0x25, 0x26, 3]
    assert host[0x26].unit == 2


def test_two_servos_given_the_same_id_become_twins_after_the_restart() -> None:
    host = Host(1, 2)
    host.say("602#2200300001000000", "602#2210100173617665")
    host.wait(0.2)
    for servo in host.bus.servos:
        servo.power_cycle()
    assert list(host.bus.nodes) == [1, 1002]


def test_equal_answers_of_twins_are_one_frame_and_unequal_ones_16_broken_ones() -> None:
    host = Host(0x25, duplicate="0x25")
    assert host.say(f"625#{READ}") == ["5A5#4B02600000000000"]
    host[1002].raw_position = 5
    heard = host.timed(f"625#{READ}")
    assert [text for _, text in heard] == [ERROR] * 16
    assert [round(at * 1e6) for at, _ in heard[:3]] == [300, 500, 700]
    assert [servo.errors for servo in host.bus.servos] == [16, 16]


def test_twins_that_think_differently_long_give_two_answers() -> None:
    host = Host(0x25, duplicate="0x25", duplicate_delay="0.0005")
    assert host.timed(f"625#{READ_ID}") == [
        (0.0001, "5A5#4F00300025000000"),
        (0.0006, "5A5#4F00300025000000"),
    ]


def test_several_requests_at_once_do_not_make_a_servo_collide_with_itself() -> None:
    host = Host(profile="kst-ext")
    assert host.say(f"625#{READ}", f"625#{READ_ID}") == ["5A5#4B02600000000000", "5A5#4F00300025000000"]


# --- order -------------------------------------------------------------------------------------------------------


def test_at_one_moment_the_lower_identifier_goes_first() -> None:
    host = Host(9, 5, 7)
    texts = [f"00000609#{READ_ID}", f"605#{READ_ID}", f"607#{READ_ID}"]
    assert [text.split("#")[0] for text in host.say(*texts)] == ["00000589", "585", "587"]


def test_due_is_the_next_moment_and_advance_gives_what_begins_until_then() -> None:
    bus = Host(1, 2, reports_ms=10).bus
    assert bus.due() == pytest.approx(1.01)
    assert [round(at, 9) for at, _ in bus.advance(1.0299)] == [1.01, 1.01, 1.02, 1.02]
    assert bus.due() == pytest.approx(1.03)
    bus.receive(CanFrame(0x601, bytes.fromhex(READ)), 1.0298)
    assert bus.due() == pytest.approx(1.03)
    assert Host().bus.due() is None


def test_reports_from_power_up_on_begin_with_the_clock_wherever_that_begins() -> None:
    bus = simulate((1,), reports_ms=2)
    asked = bus.due()
    assert asked is not None
    assert asked < 0
    assert bus.advance(asked) == []
    assert bus.due() is None, "asking once is enough"
    assert bus.advance(86_400.0) == []
    assert bus.due() == pytest.approx(86_400.002)
    other = simulate((1,), reports_ms=2)
    other.receive(CanFrame(0x601, bytes.fromhex(READ)), 7.0)
    assert [round(at, 4) for at, _ in other.advance(7.0021)] == [7.0001, 7.002]


def test_time_never_goes_back() -> None:
    host = Host()
    host.bus.advance(10.0)
    host.bus.receive(CanFrame(0x625, bytes.fromhex(READ)), 1.0)
    assert host.bus.now == 10.0
    assert [at for at, _ in host.bus.advance(10.1)] == [pytest.approx(10.0001)]


def test_the_same_said_is_the_same_heard() -> None:
    def heard() -> list[tuple[float, str]]:
        host = Host(1, 2, 0x25, profile="kst-ext", reports_ms=3, duplicate="2")
        host[1004].raw_position = 50
        found = host.timed("625#2203600084030000", f"602#{READ}", within=0.3)
        return [*found, *host.timed(f"600#{READ}", within=0.3)]

    assert heard() == heard()


# --- garbage -------------------------------------------------------------------------------------------------------


GARBAGE: list[Data] = [
    b"",
    b"\xff\xff\x01\x02\x01\xfb",
    CanFrame(0x625, b""),
    CanFrame(0x625, bytes(7)),
    CanFrame(0x625 | ERROR_FLAG, bytes(8)),
    CanFrame(0x625 | REMOTE_FLAG, b""),
    CanFrame(0x625 | REMOTE_FLAG, bytes.fromhex(READ)),
    CanFrame(0x5A5, bytes.fromhex(READ)),
    CanFrame(0x7FF, bytes(8)),
    CanFrame(0x1FFFFFFF, bytes(8), True),
    CanFrame(0x680, bytes.fromhex(READ)),
    CanFrame(0, b"\x01"),
    CanFrame(0x25, b"\x03\x00"),
]


@pytest.mark.parametrize("data", GARBAGE, ids=str)
def test_garbage_is_met_with_silence_and_survived(data: Data) -> None:
    host = Host()
    host.bus.receive(data, 1.0)
    assert host.bus.advance(2.0) == []
    host.now = 2.0
    assert host.say(f"625#{READ}") == ["5A5#4B02600000000000"]


@pytest.mark.parametrize("profile", ["kst", "kst-ext", "kingmax", "xqpower"])
def test_any_eight_bytes_are_survived_and_answered_at_most_once(profile: str) -> None:
    host = Host(profile=profile, flash_time=0.0)
    seed = 1
    for _ in range(3000):
        seed = seed * 6364136223846793005 + 1442695040888963407 & (1 << 64) - 1
        data = bytearray(seed.to_bytes(8, "little"))
        if seed >> 60 & 1:  # near to something it knows
            data[1:4] = [b"\x03\x60\x00", b"\x00\x30\x00", b"\x0a\x30\x00", b"\x0f\x30\x00"][seed >> 32 & 3]
        assert len(host.say(f"625#{data.hex()}")) <= 1


# --- what cannot be ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ids", [(), (0,), (128,), (1, 300)], ids=str)
def test_impossible_ids_are_refused(ids: tuple[int, ...]) -> None:
    with pytest.raises(RequestError):
        simulate(ids)


def test_a_second_servo_comes_while_the_bus_is_at_work() -> None:
    host = at_rate(1_000_000, duplicate_delay=0.001)
    host.bus.duplicate(1)
    assert [servo.node for servo in host.bus.servos] == [1, 1]
    assert host.say(f"601#{READ}") == ["581#4B02600000000000"] * 2
    with pytest.raises(RequestError, match="no servo has the id 9"):
        host.bus.duplicate(9)


# --- who can be reached is known anew after each change ---------------------------------------------------------


def test_whoever_changes_is_reached_where_it_is_now() -> None:
    host = Host(1, 2, 3)
    assert [len(host.say(f"60{node}#{READ}")) for node in (1, 2, 3)] == [1, 1, 1]
    host[2].unplug()
    assert host.say(f"602#{READ}") == []
    host[2].plug()
    assert len(host.say(f"602#{READ}")) == 1
    host[3].node = 4
    assert (len(host.say(f"603#{READ}")), len(host.say(f"604#{READ}"))) == (0, 1)
    host.bus.servos[0].bit_rate = 250_000
    assert host.say(f"601#{READ}") == [ERROR]
    host.bus.servos[0].bit_rate = 500_000
    assert len(host.say(f"601#{READ}")) == 1
    host.bus.duplicate(2)
    assert len(host.say(f"602#{READ}")) == 1  # both say the same, which is one frame
    assert host.bus.servos[-1].values is not host[2].values


@pytest.mark.parametrize(
    ("frame", "audience"),
    [
        (CanFrame(0x625, bytes(8)), Audience.OURS),
        (CanFrame(0x625, b"\1"), Audience.OURS),
        (CanFrame(0x600, bytes(8)), Audience.EVERYONE),
        (CanFrame(0x626, bytes(8)), Audience.NONE),
        (CanFrame(0x5A5, bytes(8)), Audience.NONE),
        (CanFrame(0x625, bytes(8), extended=True), Audience.NONE),
        (CanFrame(0x600, bytes(8), extended=True), Audience.NONE),
        (b"\0", Audience.NONE),
    ],
)
def test_whom_a_frame_is_for(frame: Data, audience: Audience) -> None:
    bus = simulate((0x25, 0x30), id_format="std")
    bus.nodes[0x25].unplug()  # it is simulated all the same
    assert bus.audience(frame) is audience
