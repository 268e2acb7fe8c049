"""The emergency stop of a machine: every real bus in a thread of its own, so that none waits for another.

It does not use the conductor, which may be waiting for what is to be stopped. Buses in virtual time are stopped one
after the other by the caller, for their clock belongs to one thread.
"""

from __future__ import annotations

from threading import Thread

from motorbus.bus.stop_socket import StopOutcome
from motorbus.errors import MotorbusError
from motorbus.motion.body import Body


def estop(body: Body) -> dict[str, StopOutcome]:
    """Stop every bus of a machine at the same time; what came of each, by its name."""
    found: dict[str, StopOutcome] = {}

    def one(name: str) -> None:
        found[name] = _stopped(body, name)

    threads = {
        name: Thread(target=one, args=(name,), name=f"motorbus estop {name}", daemon=True)
        for name, bus in body.buses.items()
        if not bus.link.virtual
    }
    left = [name for name in body.buses if name not in threads or not _started(threads[name])]
    for name in left:  # one after the other, while the others are at it
        one(name)
    for name, thread in threads.items():
        if name not in left:
            thread.join()
    return {name: found[name] for name in body.buses}


def _started(thread: Thread) -> bool:
    """Whether there was a thread to be had: a process that has too many still has this one."""
    try:
        thread.start()
    except RuntimeError:
        return False
    return True


def trigger(body: Body) -> None:
    """Ask the stop thread of every bus for a stop, and return at once."""
    for bus in body.buses.values():
        bus.trigger_estop()


def _stopped(body: Body, name: str) -> StopOutcome:
    try:
        return body.buses[name].estop()
    except Exception as error:  # closed, or its port is gone: the others are stopped all the same
        nodes = tuple(axis.spec.node for axis in body.axes.values() if axis.spec.bus == name)
        why = error.summary if isinstance(error, MotorbusError) else f"{type(error).__name__}: {error}"
        return StopOutcome((), nodes, 0, f"nothing: {why}")


def latch(body: Body) -> None:
    """Buses that are opened while an emergency stop is in force are under it too; nothing is sent."""
    for bus in body.buses.values():
        bus.latch()


def reset(body: Body) -> None:
    """Take the latch of an emergency stop off every bus."""
    for bus in body.buses.values():
        bus.reset()
