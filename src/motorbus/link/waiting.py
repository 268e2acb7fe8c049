"""Wait for bytes, or for a moment, without burning the processor and as exactly as the system allows.

`select` counts microseconds where `poll` counts milliseconds, and a control loop feels the difference; but it knows
only the first thousand descriptors of a process.
"""

from __future__ import annotations

from collections.abc import Sequence
from select import select

LIMIT = 1024  # FD_SETSIZE
LONGEST = 86_400.0  # s; more than some systems accept is cut, and nothing has come by then


def wait_readable(descriptor: int, seconds: float) -> bool:
    """Wait until something can be read, or the other end is gone, or the time is over: then False.

    Raises OSError or ValueError for a descriptor that is closed.
    """
    if descriptor < LIMIT:
        return bool(select((descriptor,), (), (), min(seconds, LONGEST))[0])
    from select import POLLIN, poll

    ready = poll()
    ready.register(descriptor, POLLIN)
    return bool(ready.poll(min(seconds, LONGEST) * 1000))


def is_readable(descriptor: int) -> bool:
    """Whether something can be read now, or the other end is gone; else to try it costs an exception, and more so cold.

    Raises as `wait_readable`.
    """
    if descriptor < LIMIT:
        return bool(select((descriptor,), (), (), 0)[0])
    return wait_readable(descriptor, 0.0)


def wait_any(descriptors: Sequence[int], seconds: float) -> list[int]:
    """Those of them that can be read, or whose other end is gone; waits for the first, as `wait_readable` does.

    Raises OSError or ValueError when one of them is closed.
    """
    if max(descriptors) < LIMIT:
        return select(descriptors, (), (), min(seconds, LONGEST))[0]
    from select import POLLIN, POLLNVAL, poll

    ready = poll()
    for descriptor in descriptors:
        ready.register(descriptor, POLLIN)
    found = ready.poll(min(seconds, LONGEST) * 1000)
    if any(event & POLLNVAL for _, event in found):
        raise ValueError("a descriptor is closed")
    return [descriptor for descriptor, _ in found]
