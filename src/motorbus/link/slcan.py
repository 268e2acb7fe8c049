"""slcan adapters: lines of text that carry CAN frames over a serial line or TCP.

The back end of python-can ignores the replies of the adapter, so it does not notice a refused bit rate, and it stops
at a damaged line. Source: LAWICEL CAN232 manual.
"""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Mapping
from typing import Final

from motorbus.core import units
from motorbus.core.can_frame import REMOTE_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.errors import LinkError, RequestError
from motorbus.link.errors import full
from motorbus.link.lock import PortLock
from motorbus.link.serial import open_stream

RATES: Final = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 0, 1_000_000)
"""bit/s of the commands S0 to S8. S7 is not used: 800 kbit/s in the LAWICEL manual, 750 kbit/s in python-can."""
RATE_ADVICE: Final = "S7 means 800 or 750 kbit/s, so it is not used; bitrate=800000,btr=0016 is 800 kbit/s"
CLOCK: Final = 8_000_000  # Hz of BTR0 and BTR1 (SJA1000 at 16 MHz)
STAMP: Final = 4  # hexadecimal digits of the timestamp that an adapter may append
LONGEST: Final = 512  # bytes kept of a line without end; the longest line has fewer than 60
FIRST_REPLY: Final = 0.05  # s and the latency of the port, in which an adapter that replies does so
REPLY_TIME: Final = 0.5  # s for each further reply
SILENT_PAUSE: Final = 0.003  # s of silence after which no more replies to an earlier program come
MOST_READS: Final = 64  # of data that is dropped, in a row
LINE_BITS: Final = 220  # on the serial line, of a line with an 11-bit identifier and 8 bytes
DEFAULT_BAUD: Final = 115_200
OPTIONS: Final = ("btr", "tty_baudrate")
CANCEL: Final = b"?\r"  # makes an unfinished line invalid

_LINE: Final = re.compile(rb"([^\r\a]*)([\r\a])")
_FRAME: Final = re.compile(
    rb"(?:([tr])([0-7][0-9A-Fa-f]{2})|([TRx])([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)"
)
_CAN_FD: Final = b"dDbB"  # as CANable 2 writes it
_REPLY: Final = re.compile(rb"(?:[zZAQ]?|[VNF][0-9A-Za-z]{2,8})")


class SlcanCodec:
    """Lines of slcan; nothing that arrives raises an error.

    `reply` is the first reply since `forget`: True for CR, False for BEL, None for none. `damaged` counts lines,
    `refused` frames and commands.

    The length of a line tells whether the adapter has appended a timestamp. A damaged length digit must not look like
    one, so a line needs the form of the line before; two lines in a row of the other form change it.
    """

    def __init__(self) -> None:
        self.reply: bool | None = None
        self.damaged = 0
        self.refused = 0
        self._rest = b""
        self._stamped = False
        self._other_form = 0

    def forget(self) -> None:
        """Drop the reply and an unfinished line, before a command."""
        self.reply = None
        self._rest = b""

    def encode(self, frame: CanFrame) -> bytes:
        """The line that sends this frame."""
        remote = frame.id & REMOTE_FLAG
        letter = ("R" if remote else "T") if frame.extended else ("r" if remote else "t")
        digits = "" if remote else frame.data.hex().upper()
        identifier = f"{frame.id & ~REMOTE_FLAG:0{8 if frame.extended else 3}X}"
        return f"{letter}{identifier}{len(frame.data)}{digits}\r".encode()

    def feed(self, data: bytes) -> list[CanFrame]:
        """The frames that these bytes of the adapter complete, cut anywhere."""
        text = self._rest + data
        frames = []
        end = 0
        for line in _LINE.finditer(text):
            end = line.end()
            frame = self._decode(line)
            if frame is not None:
                frames.append(frame)
        self._rest = text[end:]
        if len(self._rest) > LONGEST:
            self._rest = b""
            self.damaged += 1
        return frames

    def _decode(self, line: re.Match[bytes]) -> CanFrame | None:
        """The frame of a line; None for a reply or a damaged line."""
        text, end = line[1].strip(b"\n"), line[2]
        if end == b"\a":
            self.refused += 1
            self.damaged += bool(text)
            self._keep_reply(False)
        elif match := _FRAME.fullmatch(text):
            return self._decode_frame(match)
        elif _REPLY.fullmatch(text):
            self._keep_reply(True)
        elif text[:1] not in _CAN_FD:
            self.damaged += 1
        return None

    def _keep_reply(self, accepted: bool) -> None:
        if self.reply is None:
            self.reply = accepted

    def _decode_frame(self, line: re.Match[bytes]) -> CanFrame | None:
        standard, short, extended, long, count, digits = line.groups()
        remote = (standard or extended) in b"rR"
        size = int(count)
        surplus = len(digits) - (0 if remote else 2 * size)
        stamped = surplus == STAMP
        if surplus in (0, STAMP):
            self._other_form = 0 if stamped == self._stamped else self._other_form + 1
            if self._other_form == 2:
                self._stamped, self._other_form = stamped, 0
        if surplus not in (0, STAMP) or self._other_form:
            self.damaged += 1
            return None
        identifier = int(short or long, 16)
        if remote:
            return CanFrame(identifier | REMOTE_FLAG, bytes(size), extended is not None)
        return CanFrame(identifier, bytes.fromhex(digits[: 2 * size].decode()), extended is not None)


class SlcanChannel:
    """An slcan adapter on its port; `configure` opens its channel. Errors as for `open_stream`.

    `channel` is a port, with `@` and the rate of its serial line (bit/s). `options`: `tty_baudrate`, that rate; `btr`,
    BTR0 and BTR1 as four hexadecimal digits. An adapter whose replies come later than `FIRST_REPLY` is used as one
    without replies: what it refuses is not noticed.
    """

    def __init__(
        self, name: str, channel: str, options: Mapping[str, object], connect_time: float | None
    ) -> None:
        self.name = name
        for option in options:
            if option not in OPTIONS:
                raise RequestError(
                    f"{name}: slcan has no option {option!r}", expected=f"one of {', '.join(OPTIONS)}"
                )
        self._timing = read_timing(name, options["btr"]) if "btr" in options else b""
        port, _, baud = channel.partition("@")
        rate = _read_baud(name, baud or options.get("tty_baudrate", DEFAULT_BAUD))
        self._link = link = open_stream(
            port,
            rate=rate,
            lock=PortLock(port),  # the caller has locked it
            connect_time=connect_time,
        )
        self.latency = link.latency
        self.warnings = link.warnings
        self._first_reply = FIRST_REPLY + link.latency
        if link.paced:  # one line each way on the serial line; adapters with their own USB are faster
            self.latency += 2 * LINE_BITS / rate
        self._codec = SlcanCodec()
        self._reported = 0, 0
        self._unfinished = False
        """A line was sent in part. It must not become a frame later, so `CANCEL` is sent after it."""

    def configure(self, rate: int, listen_only: bool) -> None:
        """Open the channel again, at this rate in bit/s. Raises LinkError for a rate or mode that it refuses."""
        command = self._rate_command(rate)
        replies = self._command(b"C", self._first_reply) is not None  # BEL: it is closed already
        for _ in range(MOST_READS):  # frames of the old rate, and replies to a program that was killed
            if not self._link.read(time.monotonic() + SILENT_PAUSE):
                break
        timeout = REPLY_TIME if replies else self._first_reply
        refusal = ""
        if self._command(command, timeout) is False:
            refusal = f"refuses {rate} bit/s ({command.decode()})"
        elif self._command(b"L" if listen_only else b"O", timeout) is False:
            refusal = "cannot only listen" if listen_only else "refuses to open its channel"
        if refusal:
            raise LinkError(
                f"{self.name}: the adapter {refusal}",
                received="BEL (07)",
                expected="CR (0D)",
                advice="choose what the adapter can do; its manual lists the commands of slcan it knows",
            )
        self.trouble()  # a refused C is none

    def _rate_command(self, rate: int) -> bytes:
        if self._timing:
            made = rate_of_timing(*self._timing)
            if made != rate:
                raise LinkError(
                    f"{self.name}: btr={self._timing.hex()} makes {made} bit/s, not {rate}",
                    advice=f"write bitrate={made}, or leave btr out",
                )
            return b"s" + self._timing.hex().upper().encode()
        if rate and rate in RATES:
            return b"S%d" % RATES.index(rate)
        raise LinkError(
            f"{self.name}: slcan has no bit rate of {rate} bit/s",
            expected=f"one of {', '.join(str(one) for one in RATES if one)} bit/s",
            advice=RATE_ADVICE,
        )

    def _command(self, command: bytes, timeout: float) -> bool | None:
        """Send a command; whether the adapter accepts it, or None when it does not reply in time (s)."""
        codec = self._codec
        codec.forget()
        self._send(command + b"\r")
        end = time.monotonic() + timeout
        while codec.reply is None and time.monotonic() < end:
            self._receive(end)
        return codec.reply

    def _receive(self, until: float) -> list[CanFrame]:
        frames = []
        for data in self._link.read(until):
            assert isinstance(data, bytes)
            frames += self._codec.feed(data)
        return frames

    def read(self, until: float) -> list[Data]:
        """See `Link.read`."""
        frames: list[Data] = []
        while not frames:
            frames += self._receive(until)
            if time.monotonic() >= until:
                break
        return frames

    def write(self, frame: CanFrame) -> None:
        """See `Link.write`."""
        self._send(self._codec.encode(frame))

    def _send(self, text: bytes) -> None:
        """Send a whole line. Raises LinkLost, or LinkFull: a line that was sent in part is no frame."""
        if self._unfinished and self._link.send(CANCEL) == len(CANCEL):
            self._unfinished = False
        written = 0 if self._unfinished else self._link.send(text)
        if written != len(text):
            self._unfinished = self._unfinished or written > 0
            raise full(self.name, 0, len(text))

    def trouble(self) -> str:
        """What the adapter has reported since the last call; "" for nothing."""
        refused, damaged = self._codec.refused, self._codec.damaged
        before, self._reported = self._reported, (refused, damaged)
        if refused > before[0]:
            return (
                f"the adapter refused {refused - before[0]} frames: no node on the bus acknowledges them, the bit rate "
                "is another, or its buffer is full"
            )
        if damaged > before[1]:
            return f"{damaged - before[1]} lines of the adapter were damaged: its cable, or another program on its port"
        return ""

    def fileno(self) -> int | None:
        """See `Link.fileno`."""
        return self._link.fileno()

    def close(self) -> None:
        """Close the channel of the adapter, and the port."""
        with contextlib.suppress(LinkError):
            self._send(b"C\r")
        self._link.close()


def read_timing(name: str, text: object) -> bytes:
    """BTR0 and BTR1 of the option `btr`. Raises RequestError."""
    if re.fullmatch(r"[0-9A-Fa-f]{4}", str(text)) is None:
        raise RequestError(f"{name}: btr={text}: not four hexadecimal digits", expected="as btr=0016")
    return bytes.fromhex(str(text))


def rate_of_timing(btr0: int, btr1: int) -> int:
    """Bit rate (bit/s) that these registers of an SJA1000 make."""
    return round(CLOCK / ((btr0 & 0x3F) + 1) / (3 + (btr1 & 0x0F) + (btr1 >> 4 & 0x07)))


def _read_baud(name: str, text: object) -> int:
    """The rate of the serial line (bit/s). Raises RequestError."""
    try:
        return units.rate(text)
    except RequestError as refusal:
        raise RequestError(
            f"{name}: {text} is not a rate of the serial line in bit/s",
            expected=refusal.expected,
            advice="write can://slcan/dev/ttyACM0@1000000, or tty_baudrate=1000000",
        ) from None
