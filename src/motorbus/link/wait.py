"""Wait until a descriptor is readable.

`poll` is faster than `select` and has no limit of 1024 descriptors, but counts whole milliseconds. `Readiness` polls
for the whole milliseconds and selects for the rest.
"""

from __future__ import annotations

import select
from collections.abc import Sequence
from time import monotonic

SELECT_LIMIT = 1024  # FD_SETSIZE: select knows lower descriptors only
LONGEST = 86_400.0  # s; some systems refuse longer waits


class Readiness:
    """One descriptor, registered once for many waits."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._poll = None
        if hasattr(select, "poll"):  # Windows has none
            registered = select.poll()
            registered.register(descriptor, select.POLLIN)
            self._poll = registered.poll

    def wait(self, until: float) -> bool:
        """Wait for data or the end of the stream, until this moment (s, monotonic clock); False when none came.

        May raise OSError or ValueError when another thread has closed the descriptor.
        """
        pause = until - monotonic()
        if self._poll is not None:
            try:
                if self._poll(int(min(pause, LONGEST) * 1000) if pause > 0.0 else 0):
                    return True
                if pause <= 0.0:
                    return False
            except RuntimeError:  # another thread waits on the same poll object
                pass
        return wait_readable(self._descriptor, until - monotonic())


def wait_readable(descriptor: int, seconds: float) -> bool:
    """Wait for data or for the end of the stream; False after the time-out. Errors as for `wait_any`."""
    return bool(wait_any((descriptor,), seconds))


def wait_any(descriptors: Sequence[int], seconds: float) -> list[int]:
    """Wait for the first and return all that are readable. Raises OSError or ValueError for a closed descriptor."""
    seconds = min(max(seconds, 0.0), LONGEST)
    if max(descriptors) < SELECT_LIMIT:
        return select.select(descriptors, (), (), seconds)[0]
    ready = select.poll()
    for descriptor in descriptors:
        ready.register(descriptor, select.POLLIN)
    events = ready.poll(seconds * 1000)
    if any(event & select.POLLNVAL for _, event in events):
        raise ValueError("a descriptor is closed")
    return [descriptor for descriptor, _ in events]
