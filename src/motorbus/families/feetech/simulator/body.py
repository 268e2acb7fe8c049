"""A servo as a thing in the world: what pushes it, blocks it, heats it and feeds it, and what it then does by itself.

The registers say where the shaft ought to go; `effort.py` says how far the world lets it, `protection.py` what it
trips over. Here a test pokes at all of that, and here is what is called when the moment of such an event has come
(`fate.py`, and `supply.py` for the supply that several servos share). `servo.py` builds the rest of the servo upon it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import inf
from typing import Final

from motorbus.core.plant import Drive, Motion, rest
from motorbus.families.feetech.simulator.effort import Load, World, carried_out, loads
from motorbus.families.feetech.simulator.flash import Flash
from motorbus.families.feetech.simulator.memory import Layout, Memory
from motorbus.families.feetech.simulator.model import Model
from motorbus.families.feetech.simulator.motor import Settings
from motorbus.families.feetech.simulator.protection import OVERLOAD, Protection
from motorbus.families.feetech.simulator.switches import Switches

_NOTHING: Final = World()


class Body(ABC):
    """What a servo is apart from what it is told.

    `motion`      the movement of its shaft in counts, on the bus's clock; `motion.start` says since when
    `push`        the share of its stall torque that it gives in the end because it does not get its way; None: it does
    `protection`  what it has tripped over
    `threshold`   the supply below which it starts anew, in V; 0: none
    """

    __slots__ = (
        "__dict__",  # costs nothing until a test puts a method of its own in
        *("model", "switches", "memory", "motion", "push", "plugged", "threshold", "protection", "_now"),
        *(
            "_voltage",
            "_told_voltage",
            "_world",
            "_given",
            "_again",
            "_cut_at",
            "_cut_after",
            "_expect",
            "_sag",
        ),
    )

    def __init__(
        self, model: Model, layout: Layout, switches: Switches, now: Callable[[], float], position: float
    ) -> None:
        flash = Flash(layout.factory, clock=now, time=switches.store_time, torn=switches.torn)
        self.model = model
        self.switches = switches
        self.memory = Memory(layout, flash)
        self.motion = rest(now(), position)
        self.push: float | None = None
        self.plugged = True
        self.threshold = 0.0
        self._now = now
        self._voltage = model.voltage
        self._told_voltage = round(model.voltage * 10)
        self._world = _NOTHING
        self._given = 0.0
        self._again = self._cut_at = self._cut_after = inf
        self._expect: Callable[[float], None] | None = None
        self._sag: Callable[[float], float] | None = None
        self.protection = Protection(self.memory, switches)

    # What a test does to it.

    @property
    def torque(self) -> float:
        """What the outside takes of its stall torque, -1 to 1: positive pushes towards smaller counts."""
        return self._world.torque

    @torque.setter
    def torque(self, share: float) -> None:
        self._world = self._world._replace(torque=share)
        self.move(self._now())

    @property
    def blocked(self) -> tuple[float, float] | None:
        """The counts between which its shaft can turn, as `motion` counts them; None: it is free."""
        return self._world.blocked

    @blocked.setter
    def blocked(self, between: tuple[float, float] | None) -> None:
        self._world = self._world._replace(blocked=between)
        self.move(self._now())

    @property
    def voltage(self) -> float:
        """What its supply is at this moment, in V; outside registers 15 to 14 it raises the voltage alarm."""
        return self._voltage - self._sag(self._now()) if self._sag else self._voltage

    @voltage.setter
    def voltage(self, volts: float) -> None:
        """Set what it is when nobody draws a current."""
        self._voltage, self._told_voltage = volts, round(volts * 10)
        self.move(self._now())

    @property
    def open_voltage(self) -> float:
        """Its supply when nobody draws a current, in V."""
        return self._voltage

    @property
    def temperature(self) -> float:
        """How warm it is, in °C; above register 13 it raises the temperature alarm."""
        return self.protection.temperature(self._now())

    @temperature.setter
    def temperature(self, degrees: float) -> None:
        """Warm or cool it; from there it goes its own way."""
        self.protection.set_temperature(degrees, self._now())
        self.move(self._now())

    @property
    def tripped(self) -> bool:
        """Whether the overload protection has tripped."""
        return bool(self.protection.error & OVERLOAD)

    @property
    def led(self) -> bool:
        """Whether its lamp tells an alarm: one that the LED mask (20) names."""
        return bool(self.error & self.memory["led_mask"])

    def cut(self, commits: float) -> None:
        """Let its supply fail for a moment when so many more EEPROM cells are committed: 0 before the first, 2.5 in
        the middle of the third, which is torn then. It happens once."""
        self._cut_after = self.memory.flash.done + commits
        self.stores()

    # What the rest of the servo tells.

    @property
    @abstractmethod
    def error(self) -> int:
        """Its alarm bits."""

    @abstractmethod
    def power_cycle(self) -> None:
        """Take its supply away and give it back."""

    @abstractmethod
    def move(self, at: float) -> None:
        """Think again about where to go."""

    def stores(self) -> None:
        """Something has been given to the EEPROM."""
        if self._cut_after < inf:
            self._cut_at = self.memory.flash.moment_of(self._cut_after)
            self._tell()

    def storing(self, at: float) -> float:
        """How much later (s) it acknowledges anything because its EEPROM is at work."""
        if not self.memory.flash.works or self.switches.eeprom_commit == "after_ack":
            return 0.0
        return max(0.0, self.memory.flash.busy_until - at)

    def stands(self, at: float) -> None:
        """Its shaft was turned by hand, or its supply is gone: what it did is over."""
        self._carry(self.motion, None, inf, at)

    def go_freely(self, planned: Motion, torque: float, at: float) -> None:
        """Do from this moment on as planned, with this torque: nothing from outside is in the way."""
        self._given = torque
        self._carry(planned, None, inf, at)

    @property
    def free(self) -> bool:
        """Whether nothing from outside burdens or blocks it."""
        return self._world == _NOTHING

    def bear(self, plan: Callable[[Drive], Motion], wanted: Settings, at: float) -> None:
        """Do from this moment on what becomes of a plan; both are in the direction of the shaft."""
        self._given = wanted.torque
        carried = carried_out(plan, wanted, self._world, at, self.model.drive, self.switches)
        self._carry(carried.motion, carried.push, carried.again, at)

    # What happens to it by itself.

    @property
    def next(self) -> float:
        """When that happens next; infinity when nothing will."""
        soon = self.protection.next
        if self._again < soon:
            soon = self._again
        return self._cut_at if self._cut_at < soon else soon

    def join(self, expect: Callable[[float], None], sag: Callable[[float], float] | None) -> None:
        """From now on `expect` is told its next moment whenever that may be another one.

        `sag` gives by how many V its supply is lower at a moment than without current; None: it never is.
        """
        self._expect, self._sag = expect, sag
        self._tell()

    def live(self, at: float) -> None:
        """Its next moment has come."""
        if self._cut_at <= at:
            self._cut_at = self._cut_after = inf
            self.power_cycle()
            return
        if self.protection.next <= at:
            self.protection.fire(at)
        self.move(at)

    def duty(self, at: float) -> float:
        """The share of its supply that the motor gets at this moment, signed as the movement: FEETECH calls it load."""
        if not self._given:
            return 0.0  # limp, even when it is turned by hand
        if self.push is None and not self._world.torque:
            return self.model.drive.duty(self.motion.velocity(at))
        load = self._load(at)
        return max(-1.0, min(1.0, load.duty + load.slope * (max(at, load.begin) - load.begin)))

    def current(self, at: float) -> float:
        """A that it takes at this moment, signed as the effort."""
        if not self._given:
            return 0.0
        if self.push is None and not self._world.torque:
            return self.model.drive.current(self.motion.velocity(at))
        return self._load(at).current

    def turning_points(self, since: float) -> list[float]:
        """Later moments at which its current changes."""
        found = loads(self.motion, self.push, self._world, self._given, self.model.drive, since)
        return [load.begin for load in found if load.begin > since]

    def fed(self, at: float) -> bool:
        """Whether its supply suffices at this moment."""
        return self._sag is None or self._voltage - self._sag(at) >= self.threshold

    def _load(self, at: float) -> Load:
        return next(loads(self.motion, self.push, self._world, self._given, self.model.drive, at))

    def _carry(self, motion: Motion, push: float | None, again: float, at: float) -> None:
        self.motion, self.push, self._again = motion, push, again
        world, drive, calm = self._world, self.model.drive, False
        if push is None and not (world.torque and self._given):
            calm = (
                not self._given
                or (not motion.phases and not motion.cruise)
                or self.protection.lets_run(drive)
            )
        self.protection.changed(at, None if calm else loads(motion, push, world, self._given, drive, at))
        self._tell()

    def _tell(self) -> None:
        if self._expect:
            self._expect(self.next)
