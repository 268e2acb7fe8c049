"""Who sees to it that a machine is stopped when its lease is lost, or when nobody attends what has no end.

Every bus is watched and stopped by itself, so that a slow or a dead one delays no other. Who did not accept the stop is
told again and again while the lease is lost: a cable that was out may be in again.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from functools import partial
from threading import Event, Thread
from typing import Any, Final

from motorbus.bus.background import BackgroundTask
from motorbus.core.steps import Sleep, catch
from motorbus.errors import MotorbusError
from motorbus.motion.body import Body
from motorbus.motion.leaving import given_up, goes_on, moves, stopped_going_on
from motorbus.motion.safety.lease import Lease, Standing
from motorbus.session.echo import LOG

AGAIN: Final = 0.5
"""s after which those are told once more who did not accept the stop."""
IDLE: Final = 60.0
"""s; a lease is looked at so often, though nothing is expected to happen to it."""


class Sentry:
    """Sees to it that what moves on a machine is stopped when this lease is lost, and tells what went wrong then.

    What goes on without an end is stopped as well when its holder attends no longer, or gives the lease back. `errors`
    by the names of the axes are of the last loss.
    """

    def __init__(self, body: Body, lease: Lease) -> None:
        self.errors: dict[str, MotorbusError] = {}
        self._body = body
        self._lease = lease
        self._over = Event()
        lost = lease.standing(body.now) is Standing.LOST
        self._posts = {name: _Post(lease.losses - lost) for name in body.buses}

    def start(self) -> None:
        """From now on: in a thread for each bus where time is real, else stepped whenever the bus is used."""
        self._lease.watchers.append(self._wake)
        for name, bus in self._body.buses.items():
            post = self._posts[name]
            if bus.link.virtual:
                post.along = BackgroundTask(bus, partial(self._watching, name))
                post.along.along()
            else:
                Thread(target=self._watch, args=(name,), name=f"motorbus lease {name}", daemon=True).start()

    def end(self) -> None:
        """The lease counts no longer."""
        self._over.set()
        if self._wake in self._lease.watchers:
            self._lease.watchers.remove(self._wake)
        self._wake()
        for post in self._posts.values():
            if post.along is not None:
                post.along.drop()

    def busy(self, bus: str) -> bool:
        """Whether the lease was lost, and what moves on this bus has not been told to stop yet."""
        self._lease.standing(self._body.now)
        return self._lease.losses > self._posts[bus].loss and not self._over.is_set()

    def _wake(self) -> None:
        for post in self._posts.values():
            post.woken.set()
            if post.along is not None:
                post.along.hurry()

    # -- when ----------------------------------------------------------------------------------------------------------

    def _late(self, bus: str) -> bool:
        """Whether somebody on this bus is to be told to stop now."""
        return self.busy(bus) or (self._undone(bus) and self._body.now >= self._posts[bus].again)

    def _undone(self, bus: str) -> bool:
        """Whether somebody goes on here who has nobody any more."""
        now = self._body.now
        if self._lease.is_attended(now):
            return False
        failed = self._lease.standing(now) is Standing.LOST and bool(self._posts[bus].failed)
        return failed or any(map(goes_on, self._axes(bus)))

    def _left(self, bus: str) -> float:
        """s until it is to be looked at again."""
        now = self._body.now
        left = min(max(self._lease.until - now, 0.0) + 1e-6, IDLE)
        return min(left, max(self._posts[bus].again - now, 0.0) + 1e-6) if self._undone(bus) else left

    def _axes(self, bus: str) -> list[Any]:
        return [axis for axis in self._body.axes.values() if axis.spec.bus == bus]

    # -- what ----------------------------------------------------------------------------------------------------------

    async def _watching(self, bus: str) -> None:
        while not self._over.is_set():
            if self._late(bus):
                await self._stopping(bus)
            await catch(Sleep(self._left(bus)))

    def _watch(self, bus: str) -> None:
        woken = self._posts[bus].woken
        while not self._over.is_set():
            woken.clear()
            left = AGAIN
            try:
                if self._late(bus):
                    there = self._body.buses[bus]
                    BackgroundTask(there, partial(self._stopping, bus)).carried()
                left = self._left(bus)
            except Exception as error:  # the bus cannot be used: try again later
                with suppress(Exception):  # nor may want of memory end this thread
                    self._failed(bus, self._lease.losses, self._body.axes.keys(), error)
            woken.wait(0.0 if self._over.is_set() else left)

    async def _stopping(self, bus: str) -> None:
        """Tell to stop whoever must; nothing that goes wrong is raised, for this bus is looked at again."""
        post, lost = self._posts[bus], self._lease.standing(self._body.now) is Standing.LOST or self.busy(bus)
        loss, axes = self._lease.losses, self._axes(bus)
        moving = {axis.name for axis in axes if moves(axis) or axis.name in post.failed}
        failed = {axis.name for axis in axes if axis.name in moving and axis.bus.latched}
        anew = loss > post.loss
        again = () if anew else post.failed
        try:
            errors = await (given_up(axes, again) if lost else stopped_going_on(axes))
        except MemoryError:  # an interruption, behind which nothing here may go on
            raise
        except Exception as error:  # the port is gone: this bus is told again, and the others at any rate
            self._failed(bus, loss, moving if lost else (), error)
        else:
            self._note(axes, errors, anew)
            post.take(loss, failed | errors.keys() if lost else (), self._body.now + AGAIN)

    def _failed(self, bus: str, loss: int, names: Iterable[str], error: Exception) -> None:
        if loss > self._posts[bus].loss:
            LOG.warning("%s: nobody attends any more, and nothing could be told to stop: %s", bus, error)
        self._posts[bus].take(loss, names, self._body.now + AGAIN)

    def _note(self, axes: list[Any], errors: dict[str, MotorbusError], anew: bool) -> None:
        """Keep what went wrong of these axes, and say what is new of it."""
        for axis in axes:
            before = self.errors.pop(axis.name, None)
            error = errors.get(axis.name)
            if error is not None:
                self.errors[axis.name] = error
            if error is not None and (anew or before is None):
                LOG.warning("%s: nobody attends it any more, and it may go on: %s", axis.name, error.summary)
            elif error is None and before is not None and not anew:
                LOG.warning("%s: it has accepted the stop now", axis.name)


class _Post:
    """What is known of one bus: the number of the `loss` after which it was stopped, those who `failed` to accept that,
    and from when on they are told `again` (s)."""

    def __init__(self, loss: int) -> None:
        self.loss = loss
        self.failed: frozenset[str] = frozenset()
        self.again = 0.0
        self.woken = Event()
        self.along: BackgroundTask[None] | None = None

    def take(self, loss: int, failed: Iterable[str], again: float) -> None:
        """They were told to stop."""
        self.loss, self.failed, self.again = loss, frozenset(failed), again
