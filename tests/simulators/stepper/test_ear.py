"""Requests out of bytes: whole, in pieces, behind noise, and what a pause does."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.families.stepper.simulator.ear import Ear
from tests.simulators.stepper.host import STOP, STOP_PROJECT, frame

GAP = 0.1


def heard(*pieces: tuple[bytes, float]) -> list[bytes]:
    ear = Ear(GAP)
    return [one for data, at in pieces for one in ear.feed(data, at).requests]


@pytest.mark.parametrize("cut", range(12))
def test_a_request_may_come_in_pieces(cut: int) -> None:
    assert heard((STOP[:cut], 0.0), (STOP[cut:], 0.05)) == [STOP]


@pytest.mark.parametrize(("pause", "found"), [(0.099, [STOP]), (0.101, [])])
def test_a_beginning_is_forgotten_after_a_pause(pause: float, found: list[bytes]) -> None:
    assert heard((STOP[:5], 1.0), (STOP[5:], 1.0 + pause)) == found


@pytest.mark.parametrize(
    "noise", [b"\0", b"\xff", b"\xff\xff", b"\xaa", STOP[:5], STOP[:10], b"\xff\xaa\xff", STOP[:-1] + b"\0"]
)
def test_a_request_is_found_behind_noise(noise: bytes) -> None:
    assert heard((noise + STOP, 0.0)) == [STOP]
    assert heard((noise, 0.0), (STOP, 0.01)) == [STOP]


def test_a_wrong_checksum_is_counted_and_what_follows_is_heard() -> None:
    found = Ear(GAP).feed(STOP[:-1] + b"\0" + STOP_PROJECT, 0.0)
    assert found == ([STOP_PROJECT], 1)


def test_a_header_in_the_data_is_data() -> None:
    tricky = frame(3, 3, 0xFF, 0xAA, 0, 0, 0, 3)
    assert heard((tricky + tricky, 0.0)) == [tricky, tricky]


def test_what_was_begun_can_be_forgotten() -> None:
    ear = Ear(GAP)
    ear.feed(STOP[:5], 0.0)
    ear.forget()
    assert ear.feed(STOP[5:], 0.0).requests == []


@given(st.lists(st.one_of(st.binary(max_size=6), st.sampled_from([STOP, STOP_PROJECT]))), st.integers(1, 30))
def test_how_it_is_cut_does_not_matter(parts: list[bytes], size: int) -> None:
    data = b"".join(parts)
    whole = Ear(GAP).feed(data, 0.0)
    ear = Ear(GAP)
    pieces = [ear.feed(data[at : at + size], 0.0) for at in range(0, len(data), size)]
    assert [one for piece in pieces for one in piece.requests] == whole.requests
    assert sum(piece.bad for piece in pieces) == whole.bad
