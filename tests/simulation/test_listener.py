"""A TCP port with one client at a time: what it reads, writes, refuses and survives."""

from __future__ import annotations

import os
import select
import socket
from contextlib import closing

import pytest

from motorbus.errors import LinkError, PortBusy, RequestError
from motorbus.simulation.listener import TcpListener, TcpPort, parse_endpoint


def ready(listener: TcpListener) -> bytes:
    """Wait until it is readable and read."""
    assert select.select([listener], (), (), 10.0)[0]
    return listener.read()


def connect(listener: TcpListener) -> socket.socket:
    connection = socket.create_connection((listener.host, listener.port), timeout=10.0)
    assert ready(listener) == b""
    return connection


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("4000", ("127.0.0.1", 4000)),
        (":4000", ("127.0.0.1", 4000)),
        ("0.0.0.0:4000", ("0.0.0.0", 4000)),
        ("localhost:0", ("localhost", 0)),
        ("[::1]:4000", ("::1", 4000)),
    ],
)
def test_endpoints_without_a_host_are_for_this_machine_only(text: str, endpoint: tuple[str, int]) -> None:
    assert parse_endpoint(text) == endpoint


@pytest.mark.parametrize("text", ["", "host", "host:", "host:port", "host:70000", "host:-1", "host:٤"])
def test_what_is_no_endpoint_is_refused(text: str) -> None:
    with pytest.raises(RequestError, match="not a TCP endpoint"):
        parse_endpoint(text)


def test_bytes_both_ways() -> None:
    with closing(TcpListener()) as listener, closing(connect(listener)) as client:
        client.sendall(b"abc")
        assert ready(listener) == b"abc"
        assert listener.read() == b""
        assert listener.write(b"xyz") == 3
        assert client.recv(10) == b"xyz"
        assert listener.rate() is None


def test_the_url_is_what_a_host_opens() -> None:
    with closing(TcpListener()) as listener:
        assert listener.url == f"socket://127.0.0.1:{listener.port}"


def test_without_a_client_bytes_are_lost() -> None:
    with closing(TcpListener()) as listener:
        assert listener.write(b"xyz") == 0
        assert listener.read() == b""


def test_a_client_that_leaves_makes_room_for_the_next() -> None:
    with closing(TcpListener()) as listener:
        for _ in range(2):
            client = connect(listener)
            client.close()
            assert ready(listener) == b""


def test_a_client_that_breaks_off_makes_room_for_the_next() -> None:
    with closing(TcpListener()) as listener:
        client = connect(listener)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        client.close()  # a reset, no farewell
        assert ready(listener) == b""
        assert listener.write(b"x") == 0
        connect(listener).close()


def test_writing_to_a_client_that_broke_off_is_no_error() -> None:
    with closing(TcpListener()) as listener:
        client = connect(listener)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        client.close()
        assert select.select([listener], (), (), 10.0)[0]
        assert listener.write(b"x") == 0
        assert listener.write(b"x") == 0


def test_a_client_that_does_not_read_loses_bytes() -> None:
    with closing(TcpListener()) as listener, closing(connect(listener)):
        piece = bytes(1 << 20)
        while listener.write(piece) == len(piece):
            pass
        assert listener.write(piece) < len(piece)


def test_a_taken_port_is_busy() -> None:
    with closing(TcpListener()) as listener, pytest.raises(PortBusy):
        TcpListener(port=listener.port)


def test_a_host_that_is_not_ours_is_a_link_error() -> None:
    with pytest.raises(LinkError) as caught:
        TcpListener("192.0.2.1", 0)  # reserved for documentation
    assert not isinstance(caught.value, PortBusy)


def test_closing_twice() -> None:
    listener = TcpListener()
    listener.close()
    listener.close()


def test_a_port_takes_in_several() -> None:
    with closing(TcpPort()) as port:
        assert port.address == f"127.0.0.1:{port.port}"
        assert port.accept() is None
        for _ in range(2):
            with socket.create_connection((port.host, port.port), timeout=10.0) as program:
                assert select.select([port], (), (), 10.0)[0]
                client = port.accept()
                assert client is not None
                with closing(client):
                    assert client.rate() is None
                    assert client.read() == b""
                    assert not client.gone
                    program.sendall(b"abc")
                    assert select.select([client], (), (), 10.0)[0]
                    assert client.read() == b"abc"
                    assert client.write(b"xyz") == 3
                    assert program.recv(3) == b"xyz"


def test_what_is_small_leaves_at_once() -> None:
    with closing(TcpPort()) as port, socket.create_connection((port.host, port.port)):
        assert select.select([port], (), (), 10.0)[0]
        client = port.accept()
        assert client is not None
        with closing(client), socket.socket(fileno=os.dup(client.fileno())) as same:
            assert same.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_pulled_it_refuses_and_is_back_at_the_same_place() -> None:
    with closing(TcpListener()) as port:
        address = port.host, port.port
        with socket.create_connection(address, timeout=10.0) as program:
            while port.write(b"!") == 0:
                assert select.select([port], (), (), 10.0)[0]
                port.read()
            port.unplug()
            assert program.recv(10) == b"!"
            assert program.recv(10) == b""
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(address, timeout=10.0).close()
        port.plug()
        assert (port.host, port.port) == address
        socket.create_connection(address, timeout=10.0).close()
