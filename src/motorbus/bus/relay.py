"""Threads on one blocking bus: one pumps, the others wait and are woken, and whoever still waits takes over.

`pumper` is the thread that pumps. An interrupt may fall between any two lines here, so a thread that finds its own
number there has been interrupted, and `recover` gives back whatever it may still hold. A thread that works on several
buses cannot wait on the condition of one: it leaves a bell, which is rung whenever nobody pumps any more.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from threading import Condition, get_ident
from typing import Any

from motorbus.bus.crank import IDLE, crank, launch, push, take_in
from motorbus.bus.run import Run
from motorbus.bus.ticket import Flight
from motorbus.bus.turns import Turns
from motorbus.errors import LinkError
from motorbus.link.base import Link

SHORT = 0.001  # s; the shortest nap
NAP = 0.05  # s; a waiting thread looks at its own ticket at least this often


class Relay:
    """Who pumps, and who is told when something has changed."""

    def __init__(self, link: Link, turns: Turns, changed: Condition) -> None:
        self.link = link
        self.turns = turns
        self.changed = changed
        self.pumper: int | None = None
        self.bells: set[Callable[[], None]] = set()
        self._lock = turns.lock  # that of `changed`; taken by itself it costs less
        self._waiting: set[int] = set()  # the threads that may wait for it; one too many does no harm

    def start(self, *flights: Flight) -> None:
        """Send this exchange at once where the bus is idle, and take in what comes; queue it otherwise.

        Several leave together: none but the last is answered. What cannot leave so is left to whoever waits for it.
        """
        last = flights[-1]
        if self._launched(flights):
            take_in(self.link, self.turns, last.deadline)
            self.hand_over()
        last.wake = self.wake

    def _launched(self, flights: tuple[Flight, ...]) -> bool:
        """Have they left at once, and is an answer to be waited for here?"""
        with self._lock:
            if self.pumper is None and launch(self.link, self.turns, *flights):
                awaited = not flights[-1].done
                self.pumper = get_ident() if awaited else None
                return awaited
            if self.pumper is not None:
                self.turns.submit(flights[0], self.link.now())
            return False

    def turn(self) -> None:
        """Let time pass: pump, or wait for the thread that does."""
        own = get_ident()
        with self._lock:
            if self.pumper not in (None, own):
                take_in(self.link, self.turns, -inf)  # the one who pumps may wait for something far away
                push(self.link, self.turns)
                self._wait(own)
                return
            self.pumper = own
        try:
            if not asked_again(self.link, self.turns):
                crank(self.link, self.turns, inf)
        finally:
            self.hand_over()

    def _wait(self, own: int) -> None:
        self._waiting.add(own)
        try:
            self.changed.wait(min(NAP, max(self.turns.due() - self.link.now(), SHORT)))
        finally:
            self._waiting.discard(own)

    def claim(self) -> bool:
        """Become the one who pumps, unless another thread does."""
        with self.changed:
            if self.pumper not in (None, get_ident()):
                return False
            self.pumper = get_ident()
            return True

    def hand_over(self) -> None:
        """Pump no longer: whoever waits may."""
        with self._lock:
            self.pumper = None
            if self._waiting:
                self.changed.notify_all()
        if self.bells:
            for ring in tuple(self.bells):
                ring()

    def pass_on(self) -> None:
        """The same while something is on the straight way, which it stays on unless somebody waits for this.

        Whoever comes to wait later has taken the lock before, and so has made a usual flight of it.
        """
        self._lock.acquire()
        self.pumper = None
        self._lock.release()
        if self._waiting or self.bells:
            self.hand_over()

    def wake(self) -> None:
        """Something has been settled."""
        if self._waiting:
            with self._lock:
                self.changed.notify_all()

    def clean_up(self, run: Run[Any], caught: BaseException) -> None:
        """Let what was interrupted come to its end; one more interrupt meanwhile makes it hurry."""
        while True:
            try:
                self.recover()
                run.interrupt(caught)
                while not run.advance():
                    self.turn()
                return
            except BaseException as interruption:
                caught = interruption

    def recover(self) -> None:
        """After an interrupt: stop being the one that pumps, and let go of the lock as often as it is held."""
        if self.pumper == get_ident():
            self.pumper = None
        try:
            while True:
                self.changed.notify_all()
                self.turns.lock.release()
        except RuntimeError:  # not held (any more): the usual case
            pass


def asked_again(link: Link, turns: Turns) -> bool:
    """A turn of the crank, where a probe is all there is to do; False where it is not, and nothing has left."""
    try:
        with turns.lock:
            probe = turns.sole_probe(link)
            if probe is None:
                return False
            link.write(probe.exchange.request)
        looked = link.now()
        arrived = link.read(min(probe.deadline, looked + IDLE))
        if not arrived:  # a host that was held up looks once more before it calls a node silent
            looked = link.now()
            arrived = link.read(looked)
        with turns.lock:
            if arrived or not turns.is_unanswered(probe, looked):
                turns.feed(arrived, link.now(), looked)
    except LinkError as error:
        with turns.lock:
            turns.lost(error)
    return True
