"""A local socket that takes orders while a simulator is served: look at it, cut its power, pull a plug.

One line is one order and gets one line back, so that `socat - UNIX-CONNECT:PATH` is all the client it needs. The
socket is for its owner alone (mode 0600).
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import stat
from collections.abc import Callable
from pathlib import Path

from motorbus.core.family import SimulatedNode, Simulator
from motorbus.errors import LinkError, MotorbusError, PortBusy, RequestError

LONGEST_LINE = 4096
MOST_CLIENTS = 16
SCHEMA = "motorbus.simulator/1"
HELP = "status | power-cycle [ID] | unplug ID | plug ID | set-input ID INPUT on|off | help"


class ControlSocket:
    """An open control socket. Nothing waits in here: whoever serves it selects on `descriptors` and calls `attend`.

    Raises PortBusy when another simulator listens there, RequestError when something else is there or the path is
    too long, LinkError when the socket cannot be made.
    """

    def __init__(self, path: str | Path, simulator: Simulator) -> None:
        self.path = Path(path)
        self._simulator = simulator
        self._clients: dict[int, tuple[socket.socket, bytearray]] = {}
        self._listener = _listen(self.path)
        self._made = self.path.stat().st_ino

    def descriptors(self) -> list[int]:
        """What to wait on until it turns readable."""
        return [self._listener.fileno(), *self._clients]

    def attend(self, descriptor: int) -> None:
        """This descriptor has turned readable: take in a client, or carry out its orders. Never raises."""
        if descriptor == self._listener.fileno():
            self._accept()
        elif descriptor in self._clients:
            self._read(descriptor)

    def close(self) -> None:
        """Hang up and take the socket away; calling it again does nothing."""
        for descriptor in list(self._clients):
            self._drop(descriptor)
        if self._listener.fileno() >= 0:
            self._listener.close()
            with contextlib.suppress(OSError):
                if self.path.stat().st_ino == self._made:
                    self.path.unlink()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            client, _ = self._listener.accept()
            if len(self._clients) >= MOST_CLIENTS:
                client.close()
                return
            client.setblocking(False)
            self._clients[client.fileno()] = client, bytearray()

    def _read(self, descriptor: int) -> None:
        client, waiting = self._clients[descriptor]
        try:
            data = client.recv(LONGEST_LINE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        waiting += data
        if not data or (len(waiting) > LONGEST_LINE and b"\n" not in waiting):
            self._drop(descriptor)
            return
        while b"\n" in waiting:
            line, _, rest = bytes(waiting).partition(b"\n")
            waiting[:] = rest
            self._answer(descriptor, client, obey(self._simulator, line.decode(errors="replace")))

    def _answer(self, descriptor: int, client: socket.socket, text: str) -> None:
        answer = text.encode() + b"\n"
        try:
            sent = client.send(answer)
        except OSError:
            sent = 0
        if sent < len(answer):  # it does not read: it need not be served
            self._drop(descriptor)

    def _drop(self, descriptor: int) -> None:
        client = self._clients.pop(descriptor, None)
        if client is not None:
            client[0].close()


def obey(simulator: Simulator, line: str) -> str:
    """Carry out one order; gives its one line of answer: `ok`, JSON, or `error: …`."""
    words = line.split()
    try:
        if not words or words[0] not in _ORDERS:
            raise RequestError(f"{line.strip()!r} is not an order; there are: {HELP}")
        return _ORDERS[words[0]](simulator, words[1:])
    except MotorbusError as error:
        return f"error: {error.summary}"


def _status(simulator: Simulator, words: list[str]) -> str:
    _expect(words, at_most=0, order="status")
    nodes = [simulator.nodes[id].status() for id in sorted(simulator.nodes)]
    return json.dumps({"schema": SCHEMA, "simulated": True, "nodes": nodes})


def _power_cycle(simulator: Simulator, words: list[str]) -> str:
    _expect(words, at_most=1, order="power-cycle [ID]")
    for node in [_node(simulator, words[0])] if words else list(simulator.nodes.values()):
        node.power_cycle()
    return "ok"


def _unplug(simulator: Simulator, words: list[str]) -> str:
    _expect(words, at_least=1, at_most=1, order="unplug ID")
    _node(simulator, words[0]).unplug()
    return "ok"


def _plug(simulator: Simulator, words: list[str]) -> str:
    _expect(words, at_least=1, at_most=1, order="plug ID")
    _node(simulator, words[0]).plug()
    return "ok"


def _set_input(simulator: Simulator, words: list[str]) -> str:
    """Of a node that has inputs, and so the method `set_input(number, active)`."""
    form = "set-input ID INPUT on|off"
    _expect(words, at_least=3, at_most=3, order=form)
    node = _node(simulator, words[0])
    press: Callable[[int, bool], None] | None = getattr(node, "set_input", None)
    if press is None:
        raise RequestError(f"node {words[0]} has no inputs")
    if not words[1].isdecimal() or words[2] not in ("on", "off"):
        raise RequestError(f"the order is: {form}")
    press(int(words[1]), words[2] == "on")
    return "ok"


def _help(simulator: Simulator, words: list[str]) -> str:
    return HELP


_ORDERS: dict[str, Callable[[Simulator, list[str]], str]] = {
    "status": _status,
    "power-cycle": _power_cycle,
    "unplug": _unplug,
    "plug": _plug,
    "set-input": _set_input,
    "help": _help,
}


def _expect(words: list[str], *, at_least: int = 0, at_most: int, order: str) -> None:
    if not at_least <= len(words) <= at_most:
        raise RequestError(f"the order is: {order}")


def _node(simulator: Simulator, text: str) -> SimulatedNode:
    try:
        return simulator.nodes[int(text, 0)]
    except (ValueError, KeyError):
        ids = ", ".join(map(str, sorted(simulator.nodes)))
        raise RequestError(f"there is no node {text}; there are: {ids}") from None


def _listen(path: Path) -> socket.socket:
    if not hasattr(socket, "AF_UNIX"):
        raise LinkError("this system has no local sockets", advice="leave the control socket out")
    _clear(path)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        listener.bind(os.fspath(path))
        path.chmod(0o600)  # before `listen`: until then nobody can connect
        listener.listen(MOST_CLIENTS)
    except OSError as error:
        listener.close()
        kind = RequestError if "too long" in str(error) else LinkError
        raise kind(f"cannot make the control socket {path}: {error}") from error
    listener.setblocking(False)
    return listener


def _clear(path: Path) -> None:
    """Take away what a simulator that died has left; anything else is not ours to remove."""
    try:
        mode = path.lstat().st_mode
    except OSError:
        return
    if not stat.S_ISSOCK(mode):
        raise RequestError(f"{path} is there already and is no socket", advice="choose another path")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as knock:
        try:
            knock.connect(os.fspath(path))
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)
            return
        except OSError as error:
            raise LinkError(f"cannot use {path}: {error}") from error
    raise PortBusy(f"another simulator listens on {path}", advice="choose another path, or end it")
