"""A small RFC 2217 server. It agrees to every option, acknowledges every setting, and keeps what it receives."""

from __future__ import annotations

import contextlib
import socket
from threading import Thread

IAC, SB, SE = 255, 250, 240
WILL, WONT, DO, DONT = 251, 252, 253, 254
ANSWER = {WILL: DO, DO: WILL}
COM_PORT, SET_BAUDRATE, ACKNOWLEDGED = 44, 1, 100


class Server:
    """One client at a time; `rate` is what it has set, `received` what it sent."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"rfc2217://127.0.0.1:{self.listener.getsockname()[1]}"
        self.rate = 0
        self.received = bytearray()
        self.client: socket.socket | None = None
        self.thread = Thread(target=self.serve, daemon=True)
        self.thread.start()

    def serve(self) -> None:
        with contextlib.suppress(OSError):
            self.client, _ = self.listener.accept()
            stream = self.client.makefile("rb", buffering=0)
            while byte := stream.read(1):
                if byte[0] == IAC:
                    self.command(stream.read(1)[0], stream)
                else:
                    self.received += byte

    def say(self, data: bytes) -> None:
        assert self.client is not None
        self.client.sendall(data.replace(b"\xff", b"\xff\xff"))

    def take(self) -> bytes:
        """What the client has sent since the last call."""
        size = len(self.received)
        data = bytes(self.received[:size])
        del self.received[:size]
        return data

    def command(self, code: int, stream: socket.SocketIO) -> None:
        assert self.client is not None
        if code == IAC:
            self.received += b"\xff"
        elif code == SB:
            self.setting(stream)
        elif code in ANSWER:
            self.client.sendall(bytes([IAC, ANSWER[code]]) + stream.read(1))

    def setting(self, stream: socket.SocketIO) -> None:
        assert self.client is not None
        body = bytearray()
        while not body.endswith(bytes([IAC, SE])):
            body += stream.read(1)
        option, setting, value = body[0], body[1], bytes(body[2:-2])
        assert option == COM_PORT
        if setting == SET_BAUDRATE:
            self.rate = int.from_bytes(value, "big")
        answer = bytes([IAC, SB, COM_PORT, setting + ACKNOWLEDGED]) + value + bytes([IAC, SE])
        self.client.sendall(answer)

    def hang_up(self) -> None:
        if self.client is not None:
            with contextlib.suppress(OSError):
                self.client.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self.hang_up()
        with contextlib.suppress(OSError):
            self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        self.thread.join(30)
        if self.client is not None:
            self.client.close()
