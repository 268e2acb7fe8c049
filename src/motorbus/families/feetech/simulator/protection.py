"""When a servo protects itself: overload, over-current, heat, and what is left of its torque then.

Overload: more than register 36 (SCS: 39) for register 35 long (SCS: 38, in 40 ms and not 10 ms), and the torque falls
to register 34 (SCS: 37) percent. Over-current: more than register 28 for register 38 long. Heat: more than register 13.
Each sets its bit of the error byte; what the unload mask (19) does not name changes nothing else (STS3215 memory table
V3.6, SCS memory table 1902). A time or threshold of 0 is taken to switch the protection off; nobody has said so.

Since a movement is a function of time, so is what the motor does, and the moment of the next trip is worked out when
the movement begins. A servo that nothing burdens can trip over nothing, and costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import inf
from typing import Final

from motorbus.core.plant import Drive
from motorbus.families.feetech.simulator import thermal
from motorbus.families.feetech.simulator.effort import Load
from motorbus.families.feetech.simulator.memory import Memory
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import AMPERE

HEAT, CURRENT, OVERLOAD = 0x04, 0x08, 0x20
_SAME: Final = 1e-9
"""s within which two moments are one."""
_SOON: Final = 1e-6
"""s by which the moment at which a temperature is reached may be off."""
_CLOSE: Final = 1e-9
"""°C within which two temperatures are one."""
_NOTHING: Final = (Load(-inf, inf, 0.0, 0.0, 0.0, 0.0),)


class Watch:
    """A limit that must be exceeded for some time without a break; `since` is when that began, None when it is kept."""

    __slots__ = ("since",)

    def __init__(self) -> None:
        self.since: float | None = None

    def trips(self, spans: Iterable[tuple[float, float]], start: float, patience: float) -> float:
        """When it has lasted long enough, in these spans of excess from `start` on; infinity when it never does."""
        for begin, end in self._joined(spans, start):
            if begin + patience <= end:
                return max(start, begin + patience)
        return inf

    def pass_to(self, at: float, spans: Iterable[tuple[float, float]], start: float) -> None:
        """Remember at this moment whether it is exceeded, and since when."""
        joined = self._joined(spans, start)
        self.since = next((begin for begin, end in joined if begin <= at <= end + _SAME), None)

    def _joined(self, spans: Iterable[tuple[float, float]], start: float) -> Iterator[tuple[float, float]]:
        """Spans that touch as one; one that touches the start has begun when it began."""
        open_since, until = self.since, start
        for begin, end in spans:
            if open_since is not None and begin <= until + _SAME:
                until = end
                continue
            if open_since is not None and until > start:
                yield open_since, until
            open_since, until = begin, end
        if open_since is not None and until > start:
            yield open_since, until


def above(
    loads: Iterable[Load], value: Callable[[Load], tuple[float, float]], limit: float
) -> Iterator[tuple[float, float]]:
    """From when to when something is greater than `limit`, whatever its sign.

    `value` gives what it is at the beginning of a load and its change per s.
    """
    for load in loads:
        first, slope = value(load)
        if not slope:
            if abs(first) > limit:
                yield load.begin, load.end
            continue
        spans = []
        for sign in (-1.0, 1.0):
            crossing = load.begin + (sign * limit - first) / slope
            if sign * slope > 0:
                spans.append((max(load.begin, crossing), load.end))
            else:
                spans.append((load.begin, min(load.end, crossing)))
        yield from sorted(span for span in spans if span[0] < span[1])


class Protection:
    """What one servo has tripped over, how warm it is, and when the next of that will happen by itself.

    `error` has the alarm bits of that: overload and current are latched, heat lasts until it has cooled. `next` is the
    moment to call `fire` at.
    """

    __slots__ = (
        "__dict__",  # costs nothing until a test puts a method of its own in
        *("error", "next", "_memory", "_switches", "_ambient", "_degrees", "_start", "_loads", "_quiet"),
        *("_watches", "_has"),
    )

    def __init__(self, memory: Memory, switches: Switches) -> None:
        self.error = 0
        self.next = inf
        self._memory = memory
        self._switches = switches
        self._ambient = switches.ambient
        self._degrees = self._ambient
        self._start = 0.0
        self._loads: list[Load] = []
        self._quiet = True
        table = memory.layout.table
        self._watches = {OVERLOAD: Watch(), CURRENT: Watch()}
        self._has = {
            OVERLOAD: "overload_torque" in table,
            CURRENT: "overcurrent_time" in table and "protection_current" in table,
        }

    @property
    def left(self) -> float:
        """The share of the stall torque that it allows itself after an overload."""
        if self.error & OVERLOAD and self._memory["unload_mask"] & OVERLOAD:
            return self._number("protective_torque")
        return 1.0

    def temperature(self, at: float) -> float:
        """°C at this moment, which is no earlier than the last change."""
        degrees = self._degrees
        if self._quiet:
            return degrees
        for load in self._loads or _NOTHING:
            begin = max(load.begin, self._start)
            if begin >= at:
                break
            elapsed = max(0.0, min(load.end, at) - begin)
            degrees = thermal.after(elapsed, degrees, thermal.end(self._ambient, load.torque))
        return degrees

    def set_temperature(self, degrees: float, at: float) -> None:
        """It is so warm from now on, and cools or heats from there; the alarm follows at once."""
        self._roll(at)
        self._degrees = degrees
        self._quiet = False
        self._tell(HEAT, degrees > self._memory["max_temperature"])

    def forget(self) -> None:
        """Nothing has tripped: its controller starts anew. It does not get cooler by that."""
        self.error = 0
        self._keep_limits()

    def torque_off(self) -> None:
        """Torque was switched off, which may or may not end what is latched."""
        if self._switches.overload_clears == "torque_off":
            self.error &= HEAT

    def weigh(self, at: float) -> None:
        """Before the servo thinks again at this moment: is it too hot by what its registers say now?"""
        self._roll(at)
        limit = self._memory["max_temperature"]
        if self._degrees > limit:
            self._tell(HEAT, True)
        elif self.error & HEAT:
            self._tell(HEAT, self._degrees > limit - self._switches.cool_down + _CLOSE)

    def changed(self, at: float, loads: Iterable[Load] | None) -> None:
        """From this moment on the motor does this; None: nothing that heats it or that it could trip over."""
        self._roll(at)
        if loads is None and self._quiet and not self.error & HEAT:
            return  # it was so before
        self._loads = [] if loads is None else list(loads)
        if not self._loads:
            self._keep_limits()
        self._quiet = not (self._loads or self.error & HEAT or abs(self._degrees - self._ambient) > _CLOSE)
        if self._quiet:
            self._degrees, self.next = self._ambient, inf
        else:
            self.next = min(self._trip(OVERLOAD, at), self._trip(CURRENT, at), self._heat(at))

    def fire(self, at: float) -> None:
        """What was to happen at this moment happens; the servo has to think again about its torque afterwards."""
        self._roll(at)
        for bit in (OVERLOAD, CURRENT):
            if self._trip(bit, at) <= at + _SAME:
                self._tell(bit, True)
        if self._heat(at) <= at + _SOON:
            self._tell(HEAT, not self.error & HEAT)

    def lets_run(self, drive: Drive) -> bool:
        """Whether a motor that moves so without a burden could trip over nothing."""
        return not (
            self._has[CURRENT] and 0 < self._memory["protection_current"] < drive.idle_current / AMPERE
        )

    def _roll(self, at: float) -> None:
        """Bring everything that has a history to this moment."""
        if at <= self._start:
            return
        if not self._quiet:
            self._degrees = self.temperature(at)
            for bit, watch in self._watches.items():
                watch.pass_to(at, self._excess(bit), self._start)
        self._start = at

    def _trip(self, bit: int, at: float) -> float:
        if not self._has[bit] or self.error & bit:
            return inf
        patience = self._number("overload_time" if bit == OVERLOAD else "overcurrent_time")
        return self._watches[bit].trips(self._excess(bit), at, patience) if patience else inf

    def _excess(self, bit: int) -> list[tuple[float, float]]:
        """When the motor does more than it may for long."""
        if not self._has[bit]:
            return []
        limit = self._number("overload_torque" if bit == OVERLOAD else "protection_current")
        if not limit:
            return []
        loads = [load._replace(begin=max(load.begin, self._start)) for load in self._loads]
        if bit == CURRENT:
            return list(above(loads, lambda load: (load.current, 0.0), limit))
        return list(above(loads, lambda load: (load.torque, 0.0), limit))

    def _heat(self, at: float) -> float:
        """When it becomes too hot, or is no longer."""
        degrees, hot = self._degrees, self.error & HEAT
        limit = self._memory["max_temperature"] - (self._switches.cool_down if hot else 0.0)
        way = -1.0 if hot else 1.0
        for load in self._loads or _NOTHING:
            begin = max(load.begin, at)
            target = thermal.end(self._ambient, load.torque)
            if (target - limit) * way > 0:
                moment = begin + (
                    thermal.until(limit, degrees, target) if (limit - degrees) * way > 0 else 0.0
                )
                if moment < load.end:
                    return moment
            degrees = thermal.after(load.end - begin, degrees, target)
        return inf

    def _keep_limits(self) -> None:
        for watch in self._watches.values():
            watch.since = None

    def _tell(self, bit: int, yes: bool) -> None:
        self.error = self.error | bit if yes else self.error & ~bit

    def _number(self, name: str) -> float:
        """The value of a row in its unit."""
        return self._memory[name] * self._memory.layout.scales[name]
