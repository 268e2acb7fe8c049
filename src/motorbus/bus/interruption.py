"""What may fall on any line of a program, and is nobody's failure: how it is known, and which of several is raised."""

from __future__ import annotations

HARD = (KeyboardInterrupt, SystemExit, MemoryError)


def interrupts(error: BaseException | None) -> bool:
    """Whether this is nobody's failure, and may fall on any line: Ctrl-C, the end of a program, want of memory."""
    return error is not None and (not isinstance(error, Exception) or isinstance(error, MemoryError))


def foremost(first: BaseException, *others: BaseException | None) -> BaseException:
    """Which of them is raised: the first; but one that ends a program counts for more than one that ends a task."""
    if not isinstance(first, HARD):
        for other in others:
            if isinstance(other, HARD):
                return other
    return first


def closed(error: BaseException | None) -> bool:
    """Whether this has closed a coroutine, or has fallen into what deals with that: nobody will await it any more.

    That is done by hand or by the garbage collector, which may come by within any call of the same thread, one that
    holds the lock of the bus included. What is closed was awaiting and held nothing, so it lets go of nothing.
    """
    while error is not None and not isinstance(error, GeneratorExit):
        error = error.__context__
    return error is not None
