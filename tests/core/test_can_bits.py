"""The number of bits of a frame on the wire, compared with a slow count bit by bit."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_bits import bits
from motorbus.core.can_frame import CanFrame


def slow(frame: CanFrame) -> int:
    """As the standard draws it, with strings of "0" and "1"."""
    if frame.extended:
        name = f"{frame.id:029b}"
        text = "0" + name[:11] + "11" + name[11:] + "000"
    else:
        text = "0" + f"{frame.id:011b}" + "000"
    text += f"{len(frame.data):04b}" + "".join(f"{byte:08b}" for byte in frame.data)
    register = [0] * 15
    for bit in text:
        feedback = int(bit) ^ register[0]
        register = [*register[1:], 0]
        if feedback:  # x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
            for power in (14, 10, 8, 7, 4, 3, 0):
                register[14 - power] ^= 1
    text += "".join(map(str, register))
    sent = ""
    for bit in text:
        sent += bit
        if len(sent) >= 5 and sent[-5:] == bit * 5:
            sent += "1" if bit == "0" else "0"
    return len(sent) + 1 + 2 + 7 + 3


def request(node: int, index: int) -> CanFrame:
    return CanFrame(0x600 + node, bytes((0x40, index & 255, index >> 8, 0, 0, 0, 0, 0)))


def reply(node: int, raw: int) -> CanFrame:
    return CanFrame(0x580 + node, b"\x4b\x02\x60\0" + raw.to_bytes(2, "little", signed=True) + bytes(2))


frames = st.builds(CanFrame, st.integers(0, 0x7FF), st.binary(max_size=8)) | st.builds(
    CanFrame, st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.just(True)
)


@given(frames)
def test_it_agrees_with_a_count_bit_by_bit(frame: CanFrame) -> None:
    assert bits(frame) == slow(frame)


@pytest.mark.parametrize(
    ("frame", "length"),
    [
        (request(1, 0x6002), 123),
        (reply(37, -900), 120),
        (reply(127, 0), 122),
    ],
)
def test_length_of_known_frames(frame: CanFrame, length: int) -> None:
    assert bits(frame) == length
