"""The adapter's side of slcan, the line protocol of LAWICEL's CAN232 and of most USB-CAN adapters since.

A simulated bus speaks it on a pseudo-terminal or a socket, so that every program that knows such an adapter can open
it. No I/O and no clock: bytes go in, frames and answers come out. Sources: LAWICEL CAN232 manual (commands, answers,
status bits), Philips SJA1000 data sheet (bit timing, acceptance filter), and what python-can sends.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable
from typing import Final

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame

RATES: Final = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
"""bit/s of S0 to S8. Some hosts hold S7 for 750 kbit/s; the LAWICEL manual says 800."""
OK: Final = b"\r"
ERROR: Final = b"\a"
VERSION: Final = b"1013"
"""Hardware 1.0, software 1.3; four decimal digits, for hosts read them as numbers."""
SERIAL: Final = b"SIMU"
LONGEST_LINE: Final = 32
"""Characters kept of one line; a 29-bit frame of 8 bytes has 26. What is longer is refused at its end."""
FIFO: Final = 32
"""Received frames that wait to be polled, as in a CAN232."""
MINUTE: Final = 60_000
"""Timestamps count milliseconds and begin anew after so many."""
CRYSTAL: Final = 8_000_000
"""Hz after the controller's fixed divider by two: what BTR0 and BTR1 count in."""

_FRAME: Final = re.compile(
    rb"(?:([tr])([0-7][0-9A-Fa-f]{2})|([TR])([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)"
)
_FIFO_FULL, _OVERRUN, _BUS_ERROR = 1 << 0, 1 << 3, 1 << 7
_ALL: Final = 0xFFFF_FFFF


class SlcanAdapter:
    """One adapter, as `adapter.Adapter`: closed, without a bit rate, pushing frames by itself (auto-poll).

    `strict` refuses what a CAN232 refuses but most adapters forgive: to open what is open, to close what is closed,
    to open before a bit rate was set, and settings in the wrong state. python-can opens twice, so the usual one is
    forgiving.
    """

    def __init__(self, *, strict: bool = False) -> None:
        self.strict = strict
        self.open = False
        self.listen_only = False
        self.bitrate: int | None = None
        self._line = bytearray()
        self._answer = bytearray()
        self._frames: list[CanFrame] = []
        self._fifo: deque[bytes] = deque()
        self._auto_poll = True
        self._stamps = False
        self._status = 0
        self._filter = Filter()

    def feed(self, data: bytes, at: float = 0.0) -> list[CanFrame]:
        """Bytes of the host, cut anywhere: the frames it sends with them. Never raises."""
        *lines, rest = data.split(b"\r")
        for line in lines:
            self._keep(line)
            self._obey(bytes(self._line).strip(b"\n"))
            self._line.clear()
        self._keep(rest)
        frames, self._frames = self._frames, []
        return frames

    def take(self) -> bytes:
        """The answers to what was fed."""
        answer = bytes(self._answer)
        self._answer.clear()
        return answer

    def deliver(self, frame: CanFrame, at: float) -> bytes:
        """A frame of the bus, seen at this moment (s), as the host gets it: b"" while closed or waiting to be polled.

        slcan has no form for an error frame; it sets a status bit.
        """
        if not self.open:
            return b""
        if frame.id & ERROR_FLAG:
            self._status |= _BUS_ERROR
            return b""
        if not self._filter.passes(frame):
            return b""
        line = _line(frame) + (b"%04X" % (int(at * 1000) % MINUTE) if self._stamps else b"") + OK
        if self._auto_poll:
            return line
        if len(self._fifo) >= FIFO:
            self._status |= _FIFO_FULL | _OVERRUN
        else:
            self._fifo.append(line)
        return b""

    # -- one line -------------------------------------------------------------------------------------------

    def _keep(self, piece: bytes) -> None:
        self._line += piece[: LONGEST_LINE + 1 - len(self._line)]

    def _obey(self, line: bytes) -> None:
        if not line:
            self._answer += OK
            return
        answer = None
        if len(line) <= LONGEST_LINE:
            command, argument = line[:1], line[1:]
            if command in b"tTrR":
                answer = self._send(line)
            elif command in _COMMANDS:
                form, action = _COMMANDS[command]
                answer = action(self, argument) if re.fullmatch(form, argument) else None
        self._answer += ERROR if answer is None else answer

    def _send(self, line: bytes) -> bytes | None:
        match = _FRAME.fullmatch(line)
        if match is None or not self.open or self.listen_only:
            return None
        standard, short, extended, long, count, digits = match.groups()
        data = bytes.fromhex(digits.decode())
        remote = (standard or extended) in b"rR"
        if len(data) != (0 if remote else int(count)):
            return None
        id = int(short or long, 16) | (REMOTE_FLAG if remote else 0)
        self._frames.append(CanFrame(id, bytes(int(count)) if remote else data, extended is not None))
        if not self._auto_poll:
            return OK
        return b"Z\r" if extended else b"z\r"

    def _set_rate(self, argument: bytes) -> bytes | None:
        if self.open:
            return None
        self.bitrate = RATES[int(argument)]
        return OK

    def _set_timing(self, argument: bytes) -> bytes | None:
        if self.open:
            return None
        self.bitrate = rate_of_timing(int(argument[:2], 16), int(argument[2:], 16))
        return OK

    def _open(self, listen_only: bool) -> bytes | None:
        if self.strict and (self.open or self.bitrate is None):
            return None
        self.open, self.listen_only = True, listen_only
        return OK

    def _close(self) -> bytes | None:
        if self.strict and not self.open:
            return None
        self.open = self.listen_only = False
        self._fifo.clear()
        return OK

    def _read_status(self) -> bytes | None:
        if self.strict and not self.open:
            return None
        status, self._status = self._status, 0
        return b"F%02X\r" % status

    def _poll(self) -> bytes | None:
        if self._auto_poll or not self.open:
            return None
        return self._fifo.popleft() if self._fifo else OK

    def _poll_all(self) -> bytes | None:
        if self._auto_poll or not self.open:
            return None
        lines = b"".join(self._fifo)
        self._fifo.clear()
        return lines + b"A\r"

    def _configure(self, kind: bytes, argument: bytes) -> bytes | None:
        """A setting for a closed channel: taken at any time unless strict."""
        if self.strict and self.open:
            return None
        if kind == b"X":
            self._auto_poll = argument == b"1"
        elif kind == b"Z":
            self._stamps = argument == b"1"
        elif kind == b"W":
            self._filter.single = argument == b"1"
        elif kind == b"M":
            self._filter.code = int(argument, 16)
        elif kind == b"m":
            self._filter.mask = int(argument, 16)
        return OK  # U: there is no UART whose rate would change

    def _set_auto_start(self) -> bytes | None:
        """Q: taken in; there is no power-up that could make use of it."""
        return None if self.strict and not self.open else OK


class Filter:
    """The acceptance filter of an SJA1000: a bit set in `mask` does not matter, the others must be as in `code`.

    `single`: one filter of four bytes; else two of two bytes, either of which lets a frame in. All pass at first.
    """

    def __init__(self) -> None:
        self.code = 0
        self.mask = _ALL
        self.single = False

    def passes(self, frame: CanFrame) -> bool:
        """Does the host get to see this frame?"""
        if self.mask == _ALL:
            return True
        return any(
            not (pattern ^ self.code) & matters & ~self.mask for pattern, matters in self._patterns(frame)
        )

    def _patterns(self, frame: CanFrame) -> list[tuple[int, int]]:
        """What is compared with the code, and the bits of it that the controller looks at."""
        remote = 1 if frame.id & REMOTE_FLAG else 0
        id = frame.id & ~REMOTE_FLAG
        if frame.extended:
            if self.single:
                return [(id << 3 | remote << 2, _ALL & ~0b11)]
            high = id >> 13
            return [(high << 16, 0xFFFF_0000), (high, 0x0000_FFFF)]
        data = b"" if remote else frame.data[:2]
        first, second = (*data, 0, 0)[:2]
        if self.single:
            looked_at = (0, 0xFF00, 0xFFFF)[len(data)]
            return [(id << 21 | remote << 20 | first << 8 | second, 0xFFF0_0000 | looked_at)]
        looked_at = 0x000F_000F if data else 0
        whole = id << 21 | remote << 20 | (first >> 4) << 16 | (first & 0xF)
        return [(whole, 0xFFF0_0000 | looked_at), (id << 5 | remote << 4, 0x0000_FFF0)]


def rate_of_timing(btr0: int, btr1: int) -> int:
    """bit/s that an SJA1000 with a crystal of 16 MHz makes of these two registers."""
    quanta = 1 + (btr1 & 0x0F) + 1 + (btr1 >> 4 & 0x07) + 1
    return round(CRYSTAL / ((btr0 & 0x3F) + 1) / quanta)


def _line(frame: CanFrame) -> bytes:
    id = frame.id & ~REMOTE_FLAG
    remote = frame.id & REMOTE_FLAG
    letter = (b"R" if remote else b"T") if frame.extended else (b"r" if remote else b"t")
    digits = b"" if remote else frame.data.hex().upper().encode()
    return letter + (b"%08X" if frame.extended else b"%03X") % id + b"%d" % len(frame.data) + digits


_Action = Callable[[SlcanAdapter, bytes], bytes | None]


def _setting(kind: bytes) -> _Action:
    return lambda adapter, argument: adapter._configure(kind, argument)


_HEX8: Final = rb"[0-9A-Fa-f]{8}"
_COMMANDS: Final[dict[bytes, tuple[bytes, _Action]]] = {
    b"S": (rb"[0-8]", SlcanAdapter._set_rate),
    b"s": (rb"[0-9A-Fa-f]{4}", SlcanAdapter._set_timing),
    b"O": (b"", lambda adapter, _: adapter._open(False)),
    b"L": (b"", lambda adapter, _: adapter._open(True)),
    b"C": (b"", lambda adapter, _: adapter._close()),
    b"V": (b"", lambda adapter, _: b"V" + VERSION + OK),
    b"N": (b"", lambda adapter, _: b"N" + SERIAL + OK),
    b"F": (b"", lambda adapter, _: adapter._read_status()),
    b"P": (b"", lambda adapter, _: adapter._poll()),
    b"A": (b"", lambda adapter, _: adapter._poll_all()),
    b"Q": (rb"[0-2]", lambda adapter, _: adapter._set_auto_start()),
    b"X": (rb"[01]", _setting(b"X")),
    b"Z": (rb"[01]", _setting(b"Z")),
    b"W": (rb"[01]", _setting(b"W")),
    b"U": (rb"[0-6]", _setting(b"U")),
    b"M": (_HEX8, _setting(b"M")),
    b"m": (_HEX8, _setting(b"m")),
}
"""What each command takes, and what it does; None from an action is a refusal."""
