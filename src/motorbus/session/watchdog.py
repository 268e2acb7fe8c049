"""The watchdog of a lease: it stops a machine when the lease is lost, and endless motion when its holder has left.

Each bus is watched separately, so a slow or dead bus does not delay the others. While the lease is lost, the stop is
sent again to each axis that did not accept it, because a cable may be connected again.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from threading import Event, Thread
from typing import Any, Final

from motorbus.bus.running import run_here
from motorbus.bus.tasks import Tree
from motorbus.core.steps import Sleep, catch
from motorbus.errors import MotorbusError
from motorbus.motion.body import Body
from motorbus.motion.leaving import given_up, goes_on, moves, stopped_going_on
from motorbus.motion.safety.lease import Lease, Standing
from motorbus.session.echo import LOG

RETRY_PERIOD: Final = 0.5
"""s after which the stop is sent again to axes that did not accept it."""
IDLE: Final = 60.0
"""s; a lease is checked at least so often."""


class Watchdog:
    """Stops what moves on a machine when this lease is lost, and endless motion when its holder releases it.

    `errors` of the last loss, by name of the axis.
    """

    def __init__(self, body: Body, lease: Lease) -> None:
        self.errors: dict[str, MotorbusError] = {}
        self._body = body
        self._lease = lease
        self._over = Event()
        lost = lease.standing(body.now) is Standing.LOST
        self._posts = {name: _Post(lease.losses - lost) for name in body.buses}

    def start(self) -> None:
        """Watch each bus: in a thread, in virtual time beside the procedures of the program."""
        self._lease.watchers.append(self._wake)
        for name, bus in self._body.buses.items():
            if bus.link.virtual:
                self._posts[name].tree = bus.watch(self._watch_along(name))
            else:
                Thread(target=self._watch, args=(name,), name=f"motorbus lease {name}", daemon=True).start()

    def end(self) -> None:
        """Stop watching."""
        self._over.set()
        if self._wake in self._lease.watchers:
            self._lease.watchers.remove(self._wake)
        self._wake()
        for name, post in self._posts.items():
            if post.tree is not None:
                self._body.buses[name].unwatch(post.tree)
                post.tree = None

    def busy(self, bus: str) -> bool:
        """Whether the lease was lost and the stop has not been sent on this bus yet."""
        self._lease.standing(self._body.now)
        return self._lease.losses > self._posts[bus].loss and not self._over.is_set()

    def _wake(self) -> None:
        for post in self._posts.values():
            post.woken.set()
            if post.tree is not None:
                post.tree.end_sleeps()

    # -- when ----------------------------------------------------------------------------------------------------------

    def _late(self, bus: str) -> bool:
        """Whether a stop is due on this bus now."""
        return self.busy(bus) or (self._undone(bus) and self._body.now >= self._posts[bus].again)

    def _undone(self, bus: str) -> bool:
        """Whether the stop must be sent here again, or endless motion runs without a holder."""
        now = self._body.now
        if self._lease.is_attended(now):
            return False
        failed = self._lease.standing(now) is Standing.LOST and bool(self._posts[bus].failed)
        return failed or any(map(goes_on, self._axes(bus)))

    def _left(self, bus: str) -> float:
        """s until the next check."""
        now = self._body.now
        left = min(max(self._lease.until - now, 0.0) + 1e-6, IDLE)
        return min(left, max(self._posts[bus].again - now, 0.0) + 1e-6) if self._undone(bus) else left

    def _axes(self, bus: str) -> list[Any]:
        return [axis for axis in self._body.axes.values() if axis.spec.bus == bus]

    # -- what ----------------------------------------------------------------------------------------------------------

    async def _watch_along(self, bus: str) -> None:
        while True:
            if self._late(bus):
                await self._stopping(bus)
            await catch(Sleep(self._left(bus)))

    def _watch(self, bus: str) -> None:
        woken = self._posts[bus].woken
        while not self._over.is_set():
            woken.clear()
            left = RETRY_PERIOD
            try:
                if self._late(bus):
                    there = self._body.buses[bus]
                    run_here(there, self._stopping(bus))
                left = self._left(bus)
            except Exception as error:  # the bus cannot be used: try again later
                with suppress(Exception):  # this thread must not end
                    self._failed(bus, self._lease.losses, self._body.axes.keys(), error)
            woken.wait(0.0 if self._over.is_set() else left)

    async def _stopping(self, bus: str) -> None:
        """Stop the axes that must stop. Errors are kept and logged, not raised: the bus is checked again."""
        post, lost = self._posts[bus], self._lease.standing(self._body.now) is Standing.LOST or self.busy(bus)
        loss, axes = self._lease.losses, self._axes(bus)
        moving = {axis.name for axis in axes if moves(axis) or axis.name in post.failed}
        failed = {axis.name for axis in axes if axis.name in moving and axis.bus.latched}
        is_new = loss > post.loss
        again = () if is_new else post.failed
        try:
            errors = await (given_up(axes, again) if lost else stopped_going_on(axes))
        except MemoryError:  # an interrupt
            raise
        except Exception as error:  # the port is gone: try again later
            self._failed(bus, loss, moving if lost else (), error)
        else:
            self._note(axes, errors, is_new)
            post.take(loss, failed | errors.keys() if lost else (), self._body.now + RETRY_PERIOD)

    def _failed(self, bus: str, loss: int, names: Iterable[str], error: Exception) -> None:
        if loss > self._posts[bus].loss:
            LOG.warning("%s: the lease is lost, and no stop could be sent: %s", bus, error)
        self._posts[bus].take(loss, names, self._body.now + RETRY_PERIOD)

    def _note(self, axes: list[Any], errors: dict[str, MotorbusError], is_new: bool) -> None:
        """Keep the errors of these axes, and log what has changed."""
        for axis in axes:
            before = self.errors.pop(axis.name, None)
            error = errors.get(axis.name)
            if error is not None:
                self.errors[axis.name] = error
            if error is not None and (is_new or before is None):
                LOG.warning(
                    "%s: the lease is lost, and the axis may still move: %s", axis.name, error.summary
                )
            elif error is None and before is not None and not is_new:
                LOG.warning("%s: the axis has accepted the stop", axis.name)


class _Post:
    """State of one bus: number of the `loss` after which it was stopped, names of axes that `failed` to accept the
    stop, and the time (s) at which it is sent `again`."""

    def __init__(self, loss: int) -> None:
        self.loss = loss
        self.failed: frozenset[str] = frozenset()
        self.again = 0.0
        self.woken = Event()
        self.tree: Tree[None] | None = None  # in virtual time

    def take(self, loss: int, failed: Iterable[str], again: float) -> None:
        """The stop was sent."""
        self.loss, self.failed, self.again = loss, frozenset(failed), again
