"""A local socket for orders to a simulator that is served: show devices, cut their supply, push shafts, set faults.

One line is one order and gets one line of JSON: `socat - UNIX-CONNECT:PATH` is a client. Only the owner of the
simulator may open it (mode 0600).
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import stat
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from motorbus.core import units
from motorbus.core.family import SimulatedNode
from motorbus.errors import LinkError, MotorbusError, PortBusy, RequestError
from motorbus.simulation.server import Server

MAX_LINE: Final = 1 << 16
"""Bytes of an order; a longer one ends the connection."""
MAX_FIRED: Final = 20  # latest faults in a reply


def _number(text: str) -> int:
    if not text.isdecimal():
        raise RequestError(f"{text} is not a number")
    return int(text)


def _switch(text: str) -> bool:
    if text not in ("on", "off"):
        raise RequestError(f"{text} is neither on nor off")
    return text == "on"


def _quantity(quantity: str, example: str) -> Callable[[str], float]:
    def parse(text: str) -> float:
        value = units.parse(text, quantity)
        if text[-1] in "0123456789.":
            raise RequestError(f"{text} has no unit", expected=f"a number with its unit, as {example}")
        return value

    return parse


_ANGLE: Final = _quantity("position", "30deg or 0.5rad")


class Word(NamedTuple):
    """An order to a device: its arguments after the id, and the member of the device that carries it out."""

    form: str
    member: str
    arguments: tuple[Callable[[str], Any], ...] = ()


WORDS: Final = {
    "plug": Word("", "plug"),
    "unplug": Word("", "unplug"),
    "power-cycle": Word("", "power_cycle"),
    "block": Word("[LOW HIGH]", "block_shaft", (_ANGLE, _ANGLE)),
    "push": Word("ANGLE", "push_shaft", (_ANGLE,)),
    "load": Word("PERCENT", "load_shaft", (_quantity("load", "50%"),)),
    "release": Word("", "release_shaft"),
    "supply": Word("VOLTS", "voltage", (partial(units.parse, quantity="voltage"),)),
    "heat": Word("DEGREES", "temperature", (partial(units.parse, quantity="temperature"),)),
    "set-input": Word("INPUT on|off", "set_input", (_number, _switch)),
}
HELP: Final = " | ".join(
    [
        "status",
        *(f"{name} ID {word.form}".strip() for name, word in WORDS.items()),
        "power-cycle",
        "faults [SCRIPT|off]",
        "help",
    ]
)


def carry_out(server: Server, line: str) -> dict[str, Any]:
    """Carry out one order; return the reply: its data, or `error` and `expected`."""
    name, _, rest = line.strip().partition(" ")
    words = rest.split()
    try:
        if name == "status" and not words:
            nodes = server.simulator.nodes
            return {"ok": True, "nodes": [nodes[id].status() for id in sorted(nodes)]}
        if name == "help":
            return {"ok": True, "help": HELP}
        if name == "faults":
            return _faults(server, rest.strip())
        if name == "power-cycle" and not words:
            for node in list(server.simulator.nodes.values()):
                node.power_cycle()
        elif name in WORDS:
            _order(server, name, words)
        else:
            raise RequestError(f"{line.strip()[:80]!r} is not an order", expected=HELP)
    except MotorbusError as error:
        return {"error": error.summary, "expected": error.expected}
    return {"ok": True}


def _faults(server: Server, script: str) -> dict[str, Any]:
    if script:
        server.set_faults("" if script == "off" else script)
    faults = server.faults
    return {
        "ok": True,
        "faults": str(faults.script),
        "count": faults.count,
        "fired": [str(fired.fault) for fired in faults.fired][-MAX_FIRED:],
        "pending": [str(fault) for fault in faults.pending],
    }


def _order(server: Server, name: str, words: list[str]) -> None:
    word = WORDS[name]
    required = 0 if word.form.startswith("[") else len(word.arguments)
    if len(words) - 1 not in (required, len(word.arguments)):
        raise RequestError(f"{name}: wrong arguments", expected=f"{name} ID {word.form}".strip())
    node = _node(server, words[0])
    if not hasattr(node, word.member):
        raise RequestError(f"device {words[0]} does not simulate `{name}`")
    values = [parse(text) for parse, text in zip(word.arguments, words[1:], strict=False)]
    if name in ("supply", "heat"):
        setattr(node, word.member, values[0])
    elif name == "block":
        node.block_shaft(tuple(values) or None)  # type: ignore[attr-defined]
    else:
        getattr(node, word.member)(*values)


def _node(server: Server, text: str) -> SimulatedNode:
    nodes = server.simulator.nodes
    try:
        return nodes[units.whole(text)]
    except (ValueError, KeyError):
        known = ", ".join(map(str, sorted(nodes)))
        raise RequestError(f"there is no device {text}", expected=f"one of {known}") from None


class ControlSocket:
    """An open control socket of a server, which calls it when there is something to do.

    Raises PortBusy when another simulator listens at `path`, RequestError when something else is there or the path is
    too long, LinkError when the socket cannot be made.
    """

    def __init__(self, path: str | Path, server: Server) -> None:
        self.path = Path(path)
        self._server = server
        self._clients: dict[socket.socket, bytes] = {}  # bytes of an order that is not complete
        self._listener = _listen(self.path)
        self._inode = self.path.stat().st_ino
        server.watch(self._listener.fileno(), self._accept)

    def close(self) -> None:
        """Close all connections and remove the socket; a second call does nothing."""
        for client in tuple(self._clients):
            self._drop(client)
        if self._listener.fileno() >= 0:
            self._server.unwatch(self._listener.fileno())
            self._listener.close()
            with contextlib.suppress(OSError):
                if self.path.stat().st_ino == self._inode:
                    self.path.unlink()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            client, _ = self._listener.accept()
            client.setblocking(False)
            self._clients[client] = b""
            self._server.watch(client.fileno(), partial(self._receive, client))

    def _receive(self, client: socket.socket) -> None:
        """Carry out the orders that have arrived. A client that does not read its replies is dropped."""
        try:
            data = client.recv(MAX_LINE)
            *lines, rest = (self._clients[client] + data).split(b"\n")
            for line in lines:
                reply = json.dumps(carry_out(self._server, line.decode(errors="replace"))).encode() + b"\n"
                if client.send(reply) < len(reply):
                    raise BlockingIOError
        except OSError:
            data = rest = b""
        self._clients[client] = rest
        if not data or len(rest) > MAX_LINE:
            self._drop(client)

    def _drop(self, client: socket.socket) -> None:
        del self._clients[client]
        self._server.unwatch(client.fileno())
        client.close()


def _listen(path: Path) -> socket.socket:
    if not hasattr(socket, "AF_UNIX"):
        raise LinkError("this system has no local sockets", advice="leave the control socket out")
    _remove_left_over(path)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        listener.bind(os.fspath(path))
        path.chmod(0o600)  # before `listen`, so before a client can connect
        listener.listen()
    except OSError as error:
        listener.close()
        kind = RequestError if "too long" in str(error) else LinkError
        raise kind(f"cannot make the control socket {path}: {error}") from error
    listener.setblocking(False)
    return listener


def _remove_left_over(path: Path) -> None:
    """Remove the socket of a simulator that died; refuse anything else."""
    try:
        mode = path.lstat().st_mode
    except OSError:
        return
    if not stat.S_ISSOCK(mode):
        raise RequestError(f"{path} is there already and is no socket", advice="choose another path")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as trial:
        try:
            trial.connect(os.fspath(path))
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)
            return
        except OSError as error:
            raise LinkError(f"cannot use {path}: {error}") from error
    raise PortBusy(f"another simulator listens on {path}", advice="choose another path, or end it")
