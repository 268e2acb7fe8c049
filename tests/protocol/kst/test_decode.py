"""Decoded frames: each byte in words, once, in both directions, and the reason why a frame is invalid."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Explanation
from motorbus.core.request import Noise, Reply
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.decode import decode
from motorbus.families.kst.profiles import PROFILES
from tests.protocol.kst.vectors import ALL, FRAMES, MANUAL

KNOWN = st.sampled_from([vector.frame for vector in ALL])


def decode_one(frame: CanFrame, profile: str = "kst") -> Explanation:
    (found,) = decode(frame.flat(), PROFILES[profile])
    return found


def meanings(frame: CanFrame, profile: str = "kst") -> dict[str, str]:
    """Field -> meaning."""
    return {part.name: part.meaning for part in decode_one(frame, profile).parts}


@given(st.lists(FRAMES | KNOWN, max_size=5), st.binary(max_size=20), st.sampled_from([*PROFILES]))
def test_each_byte_is_in_one_field(frames: list[CanFrame], rest: bytes, profile: str) -> None:
    data = b"".join(frame._replace(id=frame.id & 0x7FFF_FFFF).flat() for frame in frames) + rest
    explanations = decode(data, PROFILES[profile])
    assert b"".join(one.data for one in explanations) == data
    for one in explanations:
        sizes = [len(part.data) for part in one.parts]
        assert b"".join(part.data for part in one.parts) == one.data
        assert [part.start for part in one.parts] == [sum(sizes[:end]) for end in range(len(sizes))]
        assert all(part.data and part.name and part.meaning for part in one.parts)
        assert one.title


@given(FRAMES | KNOWN)
def test_frame_is_valid_where_a_receiver_or_a_servo_takes_it(frame: CanFrame) -> None:
    if len(frame.data) > 8 or frame.id >> 31:
        return
    (event,) = notifications.FrameReceiver(frame.extended).feed(frame)
    is_request = 0x600 <= frame.id <= 0x67F and sdo.decode_request(frame.data)
    found = decode_one(frame)
    if is_request or notifications.decode_start(frame):
        kind = "request"
    elif isinstance(event, Noise):
        kind = ""
    else:
        kind = "reply" if isinstance(event, Reply) else "notice"
    falsified = found.kind == "reply" and not kind  # an acknowledgement with an abort code
    assert found.kind == kind or falsified
    assert bool(found.fault) is not bool(found.kind) or frame.id >> 29


def test_frames_are_decoded_one_by_one_and_an_incomplete_one_has_a_fault() -> None:
    request, reply = sdo.encode_upload(5, 0x3000), sdo.encode_upload_reply(5, 0x3000, 0, b"\x05")
    *valid, rest = decode(request.flat() + reply.flat() + request.flat()[:9])
    assert [(one.data, one.fault) for one in valid] == [(request.flat(), ""), (reply.flat(), "")]
    assert rest.data == request.flat()[:9]
    assert "not a whole CAN frame" in rest.fault
    assert "0 to 8" in decode(CanFrame(0x625, bytes(9)).flat())[0].fault
    assert decode(b"") == []


TITLES = {
    "bit-rate-5": "request to node 37: write bit_rate_code = 5 (500000 bit/s)",
    "save": 'request to node 37: write store = "save"',
    "read-node-id-everyone": "request to everyone: read node_id",
    "node-id": "reply of node 37: node_id = 37",
    "position-set": "reply of node 37: goal_position is written",
    "version": 'reply of node 37: firmware_version = "V1.2"',
    "status-6005": "reply of node 37: status = 3 A (0.01 A per count), 30 °C",
    "report-interval": "request to node 37: write report_interval = 0.02 s (raw 20)",
    "reverse": "request to node 37: write function_enable = 0x20 (reversed)",
    "sized-3": "request to node 37: write goal_position = 900 (84 03 00), but goal_position has 2 bytes",
    "segments-announced": "reply of node 3: firmware_version comes in segments",
    "client-abort": "request to node 3: give up firmware_version: SDO protocol timed out",
    "abort-unknown-code": "reply of node 37: goal_position refused: unknown abort code 0x0F000009",
}


def test_title_sums_up_the_frame() -> None:
    frames = {vector.id: vector.frame for vector in ALL}
    assert {name: decode_one(frames[name]).title for name in TITLES} == TITLES


@pytest.mark.parametrize("code", sdo.ABORTS, ids=hex)
def test_abort_code_is_decoded_in_both_byte_orders(code: int) -> None:
    text = sdo.ABORTS[code]
    frame = sdo.encode_abort_reply(5, 0x6003, 0, code)
    assert meanings(frame)["abort code"] == f"0x{code:08X}: {text}"
    assert decode_one(frame).title == f"reply of node 5: goal_position refused: {text}"
    swapped = int.from_bytes(code.to_bytes(4, "little"), "big")
    other = meanings(sdo.encode_abort_reply(5, 0x6003, 0, swapped))["abort code"]
    assert other == f"byte-swapped abort 0x{swapped:08X}, meaning 0x{code:08X}: {text}"


def test_positions_of_the_manual_are_in_degrees() -> None:
    vectors = [vector for vector in MANUAL if "degrees" in vector.expected]
    assert len(vectors) > 10
    for vector in vectors:
        found = meanings(vector.frame)
        text = found.get("goal_position") or found["present_position"]
        degrees, raw = vector.expected["degrees"], vector.expected["raw"]
        assert text.startswith(f"{degrees}° (raw {raw}, 10 per degree)"), vector.id


STATUS = sdo.encode_upload_reply(37, 0x6005, 0, bytes((0x2C, 1, 0xF6, 0)))
POSITION = sdo.encode_upload_reply(37, 0x6002, 0, b"\x40\x01")
GOAL = sdo.encode_download(37, 0x6003, 0, (180).to_bytes(2, "little"))
SIZED = sdo.encode_download(37, 0x6003, 0, b"\x84\x03", sized=True)
UNKNOWN = sdo.encode_upload(37, 0x1018, 4)
RESERVED_BIT = CanFrame(0x625, bytes.fromhex("4202600000000000"))
EMERGENCY = CanFrame(0x0A5, bytes.fromhex("1031050000000000"))
RESERVED_DATA = CanFrame(0x625, bytes.fromhex("4000300025000000"))
UNSIZED_VALUE = CanFrame(0x5A5, bytes.fromhex("4202600084030000"))
TURNED = "32° (raw 320, 10 per degree)"


@pytest.mark.parametrize(
    ("frame", "profile", "field", "meaning"),
    [
        (POSITION, "kst", "present_position", f"{TURNED}; or, if command 7 was meant, the status 0x40 0x01"),
        (POSITION, "kst-ext", "present_position", TURNED),
        (POSITION, "kst", "identifier", "0x5A5, 11 bits"),
        (GOAL._replace(extended=True), "kst", "identifier", "0x00000625, 29 bits"),
        (GOAL, "kst", "goal_position", "18° (raw 180, 10 per degree)"),
        (EMERGENCY, "kst", "error code", "code 0x3110"),
        (EMERGENCY, "kst", "error register", "0x05"),
        (GOAL, "xqpower", "goal_position", "10° (raw 180, 18 per degree)"),
        (STATUS, "xqpower", "current", "0.3 A (0.001 A per count)"),
        (STATUS, "xqpower", "temperature", "-10 °C"),
        (STATUS, "kst", "index", "0x6005, status, not in profile kst"),
        (STATUS, "kst-ext", "index", "0x6005, status"),
        (UNKNOWN, "kst", "index", "0x1018, no object that is known"),
        (SIZED, "kst", "specifier", "0x2B: write (download), 2 bytes"),
        (RESERVED_BIT, "kst", "specifier", "0x42: read (upload)"),
        (UNSIZED_VALUE, "kst", "specifier", "0x42: value (upload), length not stated"),
        (RESERVED_DATA, "kst", "reserved", "ignored, though not 0"),
        (sdo.encode_download(37, 0x1010, 1, b"SAVE"), "kst", "store", '"SAVE", the wrong letters: nothing is stored'),
    ],
)  # fmt: skip
def test_field_has_a_meaning(frame: CanFrame, profile: str, field: str, meaning: str) -> None:
    assert meanings(frame, profile)[field] == meaning


def test_value_outside_its_range_or_of_an_unknown_object_is_shown() -> None:
    for index, data, text in (
        (0x6003, b"\xd0\x07", "200° (raw 2000, 10 per degree), outside -90° to 90° of profile kst"),
        (0x3000, b"\x80", "128, outside 1 to 127 of profile kst"),
        (0x3001, b"\x08", "8 (not known), outside 0 to 7 of profile kst"),
        (0x1018, b"\x01\x02", "write 0x1018:0 = 513"),
    ):
        assert text in decode_one(sdo.encode_download(37, index, 0, data)).title
    turned = decode_one(sdo.encode_upload_reply(37, 0x6002, 0, b"\xd0\x07"))
    assert turned.title.endswith("200° (raw 2000, 10 per degree), outside -90° to 90° of profile kst")
