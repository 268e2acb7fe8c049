"""slcan adapters: lines of text that carry CAN frames over a serial line.

The back end of python-can ignores the replies of the adapter, so it does not notice a refused bit rate, and it stops
at a damaged line. Source: LAWICEL CAN232 manual.
"""

from __future__ import annotations

import contextlib
import re
import time
from typing import Final

from motorbus.core import units
from motorbus.core.can_frame import REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError, RequestError
from motorbus.link.can_options import SLCAN_RATES, CanOptions
from motorbus.link.can_text import TextChannel, TextCodec
from motorbus.link.lock import PortLock
from motorbus.link.serial import open_stream

STAMP: Final = 4  # hexadecimal digits of the timestamp that an adapter may append
FIRST_REPLY: Final = 0.05  # s and the latency of the port, in which an adapter that replies does so
REPLY_TIME: Final = 0.5  # s for each further reply
SILENT_PAUSE: Final = 0.003  # s of silence after which no more replies to an earlier program come
MOST_READS: Final = 64  # of data that is dropped, in a row
LINE_BITS: Final = 220  # on the serial line, of a line with an 11-bit identifier and 8 bytes
DEFAULT_BAUD: Final = 115_200

_FRAME: Final = re.compile(
    rb"(?:([tr])([0-7][0-9A-Fa-f]{2})|([TRx])([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)"
)
_CAN_FD: Final = b"dDbB"  # as CANable 2 writes it
_REPLY: Final = re.compile(rb"(?:[zZAQ]?|[VNF][0-9A-Za-z]{2,8})")


class SlcanCodec(TextCodec):
    """Lines of slcan. `reply` is the first reply since `forget`: True for CR, False for BEL, None for none.

    The length of a line tells whether the adapter has appended a timestamp. A damaged length digit must not look like
    one, so a line needs the form of the line before; two lines in a row of the other form change it.
    """

    line = re.compile(rb"([^\r\a]*)([\r\a])")
    cancel = b"?\r"

    def __init__(self) -> None:
        super().__init__()
        self.reply: bool | None = None
        self._stamped = False
        self._other_form = 0

    def forget(self) -> None:
        """Drop the reply and an unfinished line, before a command."""
        self.reply = None
        self._rest = b""

    def encode(self, frame: CanFrame) -> bytes:
        remote = frame.id & REMOTE_FLAG
        letter = ("R" if remote else "T") if frame.extended else ("r" if remote else "t")
        digits = "" if remote else frame.data.hex().upper()
        identifier = f"{frame.id & ~REMOTE_FLAG:0{8 if frame.extended else 3}X}"
        return f"{letter}{identifier}{len(frame.data)}{digits}\r".encode()

    def decode(self, line: re.Match[bytes]) -> CanFrame | None:
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


def _baud(name: str, said: object) -> int:
    """The rate of the serial line, bit/s. Raises RequestError."""
    try:
        return units.rate(said)
    except RequestError as refusal:
        raise RequestError(
            f"{name}: {said} is not a rate of the serial line in bit/s",
            expected=refusal.expected,
            advice="write can://slcan/dev/ttyACM0@1000000, or tty_baudrate=1000000",
        ) from None


class SlcanChannel(TextChannel):
    """An slcan adapter on its port; `configure` opens its channel. Errors as for `open_stream`.

    An adapter whose replies come later than `FIRST_REPLY` is used as one without replies: what it refuses is not
    noticed.
    """

    _codec: SlcanCodec

    def __init__(self, options: CanOptions, connect_time: float | None) -> None:
        port, _, baud = str(options.channel).partition("@")
        rate = _baud(options.name, baud or options.settings.get("tty_baudrate", DEFAULT_BAUD))
        lock = PortLock(port)  # the caller has locked it
        link = open_stream(port, rate=rate, lock=lock, connect_time=connect_time)
        super().__init__(options.name, link, SlcanCodec())
        self._first_reply = FIRST_REPLY + link.latency
        self._timing = options.settings.get("timing")
        if link.paced:  # one line each way on the serial line; adapters with their own USB are faster
            self.latency += 2 * LINE_BITS / rate

    def configure(self, rate: int, listen_only: bool) -> None:
        timing = self._timing
        replies = self._command("C", self._first_reply) is not None  # BEL: it is closed already
        for _ in range(MOST_READS):  # frames of the old rate, and replies to a program that was killed
            if not self._link.read(time.monotonic() + SILENT_PAUSE):
                break
        timeout = REPLY_TIME if replies else self._first_reply
        setting = f"S{SLCAN_RATES.index(rate)}" if timing is None else f"s{timing.btr0:02X}{timing.btr1:02X}"
        refusal = ""
        if self._command(setting, timeout) is False:
            refusal = f"refuses {rate} bit/s ({setting})"
        elif self._command("L" if listen_only else "O", timeout) is False:
            refusal = "cannot only listen" if listen_only else "refuses to open its channel"
        if refusal:
            raise LinkError(
                f"{self.name}: the adapter {refusal}",
                received="BEL (07)",
                expected="CR (0D)",
                advice="choose what the adapter can do; its manual lists the commands of slcan it knows",
            )
        self.trouble()  # a refused C is none

    def _command(self, command: str, timeout: float) -> bool | None:
        """Send a command; whether the adapter accepts it, or None when it does not reply in time (s)."""
        codec = self._codec
        codec.forget()
        self.send(f"{command}\r".encode())
        end = time.monotonic() + timeout
        while codec.reply is None and time.monotonic() < end:
            for data in self._link.read(end):
                assert isinstance(data, bytes)
                codec.feed(data)
        return codec.reply

    def close(self) -> None:
        """Close the channel of the adapter, and the port."""
        with contextlib.suppress(LinkError):
            self.send(b"C\r")
        super().close()
