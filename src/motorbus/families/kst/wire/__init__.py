"""What the frames of KST CAN servos mean: SDO requests and replies, aborts, start and stop, and what comes unasked.

No object names, no clock, no I/O. Nothing here raises on what a device sent; only who asks for the impossible gets a
RequestError.

    request   0x600 + node   8 bytes: specifier, index (2), sub-index, data (4), all little-endian   node 0: everyone
    reply     0x580 + node   8 bytes: the same shape; an abort carries a code
    report    0x580 + node   4 bytes: position (2), 0 0; sent without being asked, also seen under 0x180 + node

So a report and a reply share their identifier; they are told apart by length, never by the first byte.
Source: KST CAN protocol manual; CiA 301 for the specifier bits; what is sent unasked is known from public drivers.
"""

from __future__ import annotations

from motorbus.families.kst.wire.abort import ABORTS, abort_text
from motorbus.families.kst.wire.frames import (
    EVERYONE,
    LENGTH,
    NODES,
    REPLY,
    REQUEST,
    Multiplexer,
    encode_abort,
    encode_download,
    encode_segment,
    encode_upload,
)
from motorbus.families.kst.wire.key import Key, download_due, segment_due, upload_due
from motorbus.families.kst.wire.notices import (
    ALARM,
    EMERGENCY,
    HEARTBEAT,
    LOW_VOLTAGE,
    PDO,
    REPORT_LENGTH,
    STATES,
    Start,
    addressed,
    decode_notice,
    decode_report,
    decode_start,
    encode_alarm,
    encode_boot,
    encode_report,
    encode_start,
    says_boot,
)
from motorbus.families.kst.wire.receiver import FrameReceiver
from motorbus.families.kst.wire.sdo import (
    SdoReply,
    SdoRequest,
    decode_reply,
    decode_request,
    encode_abort_reply,
    encode_download_reply,
    encode_segment_reply,
    encode_upload_reply,
    encode_upload_start,
    usual_head,
)

__all__ = [
    "ABORTS",
    "ALARM",
    "EMERGENCY",
    "EVERYONE",
    "HEARTBEAT",
    "LENGTH",
    "LOW_VOLTAGE",
    "NODES",
    "PDO",
    "REPLY",
    "REPORT_LENGTH",
    "REQUEST",
    "STATES",
    "FrameReceiver",
    "Key",
    "Multiplexer",
    "SdoReply",
    "SdoRequest",
    "Start",
    "abort_text",
    "addressed",
    "decode_notice",
    "decode_reply",
    "decode_report",
    "decode_request",
    "decode_start",
    "download_due",
    "encode_abort",
    "encode_abort_reply",
    "encode_alarm",
    "encode_boot",
    "encode_download",
    "encode_download_reply",
    "encode_report",
    "encode_segment",
    "encode_segment_reply",
    "encode_start",
    "encode_upload",
    "encode_upload_reply",
    "encode_upload_start",
    "says_boot",
    "segment_due",
    "upload_due",
    "usual_head",
]
