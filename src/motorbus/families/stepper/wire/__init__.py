"""What the bytes of the stepper controller mean: its requests, its replies, its dump, and the end of a project.

No parameter's meaning, no clock, no I/O. Nothing here raises on what a device sent, but for `decode_dump`, which a
caller asks whether it is one.
"""

from __future__ import annotations

from motorbus.families.stepper.wire.commands import (
    COMMANDS,
    IO,
    MOTOR_CLASS,
    SYSTEM,
    Command,
    Place,
    command_of,
)
from motorbus.families.stepper.wire.dump import ROW_LENGTH, Dump, decode_dump, dump_fault, encode_dump
from motorbus.families.stepper.wire.echo import Echo, echo, looks_like_echo
from motorbus.families.stepper.wire.frames import (
    DUMP_LENGTH,
    HEADER,
    IMAGE_LENGTH,
    MOTOR,
    MOTORS,
    NOTICE,
    ONLY,
    REPLY_LENGTH,
    REQUEST_LENGTH,
    Key,
    ReplyParts,
    RequestParts,
    checksum,
    decode_reply,
    decode_request,
    difference,
    encode,
    encode_reply,
    is_sound,
    key_due,
    key_of,
    named,
    replies_due,
    reply_fault,
    reply_length,
)
from motorbus.families.stepper.wire.receiver import COMPLETED, GAP, Receiver

__all__ = [
    "COMMANDS",
    "COMPLETED",
    "DUMP_LENGTH",
    "GAP",
    "HEADER",
    "IMAGE_LENGTH",
    "IO",
    "MOTOR",
    "MOTORS",
    "MOTOR_CLASS",
    "NOTICE",
    "ONLY",
    "REPLY_LENGTH",
    "REQUEST_LENGTH",
    "ROW_LENGTH",
    "SYSTEM",
    "Command",
    "Dump",
    "Echo",
    "Key",
    "Place",
    "Receiver",
    "ReplyParts",
    "RequestParts",
    "checksum",
    "command_of",
    "decode_dump",
    "decode_reply",
    "decode_request",
    "difference",
    "dump_fault",
    "echo",
    "encode",
    "encode_dump",
    "encode_reply",
    "is_sound",
    "key_due",
    "key_of",
    "looks_like_echo",
    "named",
    "replies_due",
    "reply_fault",
    "reply_length",
]
