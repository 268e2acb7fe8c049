"""A local socket that takes orders while a simulator is served: look at it, cut its power, pull a plug, do it harm.

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
from functools import partial
from pathlib import Path
from typing import Any

from motorbus.core import units
from motorbus.core.family import SimulatedNode, Simulator
from motorbus.errors import LinkError, MotorbusError, PortBusy, RequestError
from motorbus.simulation.faulted import Faulted, read_order
from motorbus.simulation.told import told

LONGEST_LINE = 1 << 16
"""Bytes of an order; a long script is the longest."""
TOO_LONG = f"error: an order has at most {LONGEST_LINE} bytes; nothing has changed\n".encode()
MOST_CLIENTS = 16
SCHEMA = "motorbus.simulator/1"
HELP = (
    "status | power-cycle [ID] | unplug ID | plug ID | set-input ID INPUT on|off"
    " | block ID [LOW HIGH] | push ID ANGLE | load ID PERCENT | release ID"
    " | supply ID VOLTS | heat ID DEGREES | faults [SCRIPT|off] | help"
)


class _Client:
    """Who gives orders: what of them is still to be carried out, and what of the answers has had no room yet."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.orders = bytearray()
        self.answers = bytearray()
        self.skips = False  # it is in the midst of an order that is too long
        self.ends = False  # hung up on as soon as it has its answers


class ControlSocket:
    """An open control socket. Nothing waits in here: whoever serves it selects on `descriptors`, and until there is
    room on `stuck`, and calls `attend`.

    Who does not read his answers is not listened to until he does, so that what is kept for him has bounds.

    `faults` is what the order `faults` changes and shows; None: there are none to be had.

    Raises PortBusy when another simulator listens there, RequestError when something else is there or the path is
    too long, LinkError when the socket cannot be made.
    """

    def __init__(self, path: str | Path, simulator: Simulator) -> None:
        self.path = Path(path)
        self.faults: Faulted | None = None
        self._simulator = simulator
        self._clients: dict[int, _Client] = {}
        self._listener = _listen(self.path)
        self._made = self.path.stat().st_ino

    def descriptors(self) -> list[int]:
        """What to wait on until it turns readable."""
        return [
            self._listener.fileno(),
            *(one for one, client in self._clients.items() if not client.answers),
        ]

    def stuck(self) -> list[int]:
        """What to wait on until it can be written to: of these an answer has had no room yet."""
        return [one for one, client in self._clients.items() if client.answers]

    def attend(self, descriptor: int) -> None:
        """This descriptor is ready: take in a client, carry out its orders, or go on with an answer. Never raises."""
        if descriptor == self._listener.fileno():
            self._accept()
        elif (client := self._clients.get(descriptor)) is not None:
            if not client.answers:
                self._read(client)
            if not self._answered(client):
                del self._clients[descriptor]
                client.connection.close()

    def close(self) -> None:
        """Hang up and take the socket away; calling it again does nothing."""
        for client in self._clients.values():
            client.connection.close()
        self._clients.clear()
        if self._listener.fileno() >= 0:
            self._listener.close()
            with contextlib.suppress(OSError):
                if self.path.stat().st_ino == self._made:
                    self.path.unlink()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            connection, _ = self._listener.accept()
            if len(self._clients) >= MOST_CLIENTS:
                connection.close()
                return
            connection.setblocking(False)
            self._clients[connection.fileno()] = _Client(connection)

    def _read(self, client: _Client) -> None:
        """Take in what it has said."""
        try:
            data = client.connection.recv(LONGEST_LINE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        client.ends = not data
        if client.skips:
            _, end, data = data.partition(b"\n")
            client.skips = not end
        client.orders += data
        if len(client.orders) > LONGEST_LINE and b"\n" not in client.orders:
            client.orders.clear()
            client.skips = True
            client.answers += TOO_LONG

    def _answered(self, client: _Client) -> bool:
        """Send as much as there is room for, and carry out its orders until there is none; False: it is to go."""
        while self._sent(client):
            if client.answers:
                return True
            end = client.orders.find(b"\n")
            if end < 0:
                return not client.ends
            line = client.orders[:end].decode(errors="replace")
            del client.orders[: end + 1]
            if end > LONGEST_LINE:
                client.answers += TOO_LONG
                continue
            text = obey(self._simulator, line, self.faults)
            client.answers += text.encode() + b"\n"
        return False

    @staticmethod
    def _sent(client: _Client) -> bool:
        """Send of its answers what has room; False when it has left."""
        try:
            while client.answers:
                del client.answers[: client.connection.send(client.answers)]
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True


def obey(simulator: Simulator, line: str, faults: Faulted | None = None) -> str:
    """Carry out one order; gives its one line of answer: `ok`, JSON, or `error: …`."""
    words = line.split()
    try:
        if words[:1] == ["faults"]:
            found = read_order(faults, " ".join(words[1:]))
            return "ok" if found is None else json.dumps(found)
        if not words or words[0] not in _ORDERS:
            raise RequestError(f"{line.strip()!r} is not an order; there are: {HELP}")
        return _ORDERS[words[0]](simulator, words[1:])
    except MotorbusError as error:
        return f"error: {error.summary}" + (f"; expected {error.expected}" if error.expected else "")


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
    press: Callable[[int, bool], None] = _able(simulator, words[0], "set_input", "no inputs")
    if not words[1].isdecimal() or words[2] not in ("on", "off"):
        raise RequestError(f"the order is: {form}")
    press(int(words[1]), words[2] == "on")
    return "ok"


def _block(simulator: Simulator, words: list[str]) -> str:
    form = "block ID [LOW HIGH]"
    _expect(words, at_least=1, at_most=3, order=form)
    block: Callable[[tuple[float, float] | None], None] = _able(
        simulator, words[0], "block_shaft", "no physics for `block`"
    )
    if len(words) == 2:
        raise RequestError(f"the order is: {form}")
    block((_quantity(words[1], "position"), _quantity(words[2], "position")) if words[1:] else None)
    return "ok"


def _push(simulator: Simulator, words: list[str]) -> str:
    _expect(words, at_least=2, at_most=2, order="push ID ANGLE")
    push: Callable[[float], None] = _able(simulator, words[0], "push_shaft", "no physics for `push`")
    push(_quantity(words[1], "position"))
    return "ok"


def _load(simulator: Simulator, words: list[str]) -> str:
    _expect(words, at_least=2, at_most=2, order="load ID PERCENT")
    load: Callable[[float], None] = _able(simulator, words[0], "load_shaft", "no physics for `load`")
    load(_quantity(words[1], "load"))
    return "ok"


def _release(simulator: Simulator, words: list[str]) -> str:
    _expect(words, at_least=1, at_most=1, order="release ID")
    release: Callable[[], None] = _able(simulator, words[0], "release_shaft", "no physics for `release`")
    release()
    return "ok"


def _influence(simulator: Simulator, words: list[str], order: str, quantity: str) -> str:
    """Set the supply (V) or the temperature (°C) of a node."""
    _expect(words, at_least=2, at_most=2, order=order)
    node = _node(simulator, words[0])
    if not hasattr(node, quantity):
        raise RequestError(f"node {words[0]} has no physics for `{order.split()[0]}`")
    setattr(node, quantity, units.parse(words[1], quantity))
    return "ok"


def _quantity(text: str, quantity: str) -> float:
    """A number with its unit. Raises RequestError without one."""
    value = units.parse(text, quantity)
    if text[-1] in "0123456789.":
        example = "30deg or 0.5rad" if quantity == "position" else "50%"
        raise RequestError(f"{text} has no unit", expected=f"a number with its unit, as {example}")
    return value


def _able(simulator: Simulator, id: str, name: str, lacks: str) -> Any:
    """What this node has under a name that only some have."""
    found = getattr(_node(simulator, id), name, None)
    if found is None:
        raise RequestError(f"node {id} has {lacks}")
    return found


def _help(simulator: Simulator, words: list[str]) -> str:
    return HELP


_ORDERS: dict[str, Callable[[Simulator, list[str]], str]] = {
    "status": _status,
    "power-cycle": _power_cycle,
    "unplug": _unplug,
    "plug": _plug,
    "set-input": _set_input,
    "block": _block,
    "push": _push,
    "load": _load,
    "release": _release,
    "supply": partial(_influence, order="supply ID VOLTS", quantity="voltage"),
    "heat": partial(_influence, order="heat ID DEGREES", quantity="temperature"),
    "help": _help,
}


def _expect(words: list[str], *, at_least: int = 0, at_most: int, order: str) -> None:
    if not at_least <= len(words) <= at_most:
        raise RequestError(f"the order is: {order}")


def _node(simulator: Simulator, text: str) -> SimulatedNode:
    try:
        return simulator.nodes[units.whole(text)]
    except (ValueError, KeyError):
        raise RequestError(
            f"there is no node {text}; there are: {told(simulator, simulator.nodes)}"
        ) from None


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
