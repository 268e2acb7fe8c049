"""A mount at work in a thread of the test, ended and joined with it, and clients that use nothing but the system."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from motorbus.simulation.mount import Mount

PATIENCE = 10.0


@contextmanager
def served(mount: Mount) -> Iterator[None]:
    """Serve in a thread; whatever the loop raises is raised here."""
    stop, ring = os.pipe()
    errors: list[BaseException] = []

    def work() -> None:
        try:
            mount.serve(stop)
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        os.write(ring, b".")
        thread.join(PATIENCE)
        assert not thread.is_alive()
        os.close(stop)
        os.close(ring)
    if errors:
        raise errors[0]


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
