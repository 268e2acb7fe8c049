"""A server at work in a thread of the test, ended and joined with it, and clients that use nothing but the system."""

from __future__ import annotations

import os
import select
import time
from collections.abc import Iterator
from contextlib import contextmanager

from motorbus.simulation.server import Server, ServerThread

PATIENCE = 10.0


@contextmanager
def served(server: Server) -> Iterator[None]:
    """Serve in a thread; an error of the loop is raised here."""
    with ServerThread(server):
        yield


def received(descriptor: int, count: int, patience: float = PATIENCE) -> str:
    """So many bytes from this descriptor as hex, fewer when no more come within the patience (s)."""
    data, end = b"", time.monotonic() + patience
    while len(data) < count and (left := end - time.monotonic()) > 0:
        if select.select([descriptor], (), (), left)[0]:
            piece = os.read(descriptor, count - len(data))
            if not piece:
                break
            data += piece
    return data.hex(" ").upper()


def asked(descriptor: int, request: str, count: int) -> str:
    """Send bytes given as hex and read so many."""
    os.write(descriptor, bytes.fromhex(request))
    return received(descriptor, count)
