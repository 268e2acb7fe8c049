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
from motorbus.link.can_channel import MOST_FRAMES, BusChannel, Port, TextChannel, frame_of, open_bus
from motorbus.link.slcan import SlcanDecoder, encode
from tests.links.can_peer import PING


class Narrow:
    """A port with room for so many bytes."""

    def __init__(self, room: int) -> None:
        self.room = room
        self.written = b""
        self.coming = b""

    def receive(self, size: int) -> bytes:
        data, self.coming = self.coming, b""
        if not data:
            raise BlockingIOError
        return data

    def send(self, data: bytes) -> int:
        count = min(self.room, len(data))
        self.room -= count
        self.written += data[:count]
        return count


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


def text_wire(port: Narrow) -> TextChannel:
    return TextChannel(
        "adapter", Port(port.receive, port.send, None), SlcanDecoder(), encode, b"?\r", lambda: None
    )


def bus_wire(bus: Bus, descriptor: int | None = None) -> BusChannel:
    return BusChannel("adapter", bus, can.Message, descriptor)


def message(id: int = 5, **more: Any) -> can.Message:
    return can.Message(arbitration_id=id, is_extended_id=False, **more)


def test_a_line_sent_in_part_is_cancelled() -> None:
    port = Narrow(room=9)
    wire = text_wire(port)
    for _ in range(2):
        with pytest.raises(LinkError, match="takes no more bytes"):
            wire.write(PING)
    port.room = 100
    wire.write(CanFrame(1, b""))
    assert port.written == b"t62584002?\rt0010\r"


def test_a_line_not_sent_at_all_needs_no_cancel() -> None:
    port = Narrow(room=0)
    wire = text_wire(port)
    with pytest.raises(LinkError, match="0 of 22"):
        wire.write(PING)
    port.room = 100
    wire.write(PING)
    assert port.written == encode(PING)


def test_a_port_without_descriptor_is_looked_at_again_and_again() -> None:
    port = Narrow(room=100)
    wire = text_wire(port)
    assert wire.fileno() is None
    port.coming = b"\r" + encode(PING)
    assert wire.read(float("inf")) == [PING]
    assert wire.read(0) == []
    wire.close()
    with pytest.raises(LinkLost, match="it is closed"):
        wire.read(0)


def test_all_that_has_come_is_taken_at_once() -> None:
    bus = Bus(*[message(id) for id in range(MOST_FRAMES + 5)])
    wire = bus_wire(bus)
    assert len(wire.read(0)) == MOST_FRAMES
    assert len(wire.read(0)) == 5


def test_a_descriptor_is_waited_at() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        bus = Bus(message(1))
        wire = bus_wire(bus, ours.fileno())
        theirs.send(b"!")
        assert wire.fileno() == ours.fileno()
        assert wire.read(float("inf")) == [CanFrame(1, b"")]


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
        bus_wire(Bus(error=error)).write(PING)
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
    wire = bus_wire(Bus(error=error))
    for use in (lambda: wire.write(PING), lambda: wire.read(0)):
        with pytest.raises(LinkLost, match="adapter is gone"):
            use()


def test_it_is_closed_quietly_and_once() -> None:
    bus = Bus()
    wire = bus_wire(bus)
    wire.close()
    wire.close()
    assert bus.ended == 1
    with pytest.raises(LinkLost):
        wire.read(0)


def test_dropped_messages() -> None:
    assert frame_of(message(is_fd=True)) is None
    assert frame_of(message(is_rx=False)) is None
    wire = bus_wire(Bus(message(is_fd=True), message(3), message(is_rx=False)))
    assert (wire.read(0), wire.counts.dropped) == ([CanFrame(3, b"")], 2)


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
