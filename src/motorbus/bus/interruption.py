"""What may fall on any line of a program, and is nobody's failure: how it is known, and which of several is raised."""

from __future__ import annotations

HARD = (KeyboardInterrupt, SystemExit, MemoryError)


def interrupts(error: BaseException | None) -> bool:
    """Whether this is nobody's failure, and may fall on any line: Ctrl-C, the end of a program, want of memory."""
    return error is not None and (not isinstance(error, Exception) or isinstance(error, MemoryError))


def foremost(first: BaseException, *others: BaseException | None) -> BaseException:
    """Which of them is raised: the first; but one that ends a program counts for more than one that ends a task.

    The notes of the first go along, once.
    """
    told = next((one for one in (first, *others) if isinstance(one, HARD)), first)
    known = getattr(told, "__notes__", ())
    for note in [note for note in getattr(first, "__notes__", ()) if note not in known]:
        told.add_note(note)
    return told


def closed(error: BaseException | None, around: BaseException | None) -> bool:
    """Whether this has closed a coroutine, or has fallen into what deals with that: nobody will await it any more.

    That is done by hand or by the garbage collector, which may come by within any call of the same thread, one that
    holds the lock of the bus included. What is closed was awaiting and held nothing, so it lets go of nothing.
    `around` is what whoever awaits it was dealing with from the beginning, which may be a closing of his own.
    """
    while error is not None and error is not around:
        if isinstance(error, GeneratorExit):
            return True
        error = error.__context__
    return False
