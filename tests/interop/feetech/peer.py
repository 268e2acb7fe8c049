"""A library in a process of its own: `peer.call("handler", "ping", 1)`. The other end is `client.py`.

The library sees what `make` put into `.peers/NAME`, and nothing else.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple, Self

HERE = Path(__file__).resolve().parent
PEERS = HERE.parent.parent.parent / ".peers"


class Library(NamedTuple):
    """The module to import, and the folders of `.peers` it needs."""

    name: str
    module: str
    folders: tuple[str, ...]


OLD_SDK = Library("feetech-servo-sdk", "scservo_sdk", ("feetech-servo-sdk", "pyserial"))
NEW_SDK = Library("ftservo-python-sdk", "scservo_sdk", ("ftservo-python-sdk", "pyserial"))
RUSTYPOT = Library("rustypot", "rustypot", ("rustypot",))


class PeerError(Exception):
    """What a library raised."""


def folders(library: Library) -> str:
    """The module path of the library. Raises PeerError where it is missing."""
    missing = [name for name in library.folders if not (PEERS / name).is_dir()]
    if missing:
        raise PeerError(
            f".peers/{missing[0]} is missing; `make test` installs it, or: python scripts/peers.py"
        )
    return os.pathsep.join(str(PEERS / name) for name in library.folders)


class Script:
    """A script that answers lines of JSON on standard input by `{"value": …}` or `{"error": …}`."""

    def __init__(self, command: list[str], path: str) -> None:
        left = {name: text for name, text in os.environ.items() if not name.startswith(("CAN_", "PYTHON"))}
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-P", *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**left, "PYTHONPATH": path},
        )

    def send(self, *request: Any) -> None:
        """The first half of `ask`."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()

    def receive(self) -> Any:
        """The second half of `ask`. Raises PeerError with what the library raised."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, "the script has ended; its error is above"
        answer = json.loads(line)
        if "error" in answer:
            raise PeerError(answer["error"])
        return answer["value"]

    def ask(self, *request: Any) -> Any:
        self.send(*request)
        return self.receive()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(10)


class Peer(Script):
    """One process with one library. Raises PeerError for what the library raises."""

    def __init__(self, library: Library) -> None:
        super().__init__([str(HERE / "client.py"), library.module], folders(library))

    def new(self, handle: str, name: str, *arguments: Any) -> None:
        """Call `name` of the module and keep its result under this handle."""
        self.ask("new", handle, name, list(arguments))

    def call(self, owner: str, name: str, *arguments: Any) -> Any:
        """Call a method of what is kept, of a class, or ("") of the module."""
        return self.ask("call", owner, name, list(arguments))


def kept(handle: str) -> dict[str, str]:
    """An argument that is replaced by what is kept under this handle."""
    return {"kept": handle}
