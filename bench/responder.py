"""Builds the responder in C and runs one for each measurement, so that every contender meets a fresh wire."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

from bench.places import BUILD, HERE

SOURCE = HERE / "responder.c"


class NoCompiler(Exception):
    """There is no C compiler, or it refused."""


def build(target: Path = BUILD / "responder") -> Path:
    """Compile the responder unless it is newer than its source. Raises NoCompiler."""
    if target.exists() and target.stat().st_mtime >= SOURCE.stat().st_mtime:
        return target
    compiler = next((name for name in ("gcc", "cc", "clang") if which(name)), None)
    if compiler is None:
        raise NoCompiler("no C compiler found (gcc, cc or clang); on Debian and Ubuntu: apt install gcc")
    target.parent.mkdir(parents=True, exist_ok=True)
    fresh = target.with_name(f"{target.name}.{os.getpid()}")  # others may be about to run what is there
    done = subprocess.run(
        [compiler, "-O2", "-Wall", "-Wextra", "-o", str(fresh), str(SOURCE)], capture_output=True, text=True
    )
    if done.returncode:
        raise NoCompiler(done.stderr)
    return fresh.replace(target)


class Responder:
    """A responder that is running: `port` is its pseudo-terminal; its books are known once it has ended."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        self._process = process
        self._output = process.stdout
        self.port = self._output.readline().strip()
        self.books: dict[str, Any] = {}

    def end(self) -> None:
        """End it and take its books."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        last = self._output.read()
        self._output.close()
        self._process.wait()
        self.books = json.loads(last) if last else {}


@contextmanager
def responder(
    program: Path, baud: int = 0, turnaround: float = 0.0, every: int = 1, pieces: bool = False
) -> Iterator[Responder]:
    """One responder on a new pseudo-terminal; afterwards its `books` are there.

    With a `baud` rate bytes take their time, and the answers to one request begin after a `turnaround` (s, in whole
    microseconds); without, it answers at once. Only ids that `every` divides are there. An answer of several packets is
    handed over whole, or with `pieces` each packet as its last byte has passed.
    """
    command = [str(program), str(baud), str(round(turnaround * 1e6)), str(every), str(int(pieces))]
    running = Responder(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
    try:
        yield running
    finally:
        running.end()
