"""The SDO server of one simulated servo: the reply to each request.

The manual comes first; CiA 301 fills its gaps.
The order of the checks is object, access, length, value, as in common CANopen servers. # assumption
"""

from __future__ import annotations

from math import inf
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Register
from motorbus.families.kst import sdo
from motorbus.families.kst.profiles import VERSIONS
from motorbus.families.kst.simulator.servo import Servo

UNKNOWN_COMMAND: Final = 0x0504_0001
WRITE_ONLY: Final = 0x0601_0001
READ_ONLY: Final = 0x0601_0002
NO_OBJECT: Final = 0x0602_0000
OTHER_LENGTH: Final = 0x0607_0010
TOO_LONG: Final = 0x0607_0012
TOO_SHORT: Final = 0x0607_0013
NO_SUBINDEX: Final = 0x0609_0011
TURNAROUND: Final = 0.0001  # s from the end of a request to the start of its reply # assumption
MAILBOX: Final = 16  # requests that may wait for a servo # assumption


class SdoServer:
    """Replies to the requests to one servo, one at a time."""

    def __init__(self, servo: Servo) -> None:
        self._servo = servo
        self._losses_seen = 0
        self._busy_until = -inf

    def receive(self, request: sdo.SdoRequest, at: float) -> None:
        """Carry out a request and reply, one after the other. More requests than `MAILBOX` are lost."""
        servo = self._servo
        if self._losses_seen != servo.power_losses:
            self._losses_seen, self._busy_until = servo.power_losses, -inf
        if self._busy_until - at > MAILBOX * TURNAROUND:
            return
        servo.extended = request.extended
        if servo.flash.saving(at):
            return  # lost (flight-controller driver)
        reply = self._answer(request, at)
        is_read = request.kind != "download"
        if reply is None or (request.node == sdo.BROADCAST and is_read and not servo.quirks.broadcast_read):
            return
        self._busy_until = max(at, self._busy_until) + TURNAROUND
        servo.send(servo, self._busy_until + servo.delay, reply)

    def _answer(self, request: sdo.SdoRequest, at: float) -> CanFrame | None:
        """The reply to this request, None for no reply."""
        if request.kind == "abort":
            return None
        reply: CanFrame | int | None
        table = self._servo.profile.table
        row = table.at(request.index, request.subindex)
        if request.kind == "unknown":
            reply = UNKNOWN_COMMAND
        elif row is None:
            known = any(one.address == request.index for one in table.values())
            reply = NO_SUBINDEX if known else NO_OBJECT
        elif request.kind == "upload":
            reply = self._upload(request, row, at)
        else:
            reply = self._download(request, row, at)
        return self._abort(request, reply) if isinstance(reply, int) else reply

    def _upload(self, request: sdo.SdoRequest, row: Register, at: float) -> CanFrame | int:
        """The reply with the value, or an abort code.

        The data bytes of the request are ignored (manual, command 4; reserved in CiA 301).
        """
        if not row.readable:
            return WRITE_ONLY
        servo, quirks = self._servo, self._servo.quirks
        if row.name in VERSIONS:
            data = servo.version(row.name)
        elif row.name == "present_position" and quirks.status_6002 == "x1x2":
            data = bytes((quirks.x1, quirks.x2))
        else:
            data = (servo.read(row.name, at) & (1 << 8 * row.size) - 1).to_bytes(row.size, "little")
        node, index, subindex = servo.node, request.index, request.subindex
        if len(data) <= sdo.EXPEDITED:
            return sdo.encode_upload_reply(node, index, subindex, data)
        return sdo.encode_upload_start(node, index, subindex, len(data))

    def _download(self, request: sdo.SdoRequest, row: Register, at: float) -> CanFrame | int | None:
        quirks = self._servo.quirks
        if not row.writable:
            return READ_ONLY
        if request.sized and not quirks.accept_sized:
            return UNKNOWN_COMMAND
        if request.sized and len(request.data) != row.size:
            return TOO_LONG if len(request.data) > row.size else TOO_SHORT
        if not request.sized and not quirks.accept_unsized and row.size != sdo.EXPEDITED:
            return OTHER_LENGTH
        # Without a stated length the size of the object counts, and the other bytes are ignored (CiA 301).
        code = self._servo.write(row, row.decode(request.data[: row.size]), at)
        if code:
            return code
        if row.name == "store" and quirks.save_reply == "none":
            return None
        return sdo.encode_download_reply(self._servo.node, request.index, request.subindex)

    def _abort(self, request: sdo.SdoRequest, code: int) -> CanFrame:
        """An abort repeats the index (manual, command 9) and also the sub-index of the request. # assumption"""
        return sdo.encode_abort_reply(self._servo.node, request.index, request.subindex, code)
