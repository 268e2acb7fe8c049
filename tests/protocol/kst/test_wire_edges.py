"""The last value that fits and the first that does not, and what is meant where nothing is said."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from motorbus.core.operation import CanFrame, Due
from motorbus.errors import RequestError
from motorbus.families.kst import wire
from motorbus.families.kst.wire import Key

OBJECT = bytes((0x02, 0x60, 0))


def test_an_object_named_by_its_index_alone_is_its_sub_index_0() -> None:
    assert wire.Multiplexer(0x6002) == (0x6002, 0)
    assert wire.encode_upload(5, 0x6002) == wire.encode_upload(5, 0x6002, 0)
    assert wire.download_due(5, 0x6003) == Due(5, Key("download", 0x6003, 0), 8)
    assert wire.upload_due(5, 0x6003) == Due(5, Key("upload", 0x6003, 0), 8)


def test_a_write_states_no_length_unless_told_to() -> None:
    assert wire.encode_download(5, 0x6003, 0, b"\x84\x03").data[0] == 0x22
    assert wire.encode_download(5, 0x6003, 0, b"\x84\x03", sized=True).data[0] == 0x2B


def test_what_is_no_segment_has_no_toggle_and_a_segment_no_object() -> None:
    assert Key("upload", 0x6002, 1).toggle == 0
    assert Key("segment", toggle=1).multiplexer == (0, 0)


def test_an_abort_is_that_of_its_own_object_from_either_side() -> None:
    request, refusal, other = Key("upload", 0x6002, 1), Key("abort", 0x6002, 1), Key("abort", 0x6003, 1)
    assert request == refusal
    assert refusal == request
    assert request != other
    assert other != request


def test_a_key_leaves_it_to_others_whether_they_equal_it() -> None:
    class Anything:
        def __eq__(self, other: object) -> bool:
            return True

        __hash__ = None  # type: ignore[assignment]

    assert Key("upload", 0x6002) == Anything()
    assert (Key("upload", 0x6002) == "upload") is False


# --- a node that starts ---------------------------------------------------------------------------------------


def test_a_node_that_starts_says_so_with_the_heartbeat_of_state_0() -> None:
    assert wire.encode_boot(5) == CanFrame(0x705, b"\0", False)
    assert wire.encode_boot(5, extended=True) == CanFrame(0x705, b"\0", True)
    with pytest.raises(RequestError):
        wire.encode_boot(0)


def test_only_one_byte_of_state_0_says_that_a_node_starts() -> None:
    """Its highest bit is the toggle of node guarding (CiA 301), not part of the state."""
    assert [state for state in range(256) if wire.says_boot(bytes((state,)))] == [0, 0x80]
    assert not wire.says_boot(b"")
    assert not wire.says_boot(b"\0\0")


def test_the_states_are_called_as_in_cia_301() -> None:
    assert wire.STATES == {0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational"}


# --- lengths that are stated ----------------------------------------------------------------------------------


def test_only_a_download_states_a_length() -> None:
    for specifier in range(256):
        request = wire.decode_request(CanFrame(0x601, bytes((specifier, *OBJECT, 1, 2, 3, 4))))
        assert request is not None
        assert request.sized is (request.kind == "download" and specifier & 1 == 1)


@pytest.mark.parametrize("specifier", [0x42, 0x46, 0x4A, 0x4E])
def test_a_value_without_a_stated_length_has_all_four_bytes(specifier: int) -> None:
    reply = wire.decode_reply(bytes((specifier, *OBJECT, 1, 2, 3, 4)))
    assert reply == wire.SdoReply("upload", 0x6002, 0, bytes((1, 2, 3, 4)), size=None)


# --- the last that fits, the first that does not -----------------------------------------------------------------

FITS: dict[str, tuple[Callable[[], CanFrame], bytes]] = {
    "code of 32 ones": (
        lambda: wire.encode_abort(1, 0x6002, 0, 0xFFFF_FFFF),
        b"\x80\x02\x60\0\xff\xff\xff\xff",
    ),
    "code 0": (lambda: wire.encode_abort(1, 0x6002, 0, 0), b"\x80\x02\x60\0\0\0\0\0"),
    "lowest position": (lambda: wire.encode_report(1, -32768), b"\0\x80\0\0"),
    "highest position": (lambda: wire.encode_report(1, 32767), b"\xff\x7f\0\0"),
    "nothing follows": (lambda: wire.encode_upload_start(1, 0x6002, 0, 0), b"\x41\x02\x60\0\0\0\0\0"),
}
FITS_NOT: dict[str, Callable[[], object]] = {
    "sub-index -1": lambda: wire.encode_upload(1, 0x6002, -1),
    "code of 33 bits": lambda: wire.encode_abort(1, 0x6002, 0, 1 << 32),
    "code -1": lambda: wire.encode_abort(1, 0x6002, 0, -1),
    "position -32769": lambda: wire.encode_report(1, -32769),
    "position 32768": lambda: wire.encode_report(1, 32768),
    "less than nothing follows": lambda: wire.encode_upload_start(1, 0x6002, 0, -1),
}


@pytest.mark.parametrize(("make", "data"), FITS.values(), ids=FITS)
def test_the_last_that_fits(make: Callable[[], CanFrame], data: bytes) -> None:
    assert make().data == data


@pytest.mark.parametrize("make", FITS_NOT.values(), ids=FITS_NOT)
def test_the_first_that_does_not_fit(make: Callable[[], object]) -> None:
    with pytest.raises(RequestError):
        make()


@pytest.mark.parametrize("code", [-1, 0, 0xFFFF_FFFF, 1 << 32])
def test_a_code_that_no_frame_can_carry_is_unknown_too(code: int) -> None:
    assert wire.abort_text(code).startswith("unknown abort code")
