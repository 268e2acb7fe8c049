"""The classes of differences between decoders: who does what with which stream, and why motorbus does what it does.

What each decoder makes of an example is not written here: it is measured whenever the page is made or checked.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from motorbus.families.feetech import wire
from motorbus.families.kst import sdo
from tests.interop.differential.cases import Case, Request, SdoCase, SdoRequest
from tests.interop.differential.outside import CANOPEN, FEETECH, NEW, OLD, RUST, Decoder
from tests.interop.differential.sdo_streams import NODE

POSITION, GAIN = 56, 21
READ: Final = Request("read", 1, POSITION, 2)
GROUP: Final = Request("sync_read", wire.BROADCAST, POSITION, 2, nodes=(1, 2, 3))


class Note(NamedTuple):
    """With whom it is seen, an example, what they do, and what motorbus does and why."""

    decoders: tuple[Decoder, ...]
    example: Case
    they: str
    we: str


class SdoNote(NamedTuple):
    """The same for SDO."""

    example: SdoCase
    they: str
    we: str

    @property
    def decoders(self) -> tuple[Decoder, ...]:
        return (CANOPEN,)


def _status(node: int, value: int = 2048, error: int = 0) -> bytes:
    return wire.encode_status(node, error, value.to_bytes(2, "little"))


def _read(stream: bytes) -> Case:
    return Case(READ, stream, "")


def _group(*nodes: int) -> Case:
    return Case(GROUP, b"".join(map(_status, nodes)), "")


NOTES: Final[Mapping[str, Note]] = MappingProxyType(
    {
        "more-than-the-answer": Note(
            FEETECH,
            _read(_status(1) + _status(1, 2100)),
            "Reading ends with the first packet that suits, and what stands behind it is never looked at: here an "
            "older answer to the same question, and the true one after it. In a group, what stands between the "
            "answers is passed over.",
            "Bytes behind an answer are an error: one of two answers is not to this question, or the packet lost its "
            "place and left a byte behind. The bus waits for quiet, asks something whose answer cannot be mistaken, "
            "and then asks again. In a group the servo behind whose answer something else stands is left out.",
        ),
        "other-length": Note(
            FEETECH,
            _read(wire.encode_status(1, 0, b"\x01")),
            "A packet with another number of data bytes than were asked for is taken. Where it has fewer, the SDKs "
            "hand over its checksum as data; rustypot hands over what there is.",
            "The length is part of what an answer is known by: a servo that was asked for two bytes never sends one, "
            "so this answers something else.",
        ),
        "echo": Note(
            FEETECH,
            _read(READ.packet() + _status(1)),
            "The echo of a request is itself a valid status packet: the position is 568 (0x0238, the address and the "
            "count of the request), with alarm bit 1; the true answer is not looked at.",
            "What was sent is known. Whether an adapter echoes is tested when the bus is opened, and an echo that "
            "comes later is no answer.",
        ),
        "error-above-0x7f": Note(
            (OLD, NEW),
            _read(_status(1, error=0x80)),
            "A packet whose error byte is above 0x7F counts as noise and is thrown away.",
            "Any error byte is accepted: bit 7 is undefined, and the data of the packet count. rustypot agrees.",
        ),
        "false-beginning": Note(
            (OLD, NEW),
            _read(b"\xff\xff\x01\x04\x00\x00" + _status(1)),
            "Bytes that look like the beginning of a packet are given up as a whole, with the good packet inside.",
            "What fails is given up by one byte, so a good packet behind or inside a damaged one is found. Its sum "
            "and its length are right, and nothing is behind it.",
        ),
        "something-in-front": Note(
            (RUST,),
            _read(b"\x00" + _status(1)),
            "The first byte that comes must be the first of the answer; a byte of noise, or a packet of another "
            "servo in front of it, and the reading has failed.",
            "Noise in front is harmless, since adapters and lines make some when a driver switches; it is passed over.",
        ),
        "first-silent": Note(
            (OLD,),
            _group(1, 3),
            "SYNC READ gives up at the first servo of the list that has not answered, and those behind it are lost.",
            "Answers are collected by id; those missing are reported one by one.",
        ),
        "out-of-order": Note(
            (OLD,),
            _group(2, 1, 3),
            "SYNC READ passes over an answer that comes before its turn, and then misses it.",
            "Answers are collected by id, in whatever order.",
        ),
        "all-or-none": Note(
            (RUST,),
            _group(1, 3),
            "When one servo of a group is silent, or its answer damaged, the answers of all are dropped.",
            "Who answered is told, and who did not.",
        ),
        "counted-bytes": Note(
            (NEW,),
            Case(GROUP, b"\x00" + _group(1, 2, 3).stream, ""),
            "SYNC READ takes as many bytes as the answers have together: a byte of noise, and the last answer is cut.",
            "Packets are found by what they are, not by where they should be.",
        ),
    }
)
"""Name -> note, for FEETECH streams."""


def _upload(*frames: tuple[int, bytes]) -> SdoCase:
    return SdoCase(SdoRequest("upload", NODE, 0x6002, 0), (frames,), "")


def _frame(data: str, identifier: int = sdo.REPLY + NODE) -> tuple[int, bytes]:
    return identifier, bytes.fromhex(data)


_ANSWER: Final = _frame("4B02600064000000")

SDO_NOTES: Final[Mapping[str, SdoNote]] = MappingProxyType(
    {
        "more-than-the-frame": SdoNote(
            _upload(_frame("4B026000C8000000"), _ANSWER),
            "The first frame that suits is the answer; a second one behind it is not looked at. So a late "
            "answer to the same question counts as the new one.",
            "Two answers to one question: one of them is old. Neither is believed, and the question is asked again "
            "when it is quiet.",
        ),
        "first-frame-counts": SdoNote(
            _upload(_frame("64000000"), _ANSWER),
            "The first frame under the identifier of replies is taken for the answer, and if it is none, the call has "
            "failed: a position report (as here), or the late answer to another question.",
            "Answers are known by kind, index, sub-index and length. A report goes to whoever listens, a late answer "
            "to another question is passed over, and the true one counts.",
        ),
        "short-frame": SdoNote(
            SdoCase(SdoRequest("download", NODE, 0x6003, 0, b"\x64\0"), ((_frame("6B020000"),),), ""),
            "Frames of fewer than eight bytes are taken: here the report of a position of 619 counts is taken for the "
            "acknowledgement of a write, for its first byte is 0x6B.",
            "An SDO frame has eight bytes (CiA 301); what has four is a report.",
        ),
        "abort-of-another": SdoNote(
            _upload(_frame("8003600012000706")),
            "A refusal is taken for the answer, whatever object it names.",
            "A refusal that names another object answers another request. One that names none (0:0), or the index "
            "without the sub-index, is taken, since the manual leaves open what it repeats.",
        ),
        "acknowledgement-of-another": SdoNote(
            SdoCase(SdoRequest("download", NODE, 0x6003, 0, b"\x64\0"), ((_frame("600B300000000000"),),), ""),
            "Index and sub-index of the acknowledgement of a write are not compared, nor the lower bits of its "
            "specifier: the late acknowledgement of one write stands for that of another.",
            "Both are compared, and nothing but 0x60 acknowledges a write.",
        ),
        "announced-size": SdoNote(
            SdoCase(
                SdoRequest("upload", NODE, 0x100A, 0),
                ((_frame("410A100009000000"),), (_frame("054B53542D580000"),)),
                "",
            ),
            "The size that a transfer in segments announces is not compared with what came; a segment without data "
            "ends it.",
            "A text that is shorter or longer than announced is an error, and so is a segment that brings nothing.",
        ),
    }
)
"""Name -> note, for SDO streams."""


class RequestNote(NamedTuple):
    """What they send, and what we send and why."""

    decoders: tuple[Decoder, ...]
    they: str
    we: str


REQUEST_NOTES: Final[Mapping[str, RequestNote]] = MappingProxyType(
    {
        "frame-of-250": RequestNote(
            (OLD, NEW),
            "A packet of more than 250 bytes is refused, and nothing is sent.",
            "The length byte allows 259 bytes, which is the bound here; rustypot agrees.",
        ),
        "length-stated": RequestNote(
            (CANOPEN,),
            "A write states its length: specifier 0x2F, 0x2B, 0x27 or 0x23.",
            "As the KST manual has it, 0x22, which does not; the same bytes as theirs with `sized`, which the driver "
            "uses for a servo that asks for it. Everything behind the first byte is the same.",
        ),
        "abort-of-silence": RequestNote(
            (CANOPEN,),
            "After silence an abort is sent, which names object 0:0.",
            "Nothing is sent until the line has been quiet: no servo holds a transfer open for a single frame.",
        ),
    }
)
"""Name -> note, for what is sent."""
