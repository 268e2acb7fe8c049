"""The datagram socket by which another process asks for an emergency stop, and what an emergency stop achieved."""

from __future__ import annotations

import json
import os
import shlex
import socket
import sys
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

from motorbus.errors import LinkError, PortNotFound
from motorbus.link.lock import program_name

COMMAND_SHOWN: Final = 60
"""Characters of a command line in the message of the stop that it asked for."""
LONGEST: Final = 65_536
"""Bytes of a datagram."""
STOP_TIMEOUT: Final = 5.0
"""s that a caller waits for the outcome of a stop."""


class StopOutcome(NamedTuple):
    """What an emergency stop achieved: who acknowledged, who did not, and what that promises."""

    acknowledged: tuple[int, ...]
    silent: tuple[int, ...]
    rounds: int
    promise: str


def asked_by(client: str = "") -> str:
    """Which process asked for a stop, and the local time, for the errors of what is refused after it."""
    return f"{f'by {client}' if client else 'in this process'} at {time.strftime('%H:%M:%S')}"


def client_name(about: bytes) -> str:
    """The process that asks: "process 12 (motorbus estop)"; "another process" where it does not say."""
    try:
        request = json.loads(about)
        pid, command = int(request["pid"]), str(request["command"])
    except Exception:  # a stop is a stop, whatever else the request says
        return "another process"
    command = command if len(command) <= COMMAND_SHOWN else f"{command[:COMMAND_SHOWN]}…"
    return f"process {pid} ({command})"


def _request() -> bytes:
    """What a client sends: the word, its process id and its command line."""
    command = shlex.join([program_name(), *sys.argv[1:]])[: 2 * COMMAND_SHOWN]
    return f"estop {json.dumps({'pid': os.getpid(), 'command': command})}".encode()


def open_socket(path: Path | None) -> tuple[socket.socket, socket.socket]:
    """The datagram socket of a stop thread, mode 0600 at this path, and one that sends to it.

    Without a path, or where none can be made, no other process reaches it.
    """
    if path is not None and hasattr(socket, "AF_UNIX"):
        server, client = (socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in range(2))
        try:
            path.unlink(missing_ok=True)
            server.bind(str(path))
            path.chmod(0o600)
            client.connect(str(path))
        except OSError:  # a full disk must not take the stop away from this process
            server.close()
            client.close()
        else:
            return server, client
    return socket.socketpair()


def request_estop(path: Path, timeout: float = STOP_TIMEOUT) -> StopOutcome:
    """Ask the process that serves this socket for an emergency stop, and wait for its outcome.

    Raises PortNotFound when no process serves it, LinkError when the process does not answer in time.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as client, tempfile.TemporaryDirectory() as folder:
        client.settimeout(timeout)
        try:
            client.bind("" if sys.platform == "linux" else f"{folder}/reply")  # "": a free abstract name
            client.connect(str(path))
            client.send(_request())
            reply = client.recv(LONGEST)
        except (FileNotFoundError, ConnectionRefusedError):
            raise PortNotFound(
                "no motorbus process offers an emergency stop for this bus",
                cause="none holds it",
            ) from None
        except OSError as error:
            raise LinkError(f"the process that holds the bus did not answer: {error}") from error
    outcome = json.loads(reply)
    return StopOutcome(
        tuple(outcome["acknowledged"]), tuple(outcome["silent"]), outcome["rounds"], outcome["promise"]
    )
