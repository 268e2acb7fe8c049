"""slcan adapters: text lines that carry CAN frames over a serial line.

python-can opens the port and reads byte by byte, without a look at the replies: it misses a refused bit rate and stops
at a damaged line. So the dialogue and the lines are handled here. Source: LAWICEL CAN232 manual.
"""

from __future__ import annotations

import contextlib
import os
import re
import socket
import time
from collections.abc import Callable
from functools import partial
from math import inf
from typing import Any, Final
from urllib.parse import urlsplit

from motorbus.core.operation import REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError
from motorbus.link import usb_adapters
from motorbus.link.can_channel import Counts, Port, TextChannel, open_bus
from motorbus.link.can_options import CanOptions
from motorbus.link.stream import CHUNK
from motorbus.link.tcp import LOOPBACK_LATENCY, NETWORK_LATENCY, send_at_once

LONGEST: Final = 512  # bytes kept of a line without end; the longest line has fewer than 60
REPLIES_KEPT: Final = 16  # the dialogue has three; later every frame that is sent has one
STAMP: Final = 4  # hexadecimal digits of the timestamp that an adapter may append
CANCEL: Final = b"?\r"  # ends an unfinished line, which the adapter then refuses

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
LOOPBACK: Final = ("localhost", "127.0.0.1", "::1")

_LINE: Final = re.compile(
    rb"(?:([tr])([0-7][0-9A-Fa-f]{2})|([TRx])([01][0-9A-Fa-f]{7}))([0-8])((?:[0-9A-Fa-f]{2})*)"
)
_CAN_FD: Final = b"dDbB"  # as CANable 2 writes it
_REPLIES: Final = re.compile(rb"(?:[zZAQ]?|[VNF][0-9A-Za-z]{2,8})")
_END: Final = re.compile(rb"[\r\a]")


def encode(frame: CanFrame) -> bytes:
    """The line that sends this frame."""
    remote = frame.id & REMOTE_FLAG
    letter = ("R" if remote else "T") if frame.extended else ("r" if remote else "t")
    digits = "" if remote else frame.data.hex().upper()
    identifier = f"{frame.id & ~REMOTE_FLAG:0{8 if frame.extended else 3}X}"
    return f"{letter}{identifier}{len(frame.data)}{digits}\r".encode()


class SlcanDecoder:
    """Lines of an slcan adapter -> frames, as `Decoder`.

    `replies` are the first replies since `forget`: True for CR, False for BEL. A timestamp is recognised by the length
    of the line. A damaged length digit must not look like one, so a line needs the form of the line before; two lines
    in a row of the other form change it.
    """

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

    def feed(self, data: bytes) -> list[CanFrame]:
        """The frames that these bytes complete. Never raises."""
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
    """An open slcan adapter. `first_reply` is the time-out (s) of its first reply; `shut` closes the port."""

    def __init__(
        self, name: str, port: Port, shut: Callable[[], None], first_reply: float = FIRST_REPLY
    ) -> None:
        self._decoder = SlcanDecoder()
        super().__init__(name, port, self._decoder, encode, CANCEL, self._close_channel)
        self._shut_port = shut
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
        replies = self._decoder.replies
        with self._access:
            self._check()
            self._drain()
            self._decoder.forget()
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
        if self._decoder.replies[self._rate_reply : self._rate_reply + 1] == [False]:
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

    def _read_port(self) -> list[CanFrame]:
        frames = super()._read_port()
        if self._late_until > -inf:
            replied = len(self._decoder.replies) > self._rate_reply
            if replied or time.monotonic() > self._late_until:
                self._check_rate()
                self._late_until = -inf
        return frames

    def write(self, frame: CanFrame) -> None:
        if not self._is_open and not self._closed:
            raise LinkError(
                f"{self.name}: the channel of the adapter is closed", cause=f"it refused {self._rate}"
            )
        super().write(frame)

    def _command(self, command: str, count: int, timeout: float) -> None:
        """Send a command and wait until there are so many replies in all."""
        self._send(f"{command}\r".encode())
        end = time.monotonic() + timeout
        while len(self._decoder.replies) < count and time.monotonic() < end:
            self._wait(end)
            self._drain()

    def _settle(self) -> None:
        """Wait for the replies to an earlier program, which was killed, and drop them."""
        end = time.monotonic() + REPLY_TIME
        quiet = time.monotonic() + SILENT_PAUSE
        while time.monotonic() < min(quiet, end):
            self._wait(min(quiet, end))
            if self._drain():
                quiet = time.monotonic() + SILENT_PAUSE
        self._decoder.forget()

    def _drain(self) -> bool:
        """Read what has arrived for its replies only; True if there was anything."""
        for count in range(MOST_READS):
            try:
                data = self._port.receive(CHUNK)
            except BlockingIOError:
                return count > 0
            if not data:
                raise ConnectionError("the other end hung up")
            self._decoder.feed(data)
        return True

    def _close_channel(self) -> None:
        """Close the channel, unless this is a forked child, and the port."""
        with contextlib.suppress(OSError):
            if self._is_open and self._pid == os.getpid():
                self._port.send((CANCEL if self._unfinished else b"") + b"C\r")
        self._shut_port()


def open_slcan(options: CanOptions, back_end: Any) -> tuple[SlcanChannel, float, tuple[str, ...]]:
    """Open the port with python-can, with the channel still closed; also its latency (s) and warnings.

    Raises what python-can raises.
    """

    class SilentBus(back_end):  # type: ignore[misc]
        """The back end without its own commands to the adapter."""

        def open(self) -> None:
            pass

        def close(self) -> None:
            pass

    settings = {"sleep_after_open": 0, **options.settings, "timeout": 0}
    settings.pop("timing", None)
    bus = open_bus(SilentBus, options.channel, settings)
    connection = getattr(bus.serialPortOrig, "_socket", None)
    if isinstance(connection, socket.socket):
        send_at_once(connection)

    def shut() -> None:
        if isinstance(connection, socket.socket):  # pyserial sleeps 0.3 s when it closes an open socket
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()
            bus.serialPortOrig.is_open = False
        with contextlib.suppress(Exception):  # it may be broken already
            bus.shutdown()

    latency, warnings = port_latency(str(options.channel), settings)
    first_reply = FIRST_REPLY_NETWORK if latency == NETWORK_LATENCY else FIRST_REPLY + latency
    channel = SlcanChannel(options.name, _port(bus), shut, first_reply)
    return channel, latency, warnings


def _port(bus: Any) -> Port:
    """The port of this bus: its descriptor, or the pyserial object where there is none (Windows, RFC 2217)."""
    try:
        descriptor = -1 if os.name == "nt" else int(bus.fileno())
    except NotImplementedError:
        descriptor = -1
    if descriptor < 0:
        return pyserial_port(bus.serialPortOrig)
    os.set_blocking(descriptor, False)
    if os.isatty(descriptor):  # pyserial sets VMIN to 0: no data would look like the end
        import termios

        settings = termios.tcgetattr(descriptor)
        settings[6][termios.VMIN] = 1
        termios.tcsetattr(descriptor, termios.TCSANOW, settings)
    return Port(partial(os.read, descriptor), partial(os.write, descriptor), descriptor)


def pyserial_port(serial: Any) -> Port:
    """A pyserial object without descriptor."""
    serial.timeout = serial.write_timeout = 0

    def receive(size: int) -> bytes:
        data = bytes(serial.read(min(serial.in_waiting, size) or 1))
        if not data:
            raise BlockingIOError
        return data

    def send(data: bytes) -> int:
        written = serial.write(data)
        return len(data) if written is None else int(written)

    return Port(receive, send, None)


def port_latency(channel: str, settings: dict[str, Any]) -> tuple[float, tuple[str, ...]]:
    """Latency of the adapter (s), and warnings.

    A serial line adds the time of one line each way. Adapters with their own USB ignore its rate and are faster.
    """
    if "://" in channel:
        return LOOPBACK_LATENCY if urlsplit(channel).hostname in LOOPBACK else NETWORK_LATENCY, ()
    device, _, baud = channel.partition("@")
    device = os.path.realpath(device)
    latency, warnings = usb_adapters.device_latency(device)
    if not device.startswith(usb_adapters.PSEUDO_TERMINALS):
        latency += 2 * LINE_BITS / int(baud or settings.get("tty_baudrate", DEFAULT_BAUD))
    return latency, warnings


def rate_command(options: CanOptions, back_end: Any, rate: int) -> str:
    """The command that sets this rate: S0 to S8, or s with the registers of an explicit bit timing."""
    timing = options.settings.get("timing")
    return f"s{timing.btr0:02X}{timing.btr1:02X}" if timing is not None else str(back_end._BITRATES[rate])
