"""Frames through a narrow port, and through back ends that raise any error."""

from __future__ import annotations

import errno
import socket
from types import SimpleNamespace
from typing import Any

import can
import pytest

from motorbus.core.operation import ERROR_FLAG, CanFrame
from motorbus.errors import LinkError, LinkLost
from motorbus.link.can import BUS_OFF, check_bus_off
from motorbus.link.can_channel import MOST_FRAMES, BusChannel, TextChannel, frame_of, open_bus
from motorbus.link.slcan import SlcanCodec
from tests.links.can_peer import PING, NarrowLink


class Bus:
    """A back end of python-can with given messages, or an error."""

    def __init__(self, *messages: object, error: Exception | None = None) -> None:
        self.messages = list(messages)
        self.error = error
        self.sent: list[Any] = []
        self.ended = 0

    def recv(self, timeout: float) -> object:
        assert timeout >= 0
        if self.error:
            raise self.error
        return self.messages.pop(0) if self.messages else None

    def send(self, message: object, timeout: float) -> None:
        assert timeout == 0
        if self.error:
            raise self.error
        self.sent.append(message)

    def shutdown(self) -> None:
        self.ended += 1
        raise OSError("dead already")


def text_channel(link: NarrowLink) -> TextChannel:
    return TextChannel("adapter", link, SlcanCodec())  # type: ignore[arg-type]


def bus_channel(bus: Bus, descriptor: int | None = None) -> BusChannel:
    return BusChannel("adapter", bus, can.Message, descriptor)


def message(id: int = 5, **more: Any) -> can.Message:
    return can.Message(arbitration_id=id, is_extended_id=False, **more)


def test_a_line_sent_in_part_is_cancelled() -> None:
    port = NarrowLink(room=9)
    channel = text_channel(port)
    for _ in range(2):
        with pytest.raises(LinkError, match="takes no more bytes"):
            channel.write(PING)
    port.room = 100
    channel.write(CanFrame(1, b""))
    assert port.written == b"t62584002?\rt0010\r"


def test_a_line_not_sent_at_all_needs_no_cancel() -> None:
    port = NarrowLink(room=0)
    channel = text_channel(port)
    with pytest.raises(LinkError, match="0 of 22"):
        channel.write(PING)
    port.room = 100
    channel.write(PING)
    assert port.written == SlcanCodec().encode(PING)


def test_frames_of_one_read() -> None:
    link = NarrowLink(room=100)
    channel = text_channel(link)
    link.coming = b"\r" + SlcanCodec().encode(PING) * 2
    assert channel.read(float("inf")) == [PING, PING]
    assert channel.read(0) == []


def test_all_that_has_come_is_taken_at_once() -> None:
    bus = Bus(*[message(id) for id in range(MOST_FRAMES + 5)])
    channel = bus_channel(bus)
    assert len(channel.read(0)) == MOST_FRAMES
    assert len(channel.read(0)) == 5


def test_a_descriptor_is_waited_at() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        bus = Bus(message(1))
        channel = bus_channel(bus, ours.fileno())
        theirs.send(b"!")
        assert channel.fileno() == ours.fileno()
        assert channel.read(float("inf")) == [CanFrame(1, b"")]


@pytest.mark.parametrize(
    "error",
    [
        can.CanOperationError("Transmit buffer full"),
        can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS),
        can.CanTimeoutError("no room"),
        can.CanOperationError("Transmit buffer overflow"),
        OSError(errno.EAGAIN, "again"),
    ],
)
def test_no_room(error: Exception) -> None:
    with pytest.raises(LinkError, match="takes no more frames") as caught:
        bus_channel(Bus(error=error)).write(PING)
    assert not isinstance(caught.value, LinkLost)


@pytest.mark.parametrize(
    "error",
    [
        can.CanOperationError("Failed to transmit: Network is down", errno.ENETDOWN),
        OSError(errno.ENODEV, "No such device"),
        RuntimeError("driver says 17"),
    ],
)
def test_an_adapter_that_is_gone(error: Exception) -> None:
    channel = bus_channel(Bus(error=error))
    for use in (lambda: channel.write(PING), lambda: channel.read(0)):
        with pytest.raises(LinkLost, match="adapter is gone"):
            use()


def test_it_is_closed_quietly_and_once() -> None:
    bus = Bus()
    channel = bus_channel(bus)
    channel.close()
    channel.close()
    assert bus.ended == 1
    with pytest.raises(LinkLost):
        channel.read(0)


def test_dropped_messages() -> None:
    assert frame_of(message(is_fd=True)) is None
    assert frame_of(message(is_rx=False)) is None
    channel = bus_channel(Bus(message(is_fd=True), message(3), message(is_rx=False)))
    assert (channel.read(0), channel.counts.dropped) == ([CanFrame(3, b"")], 2)


def test_a_bus_that_fails_to_open_is_shut_down() -> None:
    ended = []

    class Failing:
        def __init__(self, channel: str, bitrate: int) -> None:
            raise ValueError(f"{channel} {bitrate}")

        def shutdown(self) -> None:
            ended.append(self)
            raise RuntimeError

    with pytest.raises(ValueError, match="can0 20000"):
        open_bus(Failing, "can0", {"bitrate": 20_000})
    assert len(ended) == 1


def test_the_default_channel_of_a_back_end() -> None:
    made = open_bus(SimpleNamespace, None, {"a": 1})
    assert made.a == 1


def test_d13_bus_off_is_a_lost_link_and_no_other_error_is() -> None:
    for bits in (0x88, 0x04, 0x100):
        check_bus_off("can0", [CanFrame(ERROR_FLAG | bits, bytes(8)), PING])
    check_bus_off("can0", [CanFrame(BUS_OFF, bytes(8))])
    with pytest.raises(LinkLost, match="can0 is off the bus"):
        check_bus_off("can0", [PING, CanFrame(ERROR_FLAG | BUS_OFF | 0x04, bytes(8))])
