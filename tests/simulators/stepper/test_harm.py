"""Every fault does exactly what it is ordered to do, to exactly those that are to be hit, and says so."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.families.stepper.simulator.harm import Harm
from motorbus.families.stepper.simulator.switches import Switches
from tests.protocol.stepper.vectors import DUMP_B
from tests.simulators.stepper.host import READ, STOP, STOP_PROJECT, frame

REPLY = bytes.fromhex("FFAA4E010000")


class Said(list[str]):
    """Remarks, kept."""

    def __call__(self, text: str) -> None:
        self.append(text)


def harm(said: Said | None = None, **options: Any) -> Harm:
    return Harm(Switches(**options), Said() if said is None else said)


def pieces(harm: Harm, data: bytes = REPLY) -> list[bytes]:
    return [piece for _, piece in harm.of_reply(data)]


@pytest.mark.parametrize(
    ("fault", "expected", "says"),
    [
        ("none", [(0.0, REPLY)], []),
        ("unheard", [(0.0, REPLY)], []),  # that one meets the request
        ("lost", [], ["is lost"]),
        ("late", [(0.25, REPLY)], ["is late"]),
        ("doubled", [(0.0, REPLY), (0.0, REPLY)], ["comes twice"]),
        ("split", [(0.0, REPLY[:3]), (0.25, REPLY[3:])], ["comes in two pieces"]),
        ("noise", [(0.0, b"\x00\x55\xff" + REPLY)], ["has noise before it"]),
        ("other", [(0.0, bytes.fromhex("FFAA030D0000"))], ["is replaced by that of another command"]),
    ],
)
def test_what_happens_to_a_reply(fault: str, expected: list[tuple[float, bytes]], says: list[str]) -> None:
    said = Said()
    assert harm(said, reply_fault=fault, fault_time=0.25).of_reply(REPLY) == expected
    assert said == [f"fault: the reply FF AA 4E 01 00 00 {one}" for one in says]


def test_another_command_is_another_one_than_that_too() -> None:
    assert pieces(harm(reply_fault="other"), bytes.fromhex("FFAA030D0000")) == [bytes.fromhex("FFAA030C0000")]


@pytest.mark.parametrize("every", [1, 24])
def test_one_bit_is_flipped_each_time_another_one(every: int) -> None:
    one = harm(reply_fault="bit", fault_every=every)
    found = [piece for _ in range(48 * every) for piece in pieces(one)]
    flips = [int.from_bytes(data, "big") ^ int.from_bytes(REPLY, "big") for data in found if data != REPLY]
    assert len(flips) == 48
    assert all(bin(flip).count("1") == 1 for flip in flips)
    assert len(set(flips)) == 24


def test_only_the_so_many_th_of_each_kind_is_hit() -> None:
    one = harm(reply_fault="lost", notice_fault="lost", dump_fault="short", fault_every=3)
    assert [len(pieces(one)) for _ in range(6)] == [1, 1, 0, 1, 1, 0]
    assert [one.of_notice() for _ in range(4)] == ["", "", "lost", ""]
    assert [len(one.of_dump(DUMP_B)) for _ in range(4)] == [226, 226, 113, 226]
    deaf = harm(reply_fault="unheard", fault_every=2)
    assert [deaf.unheard(STOP) for _ in range(4)] == [False, True, False, True]
    assert not harm().unheard(STOP)


@pytest.mark.parametrize(
    ("fault", "left", "says"),
    [
        ("none", DUMP_B, []),
        ("short", DUMP_B[:113], ["fault: the dump of project 2 lacks its second half"]),
        ("byte", DUMP_B[:60] + DUMP_B[61:], ["fault: the dump of project 2 lacks a byte"]),
    ],
)
def test_what_happens_to_a_dump(fault: str, left: bytes, says: list[str]) -> None:
    said = Said()
    assert harm(said, dump_fault=fault).of_dump(DUMP_B) == left
    assert said == says


@pytest.mark.parametrize("fault", ["lost", "doubled", "late", "early", "inside_dump"])
def test_which_fault_hits_a_notice(fault: str) -> None:
    said = Said()
    assert harm(said, notice_fault=fault).of_notice() == fault
    assert len(said) == 1
    assert harm().of_notice() == ""


def test_a_notice_is_put_between_any_two_bytes_of_what_a_dump_carries() -> None:
    said = Said()
    one = harm(said)
    places = []
    for _ in range(3000):
        found = one.with_notice(DUMP_B)
        place = int(said[-1].split()[-1])
        assert found == DUMP_B[:place] + b"\xee\xdd" + DUMP_B[place:]
        places.append(place)
    assert set(places) == set(range(6, 226))


# --- echoes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("echo", "back"), [("no", b""), ("yes", STOP), ("six", STOP[:6])])
def test_what_comes_back_of_a_request(echo: str, back: bytes) -> None:
    assert harm(echo=echo).echoed(STOP, 1.0) == back


def test_six_bytes_of_each_request_come_back_however_they_are_cut() -> None:
    said = Said()
    stream = STOP + STOP_PROJECT + frame(READ, 1)
    expected = STOP[:6] + STOP_PROJECT[:6] + frame(READ, 1)[:6]
    assert harm(said, echo="six").echoed(stream, 1.0) == expected
    assert said == [f"fault: {expected.hex(' ').upper()} is an echo"]
    for size in (1, 4, 12):
        one = harm(echo="six")
        cut = [stream[at : at + size] for at in range(0, len(stream), size)]
        assert b"".join(one.echoed(piece, 1.0) for piece in cut) == expected


def test_after_a_pause_a_request_begins() -> None:
    one = harm(echo="six", rx_gap_ms=100.0)
    assert one.echoed(STOP[:8], 1.0) == STOP[:6]
    assert one.echoed(STOP, 1.2) == STOP[:6]


def test_each_so_many_th_request_comes_back_as_six_bytes() -> None:
    one = harm(echo="six", fault_every=2)
    assert [len(one.echoed(STOP, 1.0)) for _ in range(4)] == [0, 6, 0, 6]
    assert len(harm(echo="yes", fault_every=2).echoed(STOP, 1.0)) == 11  # a cable is as it is


# --- errors by chance -----------------------------------------------------------------------------------------------


def test_bytes_are_hit_as_often_as_is_said_and_never_stay_the_same() -> None:
    said = Said()
    one = harm(said, byte_errors=0.01, seed=5)
    zeros = bytes(100)
    wrong = [byte for _ in range(1000) for byte in one.spoken(zeros) if byte]
    assert 850 < len(wrong) < 1150
    assert len(set(wrong)) > 200
    assert sum(int(text.split()[1]) for text in said) == len(wrong)
    assert harm(byte_errors=1.0).spoken(REPLY) != REPLY
    assert all(a != b for a, b in zip(harm(byte_errors=1.0).spoken(zeros), zeros, strict=True))


def test_each_way_has_its_own_errors() -> None:
    assert harm(byte_errors=1.0).misheard(STOP) == STOP
    assert harm(request_errors=1.0).spoken(REPLY) == REPLY
    assert harm(request_errors=1.0).misheard(STOP) != STOP


def test_the_same_seed_gives_the_same_errors_and_another_gives_others() -> None:
    def errors(seed: int) -> bytes:
        return harm(byte_errors=0.1, seed=seed).spoken(bytes(1000))

    assert errors(3) == errors(3) != errors(4)


# --- changes while it runs ------------------------------------------------------------------------------------------


def test_after_a_change_it_is_counted_afresh() -> None:
    one = harm(reply_fault="lost", fault_every=3)
    pieces(one)
    one.change(Switches(reply_fault="doubled", fault_every=2), reseed=False)
    assert [len(pieces(one)) for _ in range(4)] == [1, 2, 1, 2]


@pytest.mark.parametrize("reseed", [True, False])
def test_chance_goes_on_unless_it_is_to_begin_afresh(reseed: bool) -> None:
    one = harm(byte_errors=0.1)
    first = one.spoken(bytes(200))
    one.change(Switches(byte_errors=0.1), reseed=reseed)
    assert (one.spoken(bytes(200)) == first) is reseed
