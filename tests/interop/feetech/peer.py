"""A library at work in a process of its own, as the sessions use it: `peer.call("handler", "ping", 1)`.

The other end is `client.py`. What `make` put into `.peers/NAME` is all that the library gets to see.
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
PATIENCE = 10.0  # s that it may take to end


class Library(NamedTuple):
    """A peer: its name and version, the module to import, and the folders of `.peers` it needs."""

    name: str
    version: str
    module: str
    folders: tuple[str, ...]


OLD_SDK = Library("feetech-servo-sdk", "1.0.0", "scservo_sdk", ("feetech-servo-sdk", "pyserial"))
NEW_SDK = Library("ftservo-python-sdk", "2.0.1", "scservo_sdk", ("ftservo-python-sdk", "pyserial"))
RUSTYPOT = Library("rustypot", "1.13.1", "rustypot", ("rustypot",))


class PeerError(Exception):
    """What a library raised."""


class Peer:
    """One process with one library. Raises PeerError for what the library raises."""

    def __init__(self, library: Library) -> None:
        missing = [name for name in library.folders if not (PEERS / name).is_dir()]
        if missing:
            raise PeerError(
                f".peers/{missing[0]} is missing; `make test` installs it, or: python scripts/peers.py"
            )
        path = os.pathsep.join(str(PEERS / name) for name in library.folders)
        self._process = subprocess.Popen(
            [sys.executable, "-S", "-P", str(HERE / "client.py"), library.module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": path},
        )

    def new(self, handle: str, name: str, *arguments: Any) -> None:
        """Call `name` of the module and keep what it gives under this handle."""
        self.ask("new", handle, name, list(arguments))

    def call(self, owner: str, name: str, *arguments: Any) -> Any:
        """Call a method of what is kept, of a class, or ("") of the module."""
        return self.ask("call", owner, name, list(arguments))

    def ask(self, *request: Any) -> Any:
        """One request as `client.py` lists them."""
        self.tell(*request)
        return self.heard()

    def tell(self, *request: Any) -> None:
        """The first half of `ask`."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()

    def heard(self) -> Any:
        """The second half of `ask`."""
        assert self._process.stdout is not None
        answer = json.loads(self._process.stdout.readline())
        if "error" in answer:
            raise PeerError(answer["error"])
        return answer["value"]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(PATIENCE)


def kept(handle: str) -> dict[str, str]:
    """An argument that stands for what is kept under this handle."""
    return {"kept": handle}
