"""What `decode` tells of KST frames: every byte in words, in both directions, and each fault's reason."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import Explanation
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.decode import decode
from motorbus.families.kst.profiles import PROFILES
from tests.protocol.kst.test_wire import FRAMES
from tests.protocol.kst.vectors import ALL, INVALID, MANUAL, VALID, Vector, name_of

KNOWN = st.sampled_from([vector.frame for vector in ALL])


def one(frame: CanFrame, profile: str = "kst") -> Explanation:
    (told,) = decode(frame.flat(), PROFILES[profile])
    return told


def meanings(explanation: Explanation) -> dict[str, str]:
    return {part.name: part.meaning for part in explanation.parts}


def check_coverage(data: bytes, profile: str = "kst") -> None:
    """Every byte is in one explanation, and in one part of it, at the place the part says."""
    explanations = decode(data, PROFILES[profile])
    assert b"".join(explanation.data for explanation in explanations) == data
    for explanation in explanations:
        sizes = [len(part.data) for part in explanation.parts]
        assert b"".join(part.data for part in explanation.parts) == explanation.data
        assert [part.start for part in explanation.parts] == [sum(sizes[:at]) for at in range(len(sizes))]
        assert all(part.data and part.name and part.meaning for part in explanation.parts)
        assert explanation.title


@given(st.lists(st.one_of(FRAMES, KNOWN), max_size=5), st.binary(max_size=20), st.sampled_from([*PROFILES]))
def test_every_byte_of_anything_is_explained_once(frames: list[CanFrame], rest: bytes, profile: str) -> None:
    run = b"".join(frame._replace(id=frame.id & 0x7FFF_FFFF).flat() for frame in frames)
    check_coverage(run + rest, profile)


@given(st.sampled_from([0x600, 0x625, 0x580, 0x5A5, 0x00000]), st.binary(min_size=8, max_size=8))
def test_every_byte_of_any_eight_is_explained_once(identifier: int, data: bytes) -> None:
    for profile in PROFILES:
        check_coverage(CanFrame(identifier, data).flat(), profile)


def test_nothing_needs_no_words() -> None:
    assert decode(b"") == []


@pytest.mark.parametrize("code", sdo.ABORTS, ids=hex)
def test_each_abort_code_is_decoded_in_both_byte_orders(code: int) -> None:
    words = sdo.ABORTS[code]
    assert meanings(one(sdo.encode_abort_reply(5, 0x6003, 0, code)))["abort code"].endswith(words)
    swapped = int.from_bytes(code.to_bytes(4, "little"), "big")
    found = meanings(one(sdo.encode_abort_reply(5, 0x6003, 0, swapped)))["abort code"]
    assert found.startswith("byte-swapped")
    assert found.endswith(words)


@pytest.mark.parametrize("vector", VALID, ids=name_of)
def test_a_good_frame_has_no_fault_and_all_fields(vector: Vector) -> None:
    for frame in (vector.frame, vector.frame._replace(extended=True)):
        check_coverage(frame.flat())
        told = one(frame)
        assert told.fault == ""
        assert [part.name for part in told.parts][:2] == ["identifier", "length"]
        assert ("29 bits" if frame.extended else "11 bits") in told.parts[0].meaning


@pytest.mark.parametrize("vector", INVALID, ids=name_of)
def test_a_bad_frame_has_its_reason(vector: Vector) -> None:
    check_coverage(vector.frame.flat())
    assert one(vector.frame).fault


@given(FRAMES)
def test_what_is_explained_as_good_is_what_the_receiver_or_a_server_takes(frame: CanFrame) -> None:
    if len(frame.data) > 8 or frame.id >> 31 or one(frame).fault:
        return
    (event,) = notifications.FrameReceiver(frame.extended).feed(frame)
    taken = type(event).__name__ != "Noise" or sdo.decode_request(frame) or notifications.decode_start(frame)
    assert taken or frame.id == 0  # other commands of network management


@pytest.mark.parametrize("vector", [v for v in MANUAL if "degrees" in v.expected], ids=name_of)
def test_a_position_of_the_manual_is_told_in_degrees(vector: Vector) -> None:
    told = meanings(one(vector.frame))
    said = told.get("goal_position") or told["present_position"]
    assert said.startswith(f"{vector.expected['degrees']}° (raw {vector.expected['raw']}, 10 per degree)")


@pytest.mark.parametrize("vector", [v for v in MANUAL if "text" in v.expected], ids=name_of)
def test_a_refusal_is_told_in_the_manuals_words(vector: Vector) -> None:
    told = one(vector.frame)
    assert told.title == f"reply of node 37: goal_position refused: {vector.expected['text']}"
    assert meanings(told)["abort code"] == f"0x{vector.expected['code']}: {vector.expected['text']}"


TITLES = {
    "bit-rate-5": "request to node 37: write bit_rate_code = 5 (500000 bit/s)",
    "node-id-127": "request to node 37: write node_id = 127",
    "save": 'request to node 37: write store = "save"',
    "read-node-id": "request to node 37: read node_id",
    "read-node-id-everyone": "request to everyone: read node_id",
    "node-id": "reply of node 37: node_id = 37",
    "position-set": "reply of node 37: goal_position is written",
    "read-position": "request to node 37: read present_position",
    "position-minus-10.9": "reply of node 37: present_position = -10.9° (raw -109, 10 per degree)",
    "version": 'reply of node 37: firmware_version = "V1.2"',
    "upload-3-bytes": 'reply of node 37: firmware_version = "1.2"',
    "status-6005": "reply of node 37: status = 3 A (0.01 A per count), 30 °C",
    "report-interval": "request to node 37: write report_interval = 0.02 s (raw 20)",
    "reverse": "request to node 37: write function_enable = 0x20 (reversed)",
    "sized-3": "request to node 37: write goal_position = 900 (84 03 00), but goal_position has 2 bytes",
    "segments-announced": "reply of node 3: firmware_version comes in segments, 10 bytes",
    "segment-asked-1": "request to node 3: the next segment, toggle 1",
    "segment-1": "reply of node 3: segment, toggle 1, 3 bytes, the last",
    "client-abort": "request to node 3: give up firmware_version: SDO protocol timed out",
    "abort-unknown-code": "reply of node 37: goal_position refused: unknown abort code 0x0F000009",
}


@pytest.mark.parametrize("name", TITLES)
def test_the_title_says_it_in_short(name: str) -> None:
    (vector,) = [vector for vector in ALL if vector.id == name]
    assert one(vector.frame).title == TITLES[name]


def test_a_byte_swapped_refusal_is_said_to_be_one() -> None:
    told = one(CanFrame(0x5A5, bytes.fromhex("8005600006020000")))
    assert "byte-swapped abort 0x00000206, meaning 0x06020000" in told.title
    assert "Object does not exist" in meanings(told)["abort code"]


def test_the_manuals_position_may_be_a_status() -> None:
    reply = sdo.encode_upload_reply(37, 0x6002, 0, b"\x40\x01")
    told = meanings(one(reply))
    assert "if command 7 was meant, the status 0x40 0x01" in told["present_position"]
    assert "commands 6 and 7" in told["index"]
    later = meanings(one(reply, "kst-ext"))
    assert later["present_position"] == "32° (raw 320, 10 per degree)"
    assert later["index"] == "0x6002, present_position"


def test_each_profile_counts_its_own_way() -> None:
    write = sdo.encode_download(37, 0x6003, 0, (180).to_bytes(2, "little"))
    assert meanings(one(write))["goal_position"] == "18° (raw 180, 10 per degree)"
    assert meanings(one(write, "xqpower"))["goal_position"] == "10° (raw 180, 18 per degree)"
    status = sdo.encode_upload_reply(37, 0x6005, 0, bytes((0x2C, 1, 0xF6, 0)))
    assert meanings(one(status, "xqpower"))["current"] == "0.3 A (0.001 A per count)"
    assert meanings(one(status, "xqpower"))["temperature"] == "-10 °C"


def test_what_the_profile_lacks_is_named_and_said_to_be_lacking() -> None:
    asked = sdo.encode_upload(37, 0x6005)
    assert meanings(one(asked))["index"] == "0x6005, status, not in profile kst"
    assert meanings(one(asked, "kst-ext"))["index"] == "0x6005, status"
    assert meanings(one(sdo.encode_upload(37, 0x1018, 4)))["index"] == "0x1018, no object that is known"
    unknown = sdo.encode_upload_reply(37, 0x1018, 4, b"\x01\x02")
    assert one(unknown).title == "reply of node 37: 0x1018:4 = 513 (01 02)"


@pytest.mark.parametrize(
    ("index", "data", "said"),
    [
        (0x6003, b"\xd0\x07", "200° (raw 2000, 10 per degree), outside -90° to 90° of profile kst"),
        (0x3000, b"\0", "0, outside 1 to 127 of profile kst"),
        (0x3000, b"\x80", "128, outside 1 to 127 of profile kst"),
        (0x3001, b"\x08", "8 (not known), outside 0 to 7 of profile kst"),
    ],
)
def test_a_value_out_of_range_is_said_to_be(index: int, data: bytes, said: str) -> None:
    assert said in one(sdo.encode_download(37, index, 0, data)).title


def test_a_wrong_signature_stores_nothing() -> None:
    told = one(sdo.encode_download(37, 0x1010, 1, b"SAVE"))
    assert meanings(told)["store"] == '"SAVE", the wrong letters: nothing is stored'


def test_the_specifier_says_whether_the_length_is_stated() -> None:
    for data, stated in ((b"\x84\x03", "2 bytes"), (b"\x84", "1 byte")):
        sized = one(sdo.encode_download(37, 0x6003, 0, data, sized=True))
        assert meanings(sized)["specifier"].endswith(f": write (download), {stated}")
    unsized = one(sdo.encode_download(37, 0x6003, 0, b"\x84\x03"))
    assert meanings(unsized)["specifier"] == "0x22: write (download), length not stated"


def test_reserved_bits_of_a_read_say_nothing_of_a_length() -> None:
    assert (
        meanings(one(CanFrame(0x625, bytes.fromhex("4202600000000000"))))["specifier"]
        == "0x42: read (upload)"
    )
    unsized = one(CanFrame(0x5A5, bytes.fromhex("4202600084030000")))
    assert meanings(unsized)["specifier"] == "0x42: value (upload), length not stated"


def test_reserved_bytes_are_told_apart_from_zeros() -> None:
    assert (
        meanings(one(CanFrame(0x625, bytes.fromhex("4000300025000000"))))["reserved"]
        == "ignored, though not 0"
    )
    assert meanings(one(CanFrame(0x625, bytes.fromhex("4000300000000000"))))["reserved"] == "0"


def test_a_run_of_frames_is_told_one_by_one_and_its_rest_as_bad() -> None:
    request, reply = sdo.encode_upload(5, 0x3000), sdo.encode_upload_reply(5, 0x3000, 0, b"\x05")
    run = request.flat() + reply.flat()
    assert [told.data for told in decode(run)] == [request.flat(), reply.flat()]
    *good, bad = decode(run + request.flat()[:9])
    assert [told.fault for told in good] == ["", ""]
    assert bad.data == request.flat()[:9]
    assert "not a whole CAN frame" in bad.fault


def test_a_frame_of_nine_bytes_is_none() -> None:
    (told,) = decode(CanFrame(0x625, bytes(9)).flat())
    assert "0 to 8" in told.fault
