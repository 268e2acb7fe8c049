"""What a characterisation knows by now: answers with what they rest on, doubts, and the controller it is about.

An answer that rests on something that did not come is kept apart until the end: one lost byte anywhere, and it is no
answer. That is decided here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.families.stepper.driver.characterising.experiments import Motor
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.turning import Watch
from motorbus.families.stepper.program.profile import KNOWN, Profile, Setting
from motorbus.families.stepper.table import Order, decode_image

UNTRIED: Final[Mapping[str, str]] = {
    "start_input": "only a hand on an input could tell",
    "stop_input": "only a hand on an input could tell",
    "stop_input_scope": "only a hand on an input could tell",
    "notice_on_in3": "only a hand on input 3 could tell",
    "home_stop": "only homing against its switch could tell",
    "output_zero": "no command reads an output",
    "outputs_on_stop": "no command reads an output",
    "jog_reverse_while_jogging": "no command tells which way the motor turns",
    "save_cross": "telling it would store over a project",
    "save_cut": "only a supply that goes while it saves could tell",
    "clear_notice": "no project is without steps, and none is cleared for it",
}
"""What no experiment here is made for, and why."""
_NOT_REACHED: Final = "the experiments did not get that far"


class Findings:
    """Answers, figures, and why there is none; `doubts` are what went wrong on the line."""

    def __init__(self) -> None:
        self.known: dict[str, Setting] = {}
        self.measured: dict[str, float] = {}
        self.doubts: list[str] = []
        self._why: dict[str, str] = {}
        self._silent: set[str] = set()
        self._open: dict[str, str] = {}

    def settle(self, name: str, value: Setting, why: str, *, silent: bool = False) -> None:
        """This is the reading; `silent` says that it rests on something which did not come."""
        self.known[name] = value
        self._why[name] = why
        self._open.pop(name, None)
        if silent:
            self._silent.add(name)

    def leave(self, name: str, why: str) -> None:
        """There is no answer, unless there is one already; of several reasons the first is kept."""
        if name not in self.known:
            self._open.setdefault(name, why)

    def doubt(self, what: str) -> None:
        """Something was not as it should be on a good line."""
        if what not in self.doubts:
            self.doubts.append(what)

    @property
    def firm(self) -> dict[str, Setting]:
        """The answers that do not rest on something that did not come."""
        return {name: value for name, value in self.known.items() if name not in self._silent}

    def profile(self) -> Profile:
        """What is left of it now."""
        lost = {
            name: f"it rests on something that did not come ({self._why[name]}), and on this line {self.doubts[0]}"
            for name in self._silent
            if self.doubts
        }
        settled = {name: self.known[name] for name in KNOWN if name in self.known and name not in lost}
        return Profile(
            settled=settled,
            evidence={name: self._why[name] for name in settled},
            measured=dict(self.measured),
            open={
                name: lost.get(name) or self._open.get(name) or UNTRIED.get(name, _NOT_REACHED)
                for name in KNOWN
                if name not in settled
            },
        )


class Case:
    """The controller that is studied: what it has stored, which project is lent, and what is known of it.

    `motor_of` is the project that tells of its motor, `travel` how many turns each way it may turn, and `returned` says
    that what is edited is a stored project again.
    """

    def __init__(
        self, node: Node, scratch: int, travel: float, stored: Mapping[int, bytes], motor_of: int
    ) -> None:
        self.scratch: Final = scratch
        self.travel: Final = travel
        self.stored: Final = stored
        self.found: Final = Findings()
        self._motor_of = motor_of
        self.node = node
        self.motor = self._motor()
        self.watch: Final = Watch(node)
        self.returned = False

    def _motor(self) -> Motor:
        return Motor.of(decode_image(self.stored[self._motor_of], self.node.order))

    def reads(self, order: Order) -> None:
        """Its dumps have this byte of a number first. Raises RequestError when no motor is told then."""
        if order != self.node.order:
            self.node = Node(self.node.node, self.node.motor, order, self.node.memory)
            self.motor = self._motor()

    @property
    def seen(self) -> bool:
        """Whether reading it shows what is edited, as far as is known."""
        return self.found.known.get("read_view") == "working"

    @property
    def other(self) -> int:
        """A project that is not lent: one with steps when there is one."""
        numbers = [number for number in self.stored if number != self.scratch]
        filled = [number for number in numbers if self.stored[number][1]]
        return (filled or numbers)[0]
