"""Runs work in forked processes, so that each mutant finds the same clean beginning and none outlives its time."""

from __future__ import annotations

import contextlib
import ctypes
import os
import pickle
import resource
import selectors
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

J = TypeVar("J")
GIGABYTE = 1 << 30
MEMORY = 4 * GIGABYTE
"""Bytes of addresses that a child may have: a fault can make a list that never ends."""
START = 3.0
"""s by the clock that a child may take to begin."""
LATE = 4.0
"""Times as much by the clock as of processor time: the machine has others to serve."""


class Child(NamedTuple):
    """A forked process, where its answer comes, and when (monotonic) it has had its time."""

    pid: int
    pipe: int
    until: float
    said: list[bytes]


def each(
    jobs: Iterable[J], work: Callable[[J], Any], seconds: float, at_once: int = 2
) -> Iterator[tuple[J, Any]]:
    """`work(job)` for every job, in a child of its own, with its result; None from one that died or had its time.

    `seconds` is how long a child may last (processor time; by the clock somewhat longer). Jobs are taken one by one,
    so `work` sees what the results before have taught this process.
    """
    running: dict[int, tuple[J, Child]] = {}
    waiting = iter(jobs)
    with selectors.DefaultSelector() as ready:
        try:
            while True:
                while len(running) < at_once and (job := next(waiting, None)) is not None:
                    child = _fork(work, job, seconds)
                    running[child.pipe] = (job, child)
                    ready.register(child.pipe, selectors.EVENT_READ)
                if not running:
                    return
                for pipe in _ended(ready, running):
                    job, child = running.pop(pipe)
                    ready.unregister(pipe)
                    yield job, _result(child)
        finally:
            for _, child in running.values():
                _result(child)


def _fork(work: Callable[[J], Any], job: J, seconds: float) -> Child:
    answer, tell = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(answer)
        _in_child(work, job, seconds, tell)
    os.close(tell)
    return Child(pid, answer, time.monotonic() + START + LATE * seconds, [])


def _in_child(work: Callable[[J], Any], job: J, seconds: float, tell: int) -> None:
    """Do it, tell it, and be gone without any of the parent's endings."""
    code = 1
    try:
        os.setpgid(0, 0)
        _end_with_parent()
        most = round(seconds) + 2
        resource.setrlimit(resource.RLIMIT_CPU, (most, most))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        said = pickle.dumps(work(job))
        while said:
            said = said[os.write(tell, said) :]
        code = 0
    finally:
        os._exit(code)


def _end_with_parent() -> None:
    """Where the system can do it, this process is killed as soon as its parent is gone."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def _ended(ready: selectors.BaseSelector, running: dict[int, tuple[Any, Child]]) -> list[int]:
    """The children that have said all they will, or have had their time; at least one."""
    while True:
        soonest = min(child.until for _, child in running.values())
        ended = []
        for key, _ in ready.select(max(0.0, soonest - time.monotonic())):
            if data := os.read(key.fd, 1 << 16):
                running[key.fd][1].said.append(data)
            else:
                ended.append(key.fd)
        now = time.monotonic()
        ended += [pipe for pipe, (_, child) in running.items() if child.until <= now and pipe not in ended]
        if ended:
            return ended


def _result(child: Child) -> Any:
    """What it said; whatever it has left behind ends with it."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)
    os.waitpid(child.pid, 0)
    os.close(child.pipe)
    try:
        return pickle.loads(b"".join(child.said))
    except Exception:  # nothing, or the half of it
        return None
