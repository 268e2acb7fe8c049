"""The line with its one controller: who hears when, what is done in which order, and what is said at which moment.

Everything that will happen lies in one queue of moments: requests that wait until the last one is done, bounces of a
contact, the end of a save. Beside it stand the machine, which knows when it will do something by itself, and the line.
Whoever advances the bus walks through all three in order, however long that takes at once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import partial
from heapq import heapify, heappop, heappush
from itertools import count
from math import inf
from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.stepper.simulator import sight as seen
from motorbus.families.stepper.simulator.controller import Controller, Said
from motorbus.families.stepper.simulator.ear import Ear
from motorbus.families.stepper.simulator.harm import Harm
from motorbus.families.stepper.simulator.inputs import Change, parse
from motorbus.families.stepper.simulator.line import Line
from motorbus.families.stepper.simulator.switches import Switches
from motorbus.families.stepper.table import BLANK, INPUTS, RATE

QUEUE: Final = 16
"""Requests that may wait; an assumption, no source tells the size of its receive buffer."""


class Task(NamedTuple):
    """Something to be done at a moment. What comes from `outside`, as a hand on a button, needs no supply."""

    at: float
    order: int
    act: Callable[[float], None]
    outside: bool


class StepperBus:
    """A `motorbus.core.family.Simulator` of one controller; `now` is the latest moment it was told (s)."""

    def __init__(self, node: int, switches: Switches) -> None:
        self.switches = switches
        self.now = 0.0
        self._began: float | None = None
        self._hears = True
        self._tasks: list[Task] = []
        self._order = count()
        self._ear = Ear(switches.rx_gap_ms / 1000)
        self._harm = Harm(switches, self._note)
        self._line = Line(switches, self._harm)
        self._busy_until = -inf
        self._waiting = 0
        self.storing: int | None = None
        self._half_stored_at = inf
        self.controller = Controller(switches, self)
        self._nodes = {node: self.controller}

    @property
    def nodes(self) -> Mapping[int, Controller]:
        """The controller, by the number it is asked for."""
        return self._nodes

    def tune(self, rate: int) -> None:
        """The host's rate in baud; the controller has 9600 and no other. 0: whichever it has."""
        heard, self._hears = self._hears, rate in (0, RATE)
        if heard and not self._hears:
            self._note(f"the host is at {rate} bit/s and this at {RATE}: neither hears the other")

    def receive(self, data: Data, at: float) -> None:
        """Bytes of the host; a CAN frame is for another bus."""
        self._wake(at)
        self._run_until(at)
        if isinstance(data, CanFrame) or not self._hears:
            return
        self._line.echo(data, self.now)
        if self.controller.powered:
            self._hear(self._harm.misheard(data))
            self._run_until(self.now)

    def _hear(self, data: bytes) -> None:
        if self.switches.deaf_while_moving and self.controller.moving:
            self._note(f"fault: it moves and does not hear {len(data)} bytes")
            return
        heard = self._ear.feed(data, self.now)
        if heard.bad:
            self._note(f"{heard.bad} wrong checksum(s)")
        for request in heard.requests:
            if self._harm.unheard(request):
                continue
            if self._waiting >= QUEUE:
                self._note(f"{QUEUE} requests wait already: {request.hex(' ').upper()} is forgotten")
                continue
            self._waiting += 1
            self._later(self.now, partial(self._obey, request))

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Everything that begins up to this moment, in order; to a host at another rate, nothing that it knows."""
        self._wake(to)
        said: list[tuple[float, Data]] = []
        while (moment := self._next()) <= to:
            self._run_until(moment)
            said += self._line.speak(moment)
        self._run_until(to)
        return said if self._hears else []

    def due(self) -> float | None:
        """When something happens next by itself, or None; before its first moment nobody knows when that will be."""
        moment = inf if self._began is None else self._next()
        return None if moment == inf else moment

    @property
    def owes(self) -> bool:
        """A request waits to be carried out, or a reply to be sent."""
        return self._waiting > 0 or self._line.due() < inf

    obeys_at_once = False

    def sight(self, at: float) -> Iterable[tuple[int, tuple[Hashable, ...]]]:
        """What the controller holds, after all that has happened by this moment."""
        self._run_until(at)
        return [(node, seen.sight(controller)) for node, controller in self._nodes.items()]

    def shown(self, picture: tuple[Hashable, ...], name: str) -> int | bytes:
        """What a picture of it has under this name, see `sight`."""
        return seen.shown(picture, name)

    def press(self, port: int, active: bool, at: float) -> None:
        """Let an input change at a moment to come; until the bus has been used, counted from when it will be.

        It bounces as its switch says. Raises RequestError for an input that is none.
        """
        if not 1 <= port <= INPUTS:
            raise RequestError(f"there is no input {port}", expected=f"1 to {INPUTS}")
        moment, pause = at, self.switches.bounce_ms / 1000
        for _ in range(self.switches.bounce if active else 0):
            self._later(moment, partial(self._press, port, True), outside=True)
            self._later(moment + pause, partial(self._press, port, False), outside=True)
            moment += 2 * pause
        self._later(moment, partial(self._press, port, active), outside=True)

    def script(self, changes: str | Iterable[Change]) -> None:
        """Let inputs change as a script says, see `inputs.parse`. Raises RequestError, naming the line."""
        for change in parse(changes) if isinstance(changes, str) else changes:
            self.press(change.port, change.active, change.at)

    # -- what the controller asks of its surroundings -----------------------------------------------------------------

    @property
    def age(self) -> float:
        """Seconds since the first moment it was told."""
        return 0.0 if self._began is None else self.now - self._began

    def midway(self) -> float:
        """When what is being stored is half written; infinity while nothing is."""
        return inf if self.storing is None else self._half_stored_at

    def behave(self, switches: Switches, *, reseed: bool) -> None:
        """From now on as these say; with `reseed` chance begins afresh."""
        self.switches = switches
        self._harm.change(switches, reseed=reseed)
        self._line.change(switches)
        self.controller.rewire(self.now)
        self.settle()

    def notice(self) -> None:
        """Say that a project has ended, though none has."""
        self._later(self.now, self._line.spurious)

    def settle(self) -> None:
        """Do what is to be done by now."""
        self._run_until(self.now)

    def cut_off(self) -> None:
        """The supply goes: what waits is lost, a save that has begun is cut, what was to be said is not."""
        if self.storing is not None:
            self._note(f"the supply has cut the saving of project {self.storing}")
            if self.switches.save_cut == "empty":
                self.controller.store.stored[self.storing] = BLANK
        self.storing = None
        self._tasks = [task for task in self._tasks if task.outside]
        heapify(self._tasks)
        self._waiting = 0
        self._busy_until = -inf
        self._ear.forget()
        self._line.hush()

    # -- the course of events -------------------------------------------------------------------------------------

    def _wake(self, at: float) -> None:
        """The first moment it is told is that of power-on, for a clock may begin anywhere; scripts begin then."""
        if self._began is None:
            self._began = self.now = at
            self._tasks = [task._replace(at=task.at + at) for task in self._tasks]
            self.controller.power_up(at)

    def _next(self) -> float:
        queued = self._tasks[0].at if self._tasks else inf
        return min(queued, self.controller.due(), self._line.due())

    def _later(self, at: float, act: Callable[[float], None], *, outside: bool = False) -> None:
        heappush(self._tasks, Task(at, next(self._order), act, outside))

    def _run_until(self, to: float) -> None:
        """Do all that is to be done up to this moment, in order; what is said meanwhile waits on the line."""
        while True:
            queued = self._tasks[0].at if self._tasks else inf
            own = self.controller.due()
            if min(queued, own) > to:
                break
            self.now = max(self.now, min(queued, own))
            if own <= queued:
                self.controller.advance(self.now)
            else:
                heappop(self._tasks).act(self.now)
            self._tell_ends()
        self.now = max(self.now, to)
        self._tell_ends()

    def _tell_ends(self) -> None:
        for moment in self.controller.notices():
            self._line.notice(moment)

    def _obey(self, request: bytes, at: float) -> None:
        if at < self._busy_until:
            self._later(self._busy_until, partial(self._obey, request))
            return
        self._waiting -= 1
        said = self.controller.obey(request, at)
        ready = at + self.switches.turnaround
        if said.store is not None:
            ready += self.switches.save_time
            self.storing = said.reply[3]
            self._half_stored_at = ready - self.switches.save_time / 2
            self._later(ready, partial(self._stored, said))
        if said.reply:
            self._busy_until = ready
            self._line.reply(said.reply, ready)
        for moment in self.controller.notices():  # of a project that ends at once: the reply comes first
            self._line.notice(max(moment, ready))

    def _stored(self, said: Said, at: float) -> None:
        self.storing = None
        if said.store is not None:
            said.store()

    def _note(self, text: str) -> None:
        self.controller.remark(text)

    def _press(self, port: int, active: bool, at: float) -> None:
        self.controller.input(port, active, at)
