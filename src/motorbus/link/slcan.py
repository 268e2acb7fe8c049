"""slcan adapters: text lines that carry CAN frames over a serial line.

The back end of python-can reads byte by byte and does not look at the replies: it misses a refused bit rate and stops
at a damaged line. So this one goes over our own serial and TCP links. Source: LAWICEL CAN232 manual.
"""

from __future__ import annotations

import contextlib
import os
import re
import time
from math import inf
from typing import Final

from motorbus.core.operation import REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError
from motorbus.link.can_channel import Counts, TextChannel
from motorbus.link.can_options import CanOptions
from motorbus.link.can_rates import SLCAN_COMMANDS
from motorbus.link.lock import PortLock
from motorbus.link.serial import ByteLink, open_stream
from motorbus.link.tcp import LOOPBACK_LATENCY

LONGEST: Final = 512  # bytes kept of a line without end; the longest line has fewer than 60
REPLIES_KEPT: Final = 16  # the dialogue has three; later every frame that is sent has one
STAMP: Final = 4  # hexadecimal digits of the timestamp that an adapter may append

FIRST_REPLY: Final = 0.015  # s; an adapter that replies has begun to by then
FIRST_REPLY_NETWORK: Final = 0.1  # s
REPLY_TIME: Final = 0.5  # s for each further reply
SILENT_PAUSE: Final = (
    0.003  # s between commands to an adapter that does not reply; also of silence when replies end
)
LATE_REPLY: Final = 1.0  # s in which an adapter that seemed silent may still refuse the bit rate
MOST_READS: Final = 64  # of data that is dropped, in a row

LINE_BITS: Final = 220  # on the serial line, of a line with an 11-bit identifier and 8 bytes
DEFAULT_BAUD: Final = 115_200

_LINE: Final = re.compile(
    rb"(?:([tr])([0-7][0-9A-Fa-f]{2})|([TRx])([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)"
)
_CAN_FD: Final = b"dDbB"  # as CANable 2 writes it
_REPLIES: Final = re.compile(rb"(?:[zZAQ]?|[VNF][0-9A-Za-z]{2,8})")
_END: Final = re.compile(rb"[\r\a]")


class SlcanCodec:
    """Lines of slcan, as `Codec`.

    `replies` are the first replies since `forget`: True for CR, False for BEL. A timestamp is recognised by the length
    of the line. A damaged length digit must not look like one, so a line needs the form of the line before; two lines
    in a row of the other form change it.
    """

    cancel = b"?\r"

    def __init__(self) -> None:
        self.counts = Counts()
        self.replies: list[bool] = []
        self._rest = b""
        self._stamped = False
        self._other_form = 0

    def forget(self) -> None:
        """Drop earlier replies and an unfinished line, before a new dialogue."""
        self.replies.clear()
        self._rest = b""

    def encode(self, frame: CanFrame) -> bytes:
        remote = frame.id & REMOTE_FLAG
        letter = ("R" if remote else "T") if frame.extended else ("r" if remote else "t")
        digits = "" if remote else frame.data.hex().upper()
        identifier = f"{frame.id & ~REMOTE_FLAG:0{8 if frame.extended else 3}X}"
        return f"{letter}{identifier}{len(frame.data)}{digits}\r".encode()

    def feed(self, data: bytes) -> list[CanFrame]:
        text = self._rest + data
        frames = []
        begin = 0
        for end in _END.finditer(text):
            line, begin = text[begin : end.start()].strip(b"\n"), end.end()
            if end[0] == b"\a":
                self.counts.refused += 1
                self.counts.damaged += bool(line)
                self._keep_reply(False)
            elif match := _LINE.fullmatch(line):
                if (frame := self._frame(match)) is not None:
                    frames.append(frame)
            elif _REPLIES.fullmatch(line):
                self._keep_reply(True)
            elif line[:1] in _CAN_FD:
                self.counts.dropped += 1
            else:
                self.counts.damaged += 1
        self._rest = text[begin:]
        if len(self._rest) > LONGEST:
            self._rest = b""
            self.counts.damaged += 1
        return frames

    def _keep_reply(self, accepted: bool) -> None:
        if len(self.replies) < REPLIES_KEPT:
            self.replies.append(accepted)

    def _frame(self, line: re.Match[bytes]) -> CanFrame | None:
        standard, short, extended, long, count, digits = line.groups()
        remote = (standard or extended) in b"rR"
        size = int(count)
        surplus = len(digits) - (0 if remote else 2 * size)
        if surplus not in (0, STAMP) or not self._has_usual_form(surplus == STAMP):
            self.counts.damaged += 1
            return None
        identifier = int(short or long, 16)
        if remote:
            return CanFrame(identifier | REMOTE_FLAG, bytes(size), extended is not None)
        return CanFrame(identifier, bytes.fromhex(digits[: 2 * size].decode()), extended is not None)

    def _has_usual_form(self, stamped: bool) -> bool:
        self._other_form = 0 if stamped == self._stamped else self._other_form + 1
        if self._other_form == 2:
            self._stamped, self._other_form = stamped, 0
        return self._other_form == 0


class SlcanChannel(TextChannel):
    """An open slcan adapter. `first_reply` is the time-out (s) of its first reply."""

    def __init__(self, name: str, link: ByteLink, first_reply: float = FIRST_REPLY) -> None:
        self._slcan = SlcanCodec()
        super().__init__(name, link, self._slcan)
        self._first_reply = first_reply
        self._is_open = False
        self._pid = os.getpid()
        self._rate = ""
        self._rate_reply = 0  # its place among the replies
        self._late_until = -inf

    def configure(self, command: str, rate: int, *, listen_only: bool) -> None:
        """Close the channel, set the rate (bit/s) with this command, open it. Raises LinkError for a refusal.

        Frames that arrive meanwhile are dropped, for they may be of another rate. After an error the channel is closed.
        """
        replies = self._slcan.replies
        with self._access:
            self._drain()
            self._slcan.forget()
            self._is_open, self._late_until = False, -inf
            self._command("C", 1, self._first_reply)  # it may be closed already: any reply counts
            replying = bool(replies)
            if replying:
                self._settle()
            self._rate = f"{rate} bit/s ({command})"
            self._rate_reply = 0 if replying else 1  # the reply to C may still come
            timeout = REPLY_TIME if replying else SILENT_PAUSE
            self._command(command, self._rate_reply + 1, timeout)
            self._check_rate()
            self._is_open = True
            self._command("L" if listen_only else "O", self._rate_reply + 2, timeout)
            self._check_rate()
            if replies[self._rate_reply + 1 :] == [False]:
                what = "cannot only listen" if listen_only else "refuses to open its channel"
                raise self._refusal(f"the adapter {what}")
            if len(replies) <= self._rate_reply:
                self._late_until = time.monotonic() + LATE_REPLY
            self.counts.refused = 0  # a refused C is no fault

    def _check_rate(self) -> None:
        """Close the channel and raise LinkError when the adapter has refused the bit rate."""
        if self._slcan.replies[self._rate_reply : self._rate_reply + 1] == [False]:
            if self._is_open:
                self._is_open, self._late_until = False, -inf
                self._send(b"C\r")
            raise self._refusal(f"the adapter refuses {self._rate}")

    def _refusal(self, what: str) -> LinkError:
        return LinkError(
            f"{self.name}: {what}",
            received="BEL (07)",
            expected="CR (0D)",
            advice="choose what the adapter can do; its manual lists the commands of slcan it knows",
        )

    def _decode(self, data: bytes) -> list[CanFrame]:
        frames = super()._decode(data)
        if self._late_until > -inf:
            replied = len(self._slcan.replies) > self._rate_reply
            if replied or time.monotonic() > self._late_until:
                self._check_rate()
                self._late_until = -inf
        return frames

    def write(self, frame: CanFrame) -> None:
        if not self._is_open and self._rate:
            raise LinkError(
                f"{self.name}: the channel of the adapter is closed", cause=f"it refused {self._rate}"
            )
        super().write(frame)

    def _command(self, command: str, count: int, timeout: float) -> None:
        """Send a command and wait until there are so many replies in all."""
        self._send(f"{command}\r".encode())
        end = time.monotonic() + timeout
        while len(self._slcan.replies) < count and time.monotonic() < end:
            self._link.wait(end)
            self._drain()

    def _settle(self) -> None:
        """Wait for the replies to an earlier program, which was killed, and drop them."""
        end = time.monotonic() + REPLY_TIME
        quiet = time.monotonic() + SILENT_PAUSE
        while time.monotonic() < min(quiet, end):
            self._link.wait(min(quiet, end))
            if self._drain():
                quiet = time.monotonic() + SILENT_PAUSE
        self._slcan.forget()

    def _drain(self) -> bool:
        """Read what has arrived for its replies only; True if there was anything."""
        for count in range(MOST_READS):
            data = self._link.receive()
            if not data:
                return count > 0
            self._slcan.feed(data)
        return True

    def close(self) -> None:
        """Close the channel, unless this is a forked child, and the port."""
        with self._access:
            if self._is_open and self._pid == os.getpid():
                with contextlib.suppress(LinkError):
                    self._link.send((self._slcan.cancel if self._unfinished else b"") + b"C\r")
            self._is_open, self._rate = False, ""
            self._link.close()


def open_slcan(options: CanOptions, lock: PortLock, connect_time: float | None) -> SlcanChannel:
    """Open the port of the adapter, with the channel still closed. Errors as for `open_stream`."""
    port, _, baud = str(options.channel).partition("@")
    rate = int(baud or options.settings.get("tty_baudrate", DEFAULT_BAUD))
    link = open_stream(port, rate=rate, lock=lock, connect_time=connect_time)
    first_reply = FIRST_REPLY + link.latency
    if "://" in port and link.latency > LOOPBACK_LATENCY:
        first_reply = FIRST_REPLY_NETWORK
    if link.paced:  # one line each way on the serial line; adapters with their own USB are faster
        link.latency += 2 * LINE_BITS / rate
    return SlcanChannel(options.name, link, first_reply)


def rate_command(options: CanOptions, rate: int) -> str:
    """The command that sets this rate (bit/s): S0 to S8, or s with the registers of an explicit bit timing."""
    timing = options.settings.get("timing")
    return f"s{timing.btr0:02X}{timing.btr1:02X}" if timing is not None else SLCAN_COMMANDS[rate]
