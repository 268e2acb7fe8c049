"""CAN links over python-can: slcan on a terminal, a socketcand server, a serial back end, and the virtual bus."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

import can
import pytest

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.errors import LinkError, LinkFull, LinkLost, PortNotFound, RequestError
from motorbus.simulation.pty import PtyMaster
from tests.links.can_peer import LONG_PING, PING, PONG, CanLink, Peer, on_terminal, open_can, some


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


@pytest.fixture(params=[on_terminal, virtual_bus])
def peer(request: pytest.FixtureRequest) -> Iterator[Peer]:
    with request.param() as peer:
        yield peer


@pytest.fixture
def link(peer: Peer) -> Iterator[CanLink]:
    link = open_can(peer, 1_000_000)
    yield link
    link.close()


@pytest.mark.parametrize("frame", [PING, LONG_PING, CanFrame(0, b""), CanFrame(0x1FFFFFF0, bytes(8), True)])
def test_frames_go_and_come(link: CanLink, peer: Peer, frame: CanFrame) -> None:
    link.write(frame)
    assert some(link) == [frame._replace(id=frame.id + 1)]
    assert peer.received == [frame]
    assert link.trouble() == ""


def test_a_link_that_is_closed_during_a_read_is_lost(link: CanLink) -> None:
    def read_on() -> None:
        while True:
            link.read(link.now() + 0.05)

    threading.Timer(0.05, link.close).start()
    with pytest.raises(LinkLost):
        read_on()
    link.close()
    with pytest.raises(LinkLost):
        link.write(PING)


def test_rate_is_changed(link: CanLink, peer: Peer) -> None:
    link.tune(125_000)
    link.write(PING)
    assert (link.rate, some(link)) == (125_000, [PONG])
    assert peer.adapter is None or peer.adapter.bitrate == 125_000


def test_a_link_that_only_listens_sends_nothing() -> None:
    with can.Bus(interface="virtual", channel="quiet") as other:
        link = open_can("can://virtual/quiet", listen_only="yes")
        with pytest.raises(LinkError, match="only listens"):
            link.write(PING)
        other.send(can.Message(arbitration_id=5, is_extended_id=False))
        assert some(link) == [CanFrame(5, b"")]
        link.close()


def test_error_frames_are_received_and_remote_and_fd_frames_dropped() -> None:
    link = open_can("can://virtual/kinds")
    with can.Bus(interface="virtual", channel="kinds") as other:
        other.send(can.Message(arbitration_id=5, is_remote_frame=True, dlc=3, is_extended_id=False))
        other.send(can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8)))
        other.send(can.Message(arbitration_id=7, is_fd=True, data=bytes(12), is_extended_id=True))
        other.send(can.Message(arbitration_id=8, data=b"\1", is_extended_id=True))
        assert some(link, 2) == [CanFrame(0x40 | ERROR_FLAG, bytes(8)), CanFrame(8, b"\1", True)]
    link.close()


@pytest.mark.parametrize(
    ("url", "error", "words"),
    [
        ("can://slcan/dev/no-such-adapter", PortNotFound, "there is no such port"),
        ("can://slcan", RequestError, "does not name an interface and its channel"),
        ("can://socketcand/127.0.0.1", RequestError, "does not name an interface and its channel"),
        ("can:///can0", RequestError, "does not name an interface"),
        ("can://slcam/dev/ttyACM0", RequestError, r"has no interface 'slcam'\n.*can://slcan/dev/ttyACM0"),
        ("can://pcan/PCAN_USBBUS1", LinkError, "driver of pcan is missing"),
        ("can://gs_usb/0", LinkError, r'pip install "python-can\[gs-usb\]"'),
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


def test_d13_a_socketcand_server_and_bus_off() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            far = server.accept()[0]
            far.sendall(b"< hi >")
            for answer in (b"< ok >", b"< ok >", b"< frame 626 1.0 01 >", b"< error 40 1.0 >"):
                received.append(far.recv(100))
                far.sendall(answer)
            far.recv(100)
            far.close()

        received: list[bytes] = []
        thread = threading.Thread(target=serve)
        thread.start()
        link = open_can(f"can://socketcand/127.0.0.1:{server.getsockname()[1]}/can0")
        link.write(PING)
        assert some(link) == [CanFrame(0x626, b"\1")]
        link.write(PING)
        with pytest.raises(LinkLost, match="is off the bus"):
            link.read(link.now() + 30)
        link.close()
        thread.join(30)
    assert received[0] == b"< open can0 >"
    assert b"send 625 8" in received[2]


def test_f2_a_serial_back_end_hands_over_what_is_there(master: PtyMaster) -> None:
    """Its recv(0) waits 0.1 s for its port where no frame is there."""
    link = open_can(f"can://seeedstudio{master.slave_name}")
    assert [warning for warning in link.warnings if "seeedstudio waits up to 100 ms" in warning]
    assert link.latency >= 0.1
    waits = []
    for _ in range(5):
        master.write(bytes.fromhex("AA C1 26 06 01 55"))
        begin = time.monotonic()
        assert some(link) == [CanFrame(0x626, b"\1")]
        waits.append(time.monotonic() - begin)
    assert min(waits) < 0.08
    link.close()


def test_a_full_queue_is_no_loss() -> None:
    link = open_can("can://virtual/full")
    with can.Bus(interface="virtual", channel="full", rx_queue_size=1) as other:
        link.write(PING)
        with pytest.raises(LinkFull, match="takes no more frames"):
            link.write(PING)
        assert other.recv(30) is not None
        link.write(PING)
    link.close()
