"""slcan adapters: lines of text that carry CAN frames over a serial line or TCP.

The back end of python-can ignores the replies of the adapter, so it does not notice a refused bit rate, and it stops
at a damaged line. Source: LAWICEL CAN232 manual.
"""

from __future__ import annotations

import contextlib
import re
import time
from typing import Final

from motorbus.core import units
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import LinkError, RequestError
from motorbus.link.can import CanLink
from motorbus.link.errors import full
from motorbus.link.lock import PortLock
from motorbus.link.serial import open_stream

RATES: Final = {
    10_000: b"S0",
    20_000: b"S1",
    50_000: b"S2",
    100_000: b"S3",
    125_000: b"S4",
    250_000: b"S5",
    500_000: b"S6",
    800_000: b"s0016",  # S7 is 800 kbit/s in the LAWICEL manual and 750 kbit/s in python-can; this sets BTR0, BTR1
    1_000_000: b"S8",
}
"""Command of each rate in bit/s."""
STAMP: Final = 4  # hexadecimal digits of the timestamp that an adapter may append
LONGEST: Final = 512  # bytes kept of a line without end; the longest line has fewer than 60
FIRST_REPLY: Final = 0.05  # s and the latency of the port, in which an adapter that replies does so
REPLY_TIME: Final = 0.5  # s for each further reply
SILENT_PAUSE: Final = 0.003  # s of silence after which no more replies to an earlier program come
MOST_READS: Final = 64  # of data that is dropped, in a row
LINE_BITS: Final = 220  # on the serial line, of a line with an 11-bit identifier and 8 bytes
DEFAULT_BAUD: Final = 115_200
CANCEL: Final = b"?\r"  # makes an unfinished line invalid

_LINE: Final = re.compile(rb"([^\r\a]*)([\r\a])")
_FRAME: Final = re.compile(
    rb"(?:t([0-7][0-9A-Fa-f]{2})|[Tx]([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)"
)
_DROPPED: Final = b"rRdDbB"  # remote frames; CAN FD as CANable 2 writes it
_REPLY: Final = re.compile(rb"(?:[zZAQ]?|[VNF][0-9A-Za-z]{2,8})")


class SlcanCodec:
    """Lines of slcan; nothing that arrives raises an error.

    `reply` is the first reply since `forget`: True for CR, False for BEL, None for none. `damaged` counts lines,
    `refused` frames and commands. A frame may end with a timestamp, so a damaged length digit can make a frame two
    bytes shorter: no reply of a device has both lengths. Remote and CAN FD frames are dropped.
    """

    def __init__(self) -> None:
        self.reply: bool | None = None
        self.damaged = 0
        self.refused = 0
        self._rest = b""

    def forget(self) -> None:
        """Drop the reply and an unfinished line, before a command."""
        self.reply = None
        self._rest = b""

    def encode(self, frame: CanFrame) -> bytes:
        """The line that sends this frame."""
        head = f"T{frame.id:08X}" if frame.extended else f"t{frame.id:03X}"
        return f"{head}{len(frame.data)}{frame.data.hex().upper()}\r".encode()

    def feed(self, data: bytes) -> list[CanFrame]:
        """The frames that these bytes of the adapter complete, cut anywhere."""
        text = self._rest + data
        frames = []
        end = 0
        for line in _LINE.finditer(text):
            end = line.end()
            frame = self._decode(line[1].strip(b"\n"), line[2] == b"\a")
            if frame is not None:
                frames.append(frame)
        self._rest = text[end:]
        if len(self._rest) > LONGEST:
            self._rest = b""
            self.damaged += 1
        return frames

    def _decode(self, text: bytes, refused: bool) -> CanFrame | None:
        """The frame of a line; None for a reply or a damaged line."""
        if not refused and (line := _FRAME.fullmatch(text)):
            short, long, count, digits = line.groups()
            if len(digits) - 2 * int(count) in (0, STAMP):
                data = bytes.fromhex(digits[: 2 * int(count)].decode())
                return CanFrame(int(short or long, 16), data, long is not None)
        is_reply = _REPLY.fullmatch(text) is not None
        if self.reply is None and (refused or is_reply):
            self.reply = not refused
        self.refused += refused
        self.damaged += not is_reply and text[:1] not in _DROPPED
        return None


class SlcanLink(CanLink):
    """An slcan adapter. Errors as for `open_stream`; RequestError too for an impossible rate of its serial line.

    The channel of its address is a port, with `@` and the rate of its serial line (bit/s). An adapter whose replies
    come later than `FIRST_REPLY` is used as one without replies: what it refuses is not noticed.
    """

    _reported = 0, 0
    _unfinished = False
    """A line was sent in part. It must not become a frame later, so `CANCEL` is sent after it."""

    def open_port(self) -> None:
        if self.options:
            name = next(iter(self.options))
            raise RequestError(f"{self.name}: slcan has no option {name!r}", expected="listen_only")
        self._codec = SlcanCodec()
        port, _, text = self.address.channel.partition("@")
        baud = units.rate(text or DEFAULT_BAUD)
        lock = PortLock(port)  # not acquired: this link has locked the port
        self._stream = stream = open_stream(port, rate=baud, lock=lock, connect_time=self.connect_time)
        self.latency, self.warnings, self.fileno = stream.latency, stream.warnings, stream.fileno
        if stream.paced:  # one line each way on the serial line; adapters with their own USB are faster
            self.latency += 2 * LINE_BITS / baud

    def configure(self, rate: int) -> None:
        if rate not in RATES:
            raise LinkError(
                f"{self.name}: slcan has no bit rate of {rate} bit/s",
                expected=f"one of {', '.join(str(one) for one in RATES)} bit/s",
            )
        first_reply = FIRST_REPLY + self._stream.latency
        replies = self._command(b"C", first_reply) is not None  # BEL: it is closed already
        for _ in range(MOST_READS):  # frames of the old rate, and replies to a program that was killed
            if not self._stream.read(time.monotonic() + SILENT_PAUSE):
                break
        timeout = REPLY_TIME if replies else first_reply
        refusal = ""
        if self._command(RATES[rate], timeout) is False:
            refusal = f"refuses {rate} bit/s ({RATES[rate].decode()})"
        elif self._command(b"L" if self.listen_only else b"O", timeout) is False:
            refusal = "cannot only listen" if self.listen_only else "refuses to open its channel"
        if refusal:
            raise LinkError(
                f"{self.name}: the adapter {refusal}",
                received="BEL (07)",
                expected="CR (0D)",
                advice="choose what the adapter can do; its manual lists the commands of slcan it knows",
            )
        self.trouble()  # a refused C is none

    def _command(self, command: bytes, timeout: float) -> bool | None:
        """Send a command; whether the adapter accepts it, or None when it does not reply in time (s)."""
        codec = self._codec
        codec.forget()
        self._send_line(command + b"\r")
        end = time.monotonic() + timeout
        while codec.reply is None and time.monotonic() < end:
            self._receive(end)
        return codec.reply

    def _receive(self, until: float) -> list[Data]:
        frames: list[Data] = []
        for data in self._stream.read(until):
            assert isinstance(data, bytes)
            frames += self._codec.feed(data)
        return frames

    def read(self, until: float) -> list[Data]:
        frames = self._receive(until)
        while not frames and time.monotonic() < until:
            frames = self._receive(until)
        return frames

    def send(self, frame: CanFrame) -> None:
        self._send_line(self._codec.encode(frame))

    def _send_line(self, text: bytes) -> None:
        """Send a whole line. Raises LinkLost, or LinkFull: a line that was sent in part is no frame."""
        if self._unfinished and self._stream.send(CANCEL) == len(CANCEL):
            self._unfinished = False
        written = 0 if self._unfinished else self._stream.send(text)
        if written != len(text):
            self._unfinished = self._unfinished or written > 0
            raise full(self.name, 0, len(text))

    def trouble(self) -> str:
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

    def shut(self) -> None:
        """Close the channel of the adapter, and the port."""
        with contextlib.suppress(LinkError):
            self._send_line(b"C\r")
        self._stream.close()
