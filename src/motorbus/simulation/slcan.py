"""The adapter's side of slcan, the line protocol of the LAWICEL CAN232 and of most USB-CAN adapters since.

No I/O, no clock: bytes go in, frames and answers come out. Sources: LAWICEL CAN232 manual (commands, answers, status
bits), Philips SJA1000 data sheet (bit timing), and what python-can sends. Left out: polling (X0, P, A) and the
acceptance filter (M, m, W), which are refused as by adapters without them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame

RATES: Final = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
"""bit/s of S0 to S8. Some hosts use S7 for 750 kbit/s; the LAWICEL manual says 800."""
OK: Final = b"\r"
ERROR: Final = b"\a"
VERSION: Final = b"1013"  # hardware 1.0, software 1.3; hosts read the four digits as numbers
SERIAL: Final = b"SIMU"
MAX_LINE: Final = 32  # characters; a 29-bit frame of 8 bytes has 26
MINUTE: Final = 60_000  # ms; timestamps are 0 again after it
CRYSTAL: Final = 8_000_000  # Hz after the fixed divider by two
BUS_ERROR: Final = 1 << 7  # of the status

_FRAME: Final = re.compile(
    rb"(?:([tr])([0-7][0-9A-Fa-f]{2})|([TR])([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)"
)


class SlcanAdapter:
    """One adapter, at first closed and without a bit rate. No input makes it raise.

    As most adapters and unlike a CAN232 it accepts an open channel being opened again: python-can does that.
    """

    def __init__(self) -> None:
        self.is_open = False
        self.listen_only = False
        self.bitrate: int | None = None
        self._line = bytearray()
        self._answer = bytearray()
        self._has_timestamps = False
        self._status = 0

    def receive(self, data: bytes) -> list[CanFrame]:
        """Take bytes of the host, cut anywhere; return the frames that it sends."""
        frames: list[CanFrame] = []
        *lines, rest = data.split(b"\r")
        for line in lines:
            self._keep(line)
            frame = self._carry_out(bytes(self._line).strip(b"\n"))
            self._line.clear()
            if frame is not None:
                frames.append(frame)
        self._keep(rest)
        return frames

    def take_answer(self) -> bytes:
        """The answers to the bytes that were received."""
        answer = bytes(self._answer)
        self._answer.clear()
        return answer

    def encode(self, frame: CanFrame, at: float) -> bytes:
        """A frame of the bus at this moment (s) as the host receives it; b"" while closed.

        slcan has no form for an error frame; it sets a status bit.
        """
        if not self.is_open:
            return b""
        if frame.id & ERROR_FLAG:
            self._status |= BUS_ERROR
            return b""
        stamp = b"%04X" % (int(at * 1000) % MINUTE) if self._has_timestamps else b""
        return _encode(frame) + stamp + OK

    def _keep(self, piece: bytes) -> None:
        self._line += piece[: MAX_LINE + 1 - len(self._line)]

    def _carry_out(self, line: bytes) -> CanFrame | None:
        """Carry out one line; return the frame that it sends."""
        frame, answer = None, ERROR
        command, argument = line[:1], line[1:]
        if not line:
            answer = OK
        elif len(line) <= MAX_LINE and command in b"tTrR":
            frame = self._parse(line)
            if frame is not None:
                answer = b"Z\r" if frame.extended else b"z\r"
        elif len(line) <= MAX_LINE and command in _COMMANDS:
            form, action = _COMMANDS[command]
            if re.fullmatch(form, argument):
                answer = action(self, argument)
        self._answer += answer
        return frame

    def _parse(self, line: bytes) -> CanFrame | None:
        match = _FRAME.fullmatch(line)
        if match is None or not self.is_open or self.listen_only:
            return None
        standard, short, extended, long, count, digits = match.groups()
        data = bytes.fromhex(digits.decode())
        is_remote = (standard or extended) in b"rR"
        if len(data) != (0 if is_remote else int(count)):
            return None
        id = int(short or long, 16) | (REMOTE_FLAG if is_remote else 0)
        return CanFrame(id, bytes(int(count)) if is_remote else data, extended is not None)

    def _set_rate(self, argument: bytes) -> bytes:
        return self._set_bitrate(RATES[int(argument)])

    def _set_timing(self, argument: bytes) -> bytes:
        return self._set_bitrate(rate_of_timing(int(argument[:2], 16), int(argument[2:], 16)))

    def _set_bitrate(self, rate: int) -> bytes:
        if self.is_open:
            return ERROR
        self.bitrate = rate
        return OK

    def _open(self, listen_only: bool) -> bytes:
        self.is_open, self.listen_only = True, listen_only
        return OK

    def _close(self) -> bytes:
        self.is_open = self.listen_only = False
        return OK

    def _read_status(self) -> bytes:
        status, self._status = self._status, 0
        return b"F%02X\r" % status

    def _set_timestamps(self, argument: bytes) -> bytes:
        self._has_timestamps = argument == b"1"
        return OK


def rate_of_timing(btr0: int, btr1: int) -> int:
    """bit/s of an SJA1000 with a crystal of 16 MHz for these two registers."""
    quanta = 1 + (btr1 & 0x0F) + 1 + (btr1 >> 4 & 0x07) + 1
    return round(CRYSTAL / ((btr0 & 0x3F) + 1) / quanta)


def _encode(frame: CanFrame) -> bytes:
    id = frame.id & ~REMOTE_FLAG
    is_remote = frame.id & REMOTE_FLAG
    letter = b"r" if is_remote else b"t"
    digits = b"" if is_remote else frame.data.hex().upper().encode()
    head = letter.upper() + b"%08X" % id if frame.extended else letter + b"%03X" % id
    return head + b"%d" % len(frame.data) + digits


_COMMANDS: Final[dict[bytes, tuple[bytes, Callable[[SlcanAdapter, bytes], bytes]]]] = {
    b"S": (rb"[0-8]", SlcanAdapter._set_rate),
    b"s": (rb"[0-9A-Fa-f]{4}", SlcanAdapter._set_timing),
    b"O": (b"", lambda adapter, _: adapter._open(False)),
    b"L": (b"", lambda adapter, _: adapter._open(True)),
    b"C": (b"", lambda adapter, _: adapter._close()),
    b"V": (b"", lambda adapter, _: b"V" + VERSION + OK),
    b"N": (b"", lambda adapter, _: b"N" + SERIAL + OK),
    b"F": (b"", lambda adapter, _: adapter._read_status()),
    b"Z": (rb"[01]", SlcanAdapter._set_timestamps),
    b"X": (b"1", lambda adapter, _: OK),  # frames are sent without polling
    b"U": (rb"[0-6]", lambda adapter, _: OK),  # there is no UART
    b"Q": (rb"[0-2]", lambda adapter, _: OK),  # there is no power-up that would use it
}
"""The argument of each command, and its action; the answer ERROR is a refusal."""
