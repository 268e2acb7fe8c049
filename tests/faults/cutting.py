"""Cuts a call at its nth executed line of the product's own code, and says what state it left the bus in.

A line counts where it belongs to the bus, a link, a family's driver, the gate or the core: everything between the
caller and the wire. What is at work inside the simulated wire does not, for there the world is, and not the program.
"""

from __future__ import annotations

import gc
import re
import sys
from collections import Counter
from collections.abc import Callable
from dis import opmap
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import motorbus
from motorbus.errors import MotorbusError
from tests.faults.scenes import Scene

PACKAGE = Path(motorbus.__file__).parent
FLOORS = ("bus", "core", "families", "link", "motion")
WORLD = str(PACKAGE / "link" / "memory.py")
NEVER = 1 << 60
LEFT = (
    "the lock",
    "a holder",
    "a claim",
    "something queued",
    "a timer",
    "a stop under way",
    "somebody who pumps",
)
"""What may be left on a bus of a call that is over."""
TAKING_UP = [opmap[name] for name in ("PUSH_EXC_INFO", "CLEANUP_THROW") if name in opmap]
UNSENT = re.compile("nothing was sent(?! to stop)")

_ours: dict[str, bool] = {}


def ours(file: str) -> bool:
    """Whether this file is the product's, between the caller and the wire."""
    found = _ours.get(file)
    if found is None:
        path = Path(file)
        found = path.is_relative_to(PACKAGE) and path.relative_to(PACKAGE).parts[0] in FLOORS
        _ours[file] = found
    return found


def leaving(frame: FrameType) -> bool:
    """Whether a `with` is about to be left: nothing can fall there but what a tracer throws.

    No signal is looked at, and nothing is allocated, between its body and its end. An interruption there would be made
    good as any other; an error that is dealt with on its way up would leave the lock behind.
    """
    code = frame.f_code.co_code[frame.f_lasti : frame.f_lasti + 6 : 2]
    return set(code) == {opmap["LOAD_CONST"]}


def putting_away(frame: FrameType) -> bool:
    """Whether an error is about to be taken up by a `with`, `except` or `await`, or to be put away by it.

    No signal is looked at there either; and what a tracer throws there leaves that error behind for good as the one
    that is dealt with, and with it every bus and thread of its frames, or takes its place.
    """
    now, *later = frame.f_code.co_code[frame.f_lasti : frame.f_lasti + 4 : 2]
    return now in TAKING_UP or opmap["POP_EXCEPT"] in later


def returning(frame: FrameType) -> bool:
    """Whether nothing is left but to return a constant: no signal is looked at there, nor is it within a `try`.

    One that comes with the end of a call falls behind it, in the line of the call: that is cut before it only.
    """
    rest = [*frame.f_code.co_code[frame.f_lasti : frame.f_lasti + 4 : 2]]
    return rest[0] == opmap.get("RETURN_CONST") or rest == [opmap["LOAD_CONST"], opmap["RETURN_VALUE"]]


class Scissors:
    """Raises this before the nth executed line, and `later` lines on once more.

    `where` is the first of the two and `second` the other, None when there were fewer lines.
    """

    gives_back = True
    """Whether those who deal with it give back what a `with` that was being left has kept."""

    def __init__(self, at: int, error: type[BaseException], later: int = 0) -> None:
        self.at = at
        self.again = at + later
        self.error = error
        self.count = 0
        self.where: str | None = None
        self.second: str | None = None
        self.walked: list[tuple[object, int]] = []
        self._outside: FrameType | None = None

    def __call__(self, frame: FrameType, event: str, argument: object) -> Any:
        file = frame.f_code.co_filename
        if self._outside is not None or not ours(file):
            return None
        if file == WORLD:
            self._outside = frame
            frame.f_trace_lines = False
            return self._world
        return self._line

    def _world(self, frame: FrameType, event: str, argument: object) -> Any:
        if event == "return" and frame is self._outside:
            self._outside = None
        return self._world

    def _line(self, frame: FrameType, event: str, argument: object) -> Any:
        if event == "line" and not (
            putting_away(frame)
            or returning(frame)
            or (leaving(frame) and (self.error is MemoryError or not self.gives_back))
        ):
            self.count += 1
            if self.at == NEVER:
                self.walked.append((frame.f_code, frame.f_lineno))
            elif self.count in (self.at, self.again):
                name = Path(frame.f_code.co_filename).relative_to(PACKAGE)
                place = f"{name}:{frame.f_lineno} in {frame.f_code.co_name}"
                if self.where is None:
                    self.where = place
                else:
                    self.second = place
                self._struck()
                raise self.error
        return self._line

    def _struck(self) -> None:
        """It is about to be raised."""


class Twice(Scissors):
    """Strikes a second time for sure: a tracer that raises is put away, and this one is taken up again."""

    def _struck(self) -> None:
        if self.count < self.again:
            sys.setprofile(self._on)

    def _on(self, frame: FrameType, event: str, argument: object) -> None:
        """At the next call or return: all who are at work are watched from here on."""
        sys.setprofile(None)
        there: FrameType | None = frame
        while there is not None:
            if ours(there.f_code.co_filename) and there.f_code.co_filename != WORLD:
                there.f_trace = self._line
            there = there.f_back
        sys.settrace(self)


class Outcome(NamedTuple):
    """What came of a call that was cut: its value, or what it raised; where it was cut, or all lines if it was not.

    `again` is where it was cut a second time.
    """

    value: Any
    error: BaseException | None
    where: str | None
    walked: list[tuple[object, int]]
    again: str | None = None


def cut(
    act: Callable[[], Any],
    at: int = NEVER,
    error: type[BaseException] = KeyboardInterrupt,
    later: int = 0,
    scissors: type[Scissors] = Scissors,
) -> Outcome:
    """Do it, cut at this line, and so many lines later once more; for sure where the `scissors` are `Twice`."""
    tracer, before, dealt_with = scissors(at, error, later), sys.gettrace(), sys.exception()
    value, raised = None, None
    gc.disable()  # what an earlier call has left behind is no line of this one
    sys.settrace(tracer)
    try:
        value = act()
    except BaseException as caught:
        raised = caught
    finally:
        sys.setprofile(None)
        sys.settrace(before)
        gc.enable()
    assert sys.exception() is dealt_with, (
        f"cut at {tracer.where} and {tracer.second}, an error was left behind"
    )
    return Outcome(value, raised, tracer.where, tracer.walked, tracer.second)


def places(walked: list[tuple[object, int]], visits: int, most: int) -> list[int]:
    """Where to cut: every line, at the first so many visits of it; at most so many places, evenly spread."""
    seen: Counter[tuple[object, int]] = Counter()
    found = []
    for number, line in enumerate(walked, 1):
        seen[line] += 1
        if seen[line] <= visits:
            found.append(number)
    return found[:: -(-len(found) // most)] if len(found) > most else found


def laters(number: int) -> tuple[int, ...]:
    """How many lines after this many-th first interrupt the second ones fall: at once, soon, and much later."""
    return 1 + number % 6, 1 + number * 7 % 23, 1 + number * 37 % 400


def told(error: BaseException | None) -> str:
    """Everything an error says."""
    return "\n".join([str(error), *getattr(error, "__notes__", ())])


def left_behind(there: Scene) -> list[str]:
    """What of a call that is over is still on the bus."""
    turns = there.bus.turns
    found = (
        turns.lock._is_owned(),
        turns._claims.held,
        turns._claims.waiting,
        turns.waiting,
        turns._timers,
        turns.stopping,
        getattr(getattr(there.bus, "relay", None), "pumper", None) is not None,
    )
    return [what for what, is_there in zip(LEFT, found, strict=True) if is_there]


def stuck(faults: list[str]) -> int:
    """How many of what is wrong is something that was left behind."""
    return sum(fault.startswith(LEFT) for fault in faults)


def reads_right(there: Scene, read: Callable[[], Any]) -> tuple[bool, list[str]]:
    """One read: whether it succeeded, and what was wrong with it."""
    there.stir()
    try:
        value = read()
    except MotorbusError:
        return False, []
    return True, [] if there.true(value) else [f"a wrong value: {value!r}"]


def afterwards(there: Scene, run: Callable[[Any], Any]) -> list[str]:
    """What is wrong with the bus: it must be right at the second read at the latest, and a stop must go out."""
    wrong = left_behind(there)
    if "a stop under way" in wrong or "the lock" in wrong:
        return wrong
    _, faults = reads_right(there, lambda: run(there.asked()))
    good, more = reads_right(there, lambda: run(there.asked()))
    wrong += faults + more + ([] if good else ["the second read failed"])
    before = len(there.wire.sent)
    outcome = there.bus.estop()
    if there.ids[0] not in outcome.acknowledged or len(there.wire.sent) == before:
        wrong.append(f"the stop did not go out: {outcome}")
    there.bus.reset()
    return wrong + left_behind(there)
