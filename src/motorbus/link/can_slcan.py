"""An slcan adapter: told its bit rate in a dialogue in which it may say no, then read and written as text.

python-can writes the same commands without looking at the answers, so a rate that an adapter refuses would go
unnoticed. Some adapters answer nothing at all; that must not hold anybody up. Source: LAWICEL CAN232 manual.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Callable
from math import inf
from typing import Any, Final
from urllib.parse import urlsplit

from motorbus.core.operation import CanFrame
from motorbus.errors import LinkError
from motorbus.link import adapters
from motorbus.link.can_config import CanConfig
from motorbus.link.can_port import Descriptor, Port, SerialObject
from motorbus.link.can_text import SlcanReader, slcan_line
from motorbus.link.can_wire import TextWire, build, quietly
from motorbus.link.identity import PSEUDO_TERMINALS
from motorbus.link.tcp import LOOPBACK_LATENCY, NETWORK_LATENCY, give_up_soon

LISTENING: Final = 0.015
"""s in which an adapter that answers at all has begun to."""
FAR: Final = 0.1
"""The same behind a network."""
PATIENCE: Final = 0.5
"""s that one which answers may take for the rest."""
MUTE: Final = 0.003
"""s between commands to one that does not; and of silence, after which nothing is under way any more."""
LATE: Final = 1.0
"""s in which one that seemed mute may still say that it refuses the bit rate."""
MOST: Final = 64
"""Reads in a row of what is dropped; whoever talks without end must not hold anybody up."""

LINE_BITS: Final = 220
"""Bits of a line that carries an 11-bit frame of 8 bytes, on a serial line."""
USUAL_BAUD: Final = 115_200
LOOPBACK: Final = ("localhost", "127.0.0.1", "::1")
MEND: Final = b"?\r"
"""Ends a line that went out in part, so that it is refused."""


class SlcanWire(TextWire):
    """An open slcan adapter. `listening` is how long (s) the first answer is waited for; `shut` closes the port."""

    def __init__(
        self, name: str, port: Port, shut: Callable[[], None], *, listening: float | None = None
    ) -> None:
        self._lines = SlcanReader()
        self._listening = LISTENING if listening is None else listening
        super().__init__(name, port, self._lines, slcan_line, MEND, self._end(shut))
        self._is_open = False
        self._pid = os.getpid()
        self._told = ""
        self._place = 0
        self._late_until = -inf

    def configure(self, command: str, rate: int, *, listen_only: bool) -> None:
        """Close the channel, set the rate (bit/s) by this command, open it. Raises LinkError when that is refused.

        What comes meanwhile is dropped: it may have been heard at another rate. After an error the channel is closed.
        """
        with self._turn:
            self._check()
            self._drain()
            self._lines.forget()
            self._is_open, self._late_until = False, -inf
            talks = bool(self._ask("C", 1))  # whether it was open is all the same
            if talks:
                self._settle()
            self._told = f"{rate} bit/s ({command})"
            self._place = 0 if talks else 1  # the answer to C may still come
            self._ask(command, self._place + 1, talks=talks)
            self._check_rate()
            self._is_open = True  # from here on it has to be closed, whatever comes of this
            answers = self._ask("L" if listen_only else "O", self._place + 2, talks=talks)
            self._check_rate()
            if answers[self._place + 1 :] == [False]:
                what = "cannot only listen" if listen_only else "refuses to open its channel"
                raise self._refusal(f"the adapter {what}")
            if len(answers) <= self._place:
                self._late_until = time.monotonic() + LATE
            self._lines.refused = 0  # that it was not open before is no refusal to tell of

    def _check_rate(self) -> None:
        """It has not said no to its bit rate. Else it is closed, for it would go on at another."""
        if self._lines.answers[self._place : self._place + 1] == [False]:
            if self._is_open:
                self._is_open, self._late_until = False, -inf
                self._put(b"C\r")
            raise self._refusal(f"the adapter refuses {self._told}")

    def _arrived(self, until: float) -> list[CanFrame]:
        frames = super()._arrived(until)
        heard = len(self._lines.answers) > self._place
        if self._late_until > -inf and (heard or time.monotonic() > self._late_until):
            self._check_rate()
            self._late_until = -inf
        return frames

    def write(self, frame: CanFrame) -> None:
        if not self._is_open and not self._closed:
            raise LinkError(
                f"{self.name}: the channel of the adapter is closed", cause=f"it refused {self._told}"
            )
        super().write(frame)

    def _refusal(self, what: str) -> LinkError:
        return LinkError(
            f"{self.name}: {what}",
            received="BEL (07)",
            expected="CR (0D)",
            advice="choose what the adapter can do; its manual lists the commands of slcan it knows",
        )

    def _ask(self, command: str, due: int, *, talks: bool | None = None) -> list[bool]:
        """Send a command and wait until so many have been answered, or too long; all answers so far."""
        self._put(f"{command}\r".encode())
        patience = self._listening if talks is None else PATIENCE if talks else MUTE
        end = time.monotonic() + patience
        while len(self._lines.answers) < due and (left := end - time.monotonic()) > 0:
            self._wait(left)
            self._drain()
        return list(self._lines.answers)

    def _settle(self) -> None:
        """Let the answers come that are under way to a program before us, which was killed, and forget them."""
        end = time.monotonic() + PATIENCE
        quiet = time.monotonic() + MUTE
        while (left := min(quiet, end) - time.monotonic()) > 0:
            self._wait(left)
            if self._drain():
                quiet = time.monotonic() + MUTE
        self._lines.forget()

    def _drain(self) -> bool:
        """Read what has come, for its answers alone. Was there anything?"""
        for count in range(MOST):
            data = self._port.read()
            if not data:
                return count > 0
            self._lines.feed(data)
        return True

    def _end(self, shut: Callable[[], None]) -> Callable[[], None]:
        def end() -> None:
            """A line that went out in part must not swallow the last command, nor become a frame by it.

            A fork that closes what it has inherited leaves the channel to its parent.
            """
            with contextlib.suppress(OSError):  # gone already
                if self._is_open and self._pid == os.getpid():
                    self._port.write((MEND if self._torn else b"") + b"C\r")
            shut()

        return end


def open_slcan(config: CanConfig, back_end: Any) -> tuple[SlcanWire, float, tuple[str, ...]]:
    """Open the adapter's port by python-can; its channel is still closed. Also its latency (s), and warnings.

    Raises what python-can raises.
    """

    class Unspoken(back_end):  # type: ignore[misc]
        """python-can's, which leaves it to us what to say to the adapter."""

        def open(self) -> None:
            pass

        def close(self) -> None:
            pass

    settings = {"sleep_after_open": 0, **config.settings, "timeout": 0}
    settings.pop("timing", None)
    bus = build(Unspoken, config.channel, settings)
    connection = getattr(bus.serialPortOrig, "_socket", None)
    if isinstance(connection, socket.socket):
        give_up_soon(connection)
    latency, warnings, listening = timing(str(config.channel), settings)
    port = (
        Descriptor(bus.fileno())
        if os.name != "nt" and has_descriptor(bus)
        else SerialObject(bus.serialPortOrig)
    )
    wire = SlcanWire(config.name, port, lambda: _shut(bus), listening=listening)
    return wire, latency, warnings


def _shut(bus: Any) -> None:
    """pyserial sleeps for 0.3 s when it closes a socket, unless that is closed already."""
    connection = getattr(bus.serialPortOrig, "_socket", None)
    if isinstance(connection, socket.socket):
        with contextlib.suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)
        connection.close()
        bus.serialPortOrig.is_open = False
    quietly(bus.shutdown)


def has_descriptor(bus: Any) -> bool:
    """pyserial has one for a terminal and a socket, and none for an RFC 2217 server."""
    try:
        return int(bus.fileno()) >= 0
    except NotImplementedError:
        return False


def timing(channel: str, settings: dict[str, Any]) -> tuple[float, tuple[str, ...], float]:
    """How long the adapter holds a frame back (s), what to warn of, and how long to wait for a first answer (s).

    A line of 22 characters each way at the rate of the serial line comes on top for a real one; adapters with their
    own USB ignore that rate, and are quicker than that.
    """
    if "://" in channel:
        loopback = urlsplit(channel).hostname in LOOPBACK
        return (LOOPBACK_LATENCY, (), LISTENING) if loopback else (NETWORK_LATENCY, (), FAR)
    device, _, baud = channel.partition("@")
    device = os.path.realpath(device)
    if device.startswith(PSEUDO_TERMINALS):
        return adapters.TERMINAL_LATENCY, (), LISTENING
    lines = 2 * LINE_BITS / int(baud or settings.get("tty_baudrate", USUAL_BAUD))
    timer = adapters.latency_timer(device)
    if timer is None:
        return adapters.DEVICE_LATENCY + lines, (), LISTENING
    warnings = (adapters.latency_warning(device, timer),) if timer > adapters.FAST_TIMER else ()
    return timer / 1000 + adapters.USB_TIME + lines, warnings, LISTENING + timer / 1000


def command_of(config: CanConfig, back_end: Any, rate: int) -> str:
    """What tells an adapter this rate: one of S0 to S8, or the bit timing that was asked for."""
    bits = config.settings.get("timing")
    return f"s{bits.btr0:02X}{bits.btr1:02X}" if bits is not None else str(back_end._BITRATES[rate])
