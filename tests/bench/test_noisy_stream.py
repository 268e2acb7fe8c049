"""The capture is the same each time, as bad as it says, and what brute force finds in it is right."""

from __future__ import annotations

from bench.memory import packet
from bench.noisy_stream import LONGEST, capture, decodable, pieces

ONE, TWO = packet(1, 0, b"\x01\x02"), packet(2, 0)


def test_the_same_seed_gives_the_same_bytes() -> None:
    assert capture(200) == capture(200)
    assert capture(200) != capture(200, seed=1)


def test_the_pieces_are_the_stream() -> None:
    stream = capture(500)
    cut = pieces(stream)
    assert b"".join(cut) == stream
    assert max(map(len, cut)) <= LONGEST
    assert len({len(piece) for piece in cut}) > 10


def test_nothing_is_lost_where_nothing_is_damaged_and_much_where_it_is() -> None:
    clean, damaged = (list(decodable(capture(500, damaged=share))) for share in (0.0, 0.01))
    assert len(clean) >= 490  # garbage that ends in header bytes may hide a packet
    assert 400 < len(damaged) < 475


def test_packets_between_garbage_and_inside_a_false_one_are_found_with_their_places() -> None:
    hidden = b"\xff\xff\x05\x20\x00" + ONE
    stream = b"\x00\xff" + ONE + b"\xff\xff\x01" + TWO + hidden + TWO
    assert list(decodable(stream)) == [(2, ONE), (13, TWO), (24, ONE), (32, TWO)]


def test_what_is_damaged_or_cut_short_is_no_packet() -> None:
    wrong = ONE[:-1] + bytes((ONE[-1] ^ 1,))
    assert list(decodable(wrong + ONE[:-1])) == []
