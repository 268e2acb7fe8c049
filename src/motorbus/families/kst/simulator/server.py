"""The SDO server of one servo: which frame it answers with which.

What the manual shows comes first, CiA 301 fills its gaps, and where both leave a choice it is a switch. The order of
checks (object, then access, then length, then value) is that of common CANopen servers, an assumption here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Register
from motorbus.families.kst import sdo
from motorbus.families.kst.simulator import objects

if TYPE_CHECKING:
    from motorbus.families.kst.simulator.servo import Servo

TOGGLE: Final = 0x05030000
UNKNOWN_COMMAND: Final = 0x05040001
WRITE_ONLY: Final = 0x06010001
READ_ONLY: Final = 0x06010002
NO_OBJECT: Final = 0x06020000
OTHER_LENGTH: Final = 0x06070010
TOO_LONG: Final = 0x06070012
TOO_SHORT: Final = 0x06070013
NO_SUBINDEX: Final = 0x06090011
_EXPEDITED: Final = 4
_SEGMENT: Final = 7
_VERSIONS: Final = {"firmware_version": "firmware", "software_version": "software"}


class SdoServer:
    """Answers the requests to one servo, one at a time."""

    def __init__(self, servo: Servo) -> None:
        self._servo = servo
        self._transfer: _Transfer | None = None

    def forget(self) -> None:
        """A restart: no transfer is under way any more."""
        self._transfer = None

    def answer(self, request: sdo.SdoRequest, at: float) -> CanFrame | None:
        """The reply to this request, or None where there is silence."""
        servo = self._servo
        if servo.values.saving(at):
            return self._while_saving(request)
        if request.kind == "abort":  # the client gives up: nobody answers that (CiA 301)
            self._transfer = None
            return None
        if request.kind == "segment":
            return self._segment(request)
        self._transfer = None  # a new request ends what was under way (CiA 301: one transfer at a time)
        reply: CanFrame | int | None = UNKNOWN_COMMAND
        if request.kind == "upload":
            reply = self._upload(request, at)
        elif request.kind == "download":
            reply = self._download(request, at)
        return self._abort(request, reply) if isinstance(reply, int) else reply

    # -- reading ------------------------------------------------------------------------------------------------

    def _upload(self, request: sdo.SdoRequest, at: float) -> CanFrame | int:
        """Data bytes of a read are ignored: the manual shows an X there (command 4), CiA 301 reserves them."""
        row = self._row(request)
        if isinstance(row, int):
            return row
        if not (row.readable or (row.name == "bit_rate_code" and self._servo.switches.bit_rate_readable)):
            return WRITE_ONLY
        data = self._data(row, at)
        if len(data) <= _EXPEDITED:
            return self._value(request, data)
        self._transfer = _Transfer(request, data)
        extended = request.extended
        return sdo.encode_upload_start(
            self._servo.node, request.index, request.subindex, len(data), extended=extended
        )

    def _data(self, row: Register, at: float) -> bytes:
        servo = self._servo
        if row.name in _VERSIONS:  # first character first (manual, command 8)
            text: str = getattr(servo.switches, _VERSIONS[row.name])
            return text.encode("ascii").ljust(_EXPEDITED, b"\0")
        if row.name == "present_position" and servo.switches.status_6002 == "x1x2":
            return bytes((servo.switches.x1, servo.switches.x2))
        return (objects.read(servo, row.name, at) & (1 << 8 * row.size) - 1).to_bytes(row.size, "little")

    def _value(self, request: sdo.SdoRequest, data: bytes) -> CanFrame:
        return sdo.encode_upload_reply(
            self._servo.node, request.index, request.subindex, data, extended=request.extended
        )

    def _segment(self, request: sdo.SdoRequest) -> CanFrame:
        """CiA 301, segmented upload: seven bytes at a time, the toggle bit turning."""
        transfer, node = self._transfer, self._servo.node
        if transfer is None:
            return self._abort(request, UNKNOWN_COMMAND)
        if request.toggle != transfer.toggle:
            self._transfer = None
            return self._abort(transfer.request, TOGGLE)
        data, last = transfer.next()
        if last:
            self._transfer = None
        return sdo.encode_segment_reply(node, request.toggle, data, last, extended=request.extended)

    # -- writing ------------------------------------------------------------------------------------------------

    def _download(self, request: sdo.SdoRequest, at: float) -> CanFrame | int | None:
        row = self._row(request)
        if isinstance(row, int):
            return row
        if not row.writable:
            return READ_ONLY
        if request.sized:
            if not self._servo.switches.accept_sized:
                return UNKNOWN_COMMAND
            if len(request.data) != row.size:
                return TOO_LONG if len(request.data) > row.size else TOO_SHORT
        elif not self._servo.switches.accept_unsized and row.size != _EXPEDITED:
            return OTHER_LENGTH
        # Specifier 22 does not state the length: the object's own counts and the rest is ignored (CiA 301).
        refusal = objects.write(self._servo, row.name, row.decode(request.data[: row.size]), at)
        if refusal:
            return refusal
        if row.name == "store" and self._servo.switches.save_reply == "none":  # manual, command 3
            return None
        return sdo.encode_download_reply(
            self._servo.node, request.index, request.subindex, extended=request.extended
        )

    # -- both ---------------------------------------------------------------------------------------------------

    def _row(self, request: sdo.SdoRequest) -> Register | int:
        table = self._servo.profile.table
        row = table.at(request.index, request.subindex)
        if row is not None:
            return row
        known = any(entry.address == request.index for entry in table.values())
        return NO_SUBINDEX if known else NO_OBJECT

    def _while_saving(self, request: sdo.SdoRequest) -> CanFrame | None:
        """A save keeps it busy: requests are lost, or reads tell erased flash (public flight-controller driver)."""
        row = self._row(request)
        if self._servo.switches.flash_reads == "lost" or request.kind != "upload" or isinstance(row, int):
            return None
        return self._value(request, b"\xff" * row.size) if row.readable else None

    def _abort(self, request: sdo.SdoRequest, code: int) -> CanFrame:
        """A refusal (manual, command 9). In which order its code's bytes come, and what it names, are switches."""
        switches = self._servo.switches
        index = 0 if switches.abort_mux == "zero" else request.index
        subindex = request.subindex if switches.abort_mux == "echo" else 0
        if switches.abort_order == "big":
            code = int.from_bytes(code.to_bytes(4, "little"), "big")
        return sdo.encode_abort_reply(self._servo.node, index, subindex, code, extended=request.extended)


class _Transfer:
    """A value on its way in segments: what is left of it, and the toggle that must come next."""

    def __init__(self, request: sdo.SdoRequest, data: bytes) -> None:
        self.request = request
        self.toggle = 0
        self._left = data

    def next(self) -> tuple[bytes, bool]:
        """The next bytes, and whether they are the last."""
        data, self._left = self._left[:_SEGMENT], self._left[_SEGMENT:]
        self.toggle ^= 1
        return data, not self._left
