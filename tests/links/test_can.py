"""CAN through python-can's own back ends: the same link over a terminal, TCP, a socketcand server and in process."""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

import can
import pytest

from motorbus.core.operation import ERROR_FLAG, CanFrame
from motorbus.errors import LinkError, LinkLost, PortBusy, PortNotFound, RequestError
from motorbus.link.can import CanLink, open_error
from motorbus.link.can_options import CanOptions, read_options
from tests.links.can_peer import (
    LONG_PING,
    PING,
    PONG,
    Peer,
    on_terminal,
    open_can,
    remote,
    slcan_server,
    socketcand_server,
    some,
)


@contextlib.contextmanager
def virtual_bus() -> Iterator[Peer]:
    """python-can's bus in this process, with another member that answers."""
    with can.Bus(interface="virtual", channel="test") as other:
        peer = Peer(None, "can://virtual/test")  # type: ignore[arg-type]

        def answer(message: can.Message) -> None:
            peer.received.append(
                CanFrame(message.arbitration_id, bytes(message.data), message.is_extended_id)
            )
            message.arbitration_id += 1
            message.is_rx = True
            other.send(message)

        notifier = can.Notifier(other, [answer], timeout=0.02)
        try:
            yield peer
        finally:
            notifier.stop()


TRANSPORTS: dict[str, Callable[[], AbstractContextManager[Peer]]] = {
    "slcan on a terminal": on_terminal,
    "slcan on TCP": slcan_server,
    "socketcand": socketcand_server,
    "virtual": virtual_bus,
}


@pytest.fixture(params=list(TRANSPORTS))
def peer(request: pytest.FixtureRequest) -> Iterator[Peer]:
    with TRANSPORTS[request.param]() as peer:
        yield peer


@pytest.fixture
def link(peer: Peer) -> Iterator[CanLink]:
    link = open_can(peer)
    yield link
    link.close()


@pytest.mark.parametrize("frame", [PING, LONG_PING, CanFrame(0, b""), CanFrame(0x1FFFFFF0, bytes(8), True)])
def test_frames_go_and_come(link: CanLink, peer: Peer, frame: CanFrame) -> None:
    link.write(frame)
    assert some(link) == [frame._replace(id=frame.id + 1)]
    assert peer.received == [frame]
    assert (link.counts.damaged, link.counts.dropped, link.counts.refused) == (0, 0, 0)


def test_many_frames_arrive_in_order(link: CanLink) -> None:
    sent = [CanFrame(0x100 + number, bytes([number])) for number in range(60)]
    for frame in sent:
        link.write(frame)
    assert some(link, 60) == [frame._replace(id=frame.id + 1) for frame in sent]
    assert link.read(link.now() - 1) == []


def test_its_attributes(link: CanLink, peer: Peer) -> None:
    assert (link.name, link.rate) == (peer.url, 500_000)
    assert (link.paced, link.virtual, link.simulated, link.warnings) == (False, False, False, ())
    assert 0 < link.latency < 0.01


def test_nothing_comes(link: CanLink) -> None:
    begun = link.now()
    assert link.read(begun + 0.05) == []
    assert link.now() >= begun + 0.05
    assert link.read(float("-inf")) == []


def test_bytes_are_refused(link: CanLink) -> None:
    with pytest.raises(RequestError, match="CAN frames, not bytes"):
        link.write(b"\xff\xff")


def test_a_closed_link_is_lost(link: CanLink) -> None:
    link.close()
    link.close()
    with pytest.raises(LinkLost):
        link.read(link.now())
    with pytest.raises(LinkLost):
        link.write(PING)


def test_it_can_be_opened_again_and_again(peer: Peer) -> None:
    for _ in range(3):
        link = open_can(peer)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()


def test_close_during_a_read(link: CanLink) -> None:
    ended: list[BaseException | None] = []

    def wait() -> None:
        try:
            while True:
                link.read(link.now() + 0.05)
        except LinkLost as error:
            ended.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    link.write(PING)
    link.close()
    thread.join(30)
    assert len(ended) == 1


@pytest.mark.parametrize("transport", ["slcan on a terminal", "slcan on TCP", "socketcand"])
def test_one_owner_at_a_time(transport: str) -> None:
    with TRANSPORTS[transport]() as peer:
        link = open_can(peer)
        with pytest.raises(PortBusy, match="this very program") as caught:
            open_can(peer)
        assert caught.value.owner == os.getpid()
        link.close()
        open_can(peer).close()


def test_the_virtual_bus_has_many_members() -> None:
    one, other = open_can("can://virtual/many"), open_can("can://virtual/many")
    one.write(PING)
    assert some(other) == [PING]
    assert one.read(one.now()) == []
    one.close()
    other.close()


@pytest.mark.parametrize("transport", ["slcan on a terminal", "slcan on TCP", "virtual"])
def test_the_rate_is_changed(transport: str) -> None:
    with TRANSPORTS[transport]() as peer:
        link = open_can(peer, 1_000_000)
        assert link.rate == 1_000_000
        link.tune(125_000)
        link.write(PING)
        assert (link.rate, some(link)) == (125_000, [PONG])
        if transport != "virtual":
            assert peer.adapter.bitrate == 125_000
        link.tune(0, listen_only=True)
        assert (link.rate, link.listen_only) == (125_000, True)
        with pytest.raises(LinkError, match="only listens"):
            link.write(PING)
        link.tune(125_000)
        link.write(PING)
        assert some(link) == [PONG]
        link.close()


@pytest.mark.usefixtures("long_timeouts")
@pytest.mark.parametrize("transport", ["slcan on a terminal", "virtual"])
def test_it_is_opened_to_listen_only(transport: str) -> None:
    with TRANSPORTS[transport]() as peer:
        link = open_can(peer, listen_only="yes")
        if transport != "virtual":
            assert peer.adapter.listen_only
        with pytest.raises(LinkError, match="only listens"):
            link.write(PING)
        link.close()
        assert peer.received == []


def test_remote_error_and_fd_frames() -> None:
    """CAN FD and our own frames are dropped and counted."""
    link = open_can("can://virtual/kinds")
    with can.Bus(interface="virtual", channel="kinds") as other:
        other.send(can.Message(arbitration_id=5, is_remote_frame=True, dlc=3, is_extended_id=False))
        other.send(can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8)))
        other.send(can.Message(arbitration_id=7, is_fd=True, data=bytes(12), is_extended_id=True))
        other.send(can.Message(arbitration_id=8, data=b"\1", is_extended_id=True))
        assert some(link, 3) == [
            remote(5, 3),
            CanFrame(0x40 | ERROR_FLAG, bytes(8)),
            CanFrame(8, b"\1", True),
        ]
        link.write(remote(9, 2, extended=True))
        received = other.recv(30)
        assert received is not None
        assert (received.is_remote_frame, received.dlc, received.arbitration_id, received.is_extended_id) == (
            True,
            2,
            9,
            True,
        )
    assert link.counts.dropped == 1
    link.close()


def test_our_own_frames_are_dropped() -> None:
    link = open_can("can://virtual/mine", receive_own_messages="yes")
    link.write(PING)
    assert link.read(link.now() + 0.02) == []
    assert link.counts.dropped == 1
    link.close()


def test_a_full_member() -> None:
    link = open_can("can://virtual/slow")
    with can.Bus(interface="virtual", channel="slow", rx_queue_size=2):
        link.write(PING)
        link.write(PING)
        with pytest.raises(LinkError, match="takes no more frames") as caught:
            link.write(PING)
        assert not isinstance(caught.value, LinkLost)
    link.close()


@pytest.mark.parametrize(
    ("url", "error", "words"),
    [
        ("can://slcan/dev/no-such-adapter", PortNotFound, "there is no such port"),
        ("can://slcan/socket://127.0.0.1:1", PortNotFound, "cannot be reached"),
        ("can://slcan/dev/null", PortNotFound, "/dev/null is not a serial port"),
        ("can://socketcand/127.0.0.1:1/can0", PortNotFound, "cannot be reached"),
        ("can://socketcand/127.0.0.1:x/can0", RequestError, "HOST:PORT/CHANNEL"),
        ("can://socketcand/127.0.0.1", RequestError, "HOST:PORT/CHANNEL"),
        ("can://pcan/PCAN_USBBUS1", LinkError, "driver of pcan is missing"),
        ("can://kvaser/0", LinkError, "driver of kvaser is missing"),
        ("can://gs_usb/0", LinkError, r'pip install "python-can\[gs-usb\]"'),
        ("can://slcam/dev/ttyACM0", RequestError, "did you mean slcan"),
        ("can:///can0", RequestError, "the interface is missing"),
        ("can://", RequestError, "says no interface"),
    ],
)
def test_channels_that_cannot_be_opened(url: str, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words) as caught:
        open_can(url)
    assert caught.type is error
    with pytest.raises(error):
        open_can(url)  # and not because it is held


def test_a_missing_python_can_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "can", None)
    with pytest.raises(LinkError, match=r'pip install "motorbus\[can\]"'):
        open_can("can://virtual/test")


# -- errors of python-can at open ------------------------------------------------------------------------------


def config(port: str) -> CanOptions:
    return read_options(can, port, 0, {})


@pytest.mark.parametrize(
    ("port", "error", "kind", "words"),
    [
        (
            "can://socketcan/can0",
            OSError(errno.ENODEV, "No such device"),
            PortNotFound,
            "no socketcan channel can0",
        ),
        ("can://socketcan/can0", OSError(errno.EAFNOSUPPORT, "x"), LinkError, "has no CAN"),
        ("can://vector/0", OSError(errno.EBUSY, "x"), PortBusy, "held by another program"),
        ("can://pcan/1", OSError("pcanbasic library not found."), LinkError, "PCAN-Basic"),
        ("can://kvaser/0", NameError("name 'canOpenChannel' is not defined"), LinkError, "CANlib"),
        ("can://neovi/0", ImportError("Please install python-ics"), LinkError, r"python-can\[neovi\]"),
        (
            "can://systec/0",
            can.CanInterfaceNotImplementedError("no"),
            LinkError,
            "that comes with the adapter",
        ),
        ("can://kvaser/0", ValueError("channel must be an integer"), RequestError, "refuses this"),
        ("can://pcan/1", can.CanInitializationError("in use"), LinkError, "cannot be opened: in use"),
    ],
)
def test_the_error_for_each_failure(port: str, error: Exception, kind: type[Exception], words: str) -> None:
    text = open_error(config(port), error)
    assert type(text) is kind
    with pytest.raises(kind, match=words):
        raise text


def test_the_device_of_an_adapter() -> None:
    assert config("can://slcan/dev/ttyACM0@1000000").device == "/dev/ttyACM0"
    assert config("can://slcan/socket://127.0.0.1:4000").device == ""
    assert config("can://socketcan/can0").device == ""
