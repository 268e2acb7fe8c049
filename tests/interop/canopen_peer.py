"""Our end of python-canopen: where it is, how it is started, and its answers as values.

It runs with what `make` put into `.peers/canopen` and with the project's own python-can, but not with the project:
`-S` keeps the environment's own modules out, and only the folders named here are put back.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
LIBRARY = ROOT / ".peers" / "canopen"
MODULES = Path(sysconfig.get_path("purelib"))
"""Where python-can and pyserial are, and not motorbus: what a folder merely points to is not in it."""


class CanopenError(Exception):
    """What python-canopen raised: its text, the name of its class, and the abort code or None."""

    def __init__(self, text: str, kind: str, code: int | None = None) -> None:
        super().__init__(text)
        self.kind = kind
        self.code = code


def environment() -> dict[str, str]:
    """The environment for its scripts. The test fails when the library is not there."""
    if not LIBRARY.is_dir():
        pytest.fail(".peers/canopen is missing; `make test` installs it, or: python scripts/peers.py")
    if not (MODULES / "can").is_dir():
        pytest.fail('python-can is missing; pip install "motorbus[can]"')
    left = {name: value for name, value in os.environ.items() if not name.startswith(("CAN_", "PYTHON"))}
    return {**left, "PYTHONPATH": os.pathsep.join(map(str, (LIBRARY, MODULES)))}


def script(name: str, *arguments: str) -> list[str]:
    """The command that runs one of its scripts."""
    return [sys.executable, "-S", str(HERE / name), *arguments]


class Canopen:
    """The library at work in its own process: `peer.read("node_id")`; what can be asked stands in canopen_client.py."""

    def __init__(
        self, interface: str, channel: str, kwargs: Mapping[str, object], eds: Path, node: int
    ) -> None:
        command = script(
            "canopen_client.py", interface, channel, json.dumps(dict(kwargs)), str(eds), str(node)
        )
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment()
        )

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self._ask([name, *arguments])

    def _ask(self, request: list[Any]) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        assert line, "python-canopen ended; what it said is above"
        answer = json.loads(line)
        if "error" in answer:
            raise CanopenError(answer["error"], answer["kind"], answer.get("code"))
        return answer["value"]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(10)
