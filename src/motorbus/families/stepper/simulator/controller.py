"""One simulated controller: what it does with a command, and what a test does to it.

It has no clock: the moment (s) is an argument, or that of the bus.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf
from typing import Final, NamedTuple

from motorbus.core.request import TimeoutClass
from motorbus.core.simulated import PoweredDevice
from motorbus.errors import RequestError
from motorbus.families.stepper.execution.machine import Machine, Phase
from motorbus.families.stepper.parameters import (
    HOME_INPUT,
    INPUTS,
    PARAMETERS,
    PROJECTS,
    Project,
    Step,
    checked_order,
    encode_image,
    values_of,
    with_steps,
)
from motorbus.families.stepper.protocol import MOTOR, Command, decode_request, edited, encode_reply
from motorbus.families.stepper.simulator.quirks import Quirks

STORE_TIME: Final = 0.03  # s that a save or a clear takes before its reply # assumption


EXAMPLE: Final = with_steps(
    Project(number=1, microsteps=8, step_angle=180, turn_distance=1),
    (Step(distance=1, direction=1, start_frequency=50, acceleration=30, speed=100, delay=1000),),
)
"""The values of the manual's examples."""


class Memory:
    """`stored` projects by number, one copy `working` that is edited, and the `selected` number.

    Commands that edit carry no project, and two of them are answered with one. So one project is selected:
    a save puts the edited copy into a slot. # assumption

    `selected_at_power_on` is 1. # assumption
    """

    def __init__(self, quirks: Quirks) -> None:
        self.quirks: Final = quirks
        self.order: Final = checked_order(quirks.dump_order)
        self.stored = dict.fromkeys(range(1, PROJECTS + 1), Project())
        if quirks.shipped == "example":
            self.stored[1] = EXAMPLE
        self.selected_at_power_on = 1
        self.power_on()

    def power_on(self) -> None:
        """What was not saved is lost."""
        self.selected = self.selected_at_power_on
        self.working = self.stored[self.selected]

    def project(self, number: int) -> Project:
        """What a start of this project runs: of the selected one its edits, assumption."""
        project = self.working if number == self.selected else self.stored[number]
        return replace(project, number=number)

    def image(self, number: int) -> bytes:
        """The 220 bytes that a read of this project shows."""
        is_edited = self.quirks.read_view == "working" and number == self.selected
        return encode_image(self.working if is_edited else self.stored[number], self.order)

    def edit(self, name: str, values: Mapping[str, int]) -> None:
        """Carry out a command that sets parameters."""
        if name == "select_project":
            self.selected = values["project"]
            if self.quirks.select == "load":
                self.working = self.stored[self.selected]
        self.working = edited(self.working, name, values)

    def put(self, number: int, project: Project) -> None:
        """Store a project; the edited copy of the selected one changes with it."""
        self.stored[number] = project
        if number == self.selected:
            self.working = project


class Storing(NamedTuple):
    """A save or a clear: this project is stored as `number` from `begun` to `end` (s)."""

    number: int
    project: Project
    begun: float
    end: float


class Controller(PoweredDevice):
    """A simulated controller. `store` is its memory, `machine` what it does.

    `position` counts from power-on or homing; `offset` is the place of its zero (pulses).
    """

    def __init__(self, quirks: Quirks) -> None:
        self.quirks: Final = quirks
        self.store: Final = Memory(quirks)
        self.machine: Final = Machine(tick_ms=quirks.ramp_tick_ms)
        self.now = 0.0
        self.offset = 0
        self.on_power_off: Callable[[], object] = list  # set by the bus
        self._storing: Storing | None = None
        self._crossing: tuple[object, bool, float] = (None, False, inf)
        self.power_on()

    # -- for tests and the control socket ----------------------------------------------------------------------------

    @property
    def memory(self) -> Mapping[str, int]:
        """The raw value of each row of the project that is edited."""
        return values_of(self.store.working)

    @property
    def position(self) -> int:
        """In pulses, forward positive; no host can read it."""
        return self.machine.position(self.now)

    def set_input(self, port: int, active: bool) -> None:
        """Set input 1 to 5; a home switch that is not free has input 5. Raises RequestError for another port."""
        if port not in range(1, INPUTS + 1):
            raise RequestError(f"there is no input {port}", expected=f"1 to {INPUTS}")
        if port != HOME_INPUT or self.quirks.home_switch == "free":
            self._set_input(port, active, self.now)

    def put(self, number: int, project: Project) -> None:
        """Store a project as if it had been written and saved."""
        self.store.put(number, replace(project, number=number))

    @property
    def notices(self) -> list[float]:
        """The times (s) of notices that the bus has not sent yet."""
        return self.machine.notices

    def notice(self) -> None:
        """Send a notice without a cause."""
        self.machine.notices.append(self.now)

    def midway(self) -> float:
        """When half of a save or a clear is done (s); inf if none runs."""
        return inf if self._storing is None else (self._storing.begun + self._storing.end) / 2

    def power_off(self) -> None:
        """Motion, outputs, edits and a save that runs are lost."""
        if self._storing is not None and self.quirks.save_cut == "empty":
            self.store.stored[self._storing.number] = Project()
        self._storing = None
        self.machine.power_off(self.now)
        self.on_power_off()

    def power_on(self) -> None:
        """At rest, or homing."""
        self.store.power_on()
        first = self.store.project(1)
        wired = {"wired": self._is_closed(self.now), "stuck": True, "never": False}
        if self.quirks.home_switch in wired:
            rest = self.machine.inputs - {HOME_INPUT}
            self.machine.inputs = rest | {HOME_INPUT} if wired[self.quirks.home_switch] else rest
        self.machine.power_on(self.now, home_with=first if first.power_on_home else None)

    def status(self) -> dict[str, object]:
        """Its state; position in pulses, load where it is from power-on, whatever was homed since."""
        machine, run = self.machine, self.machine.run
        return {
            "powered": self.plugged,
            "phase": machine.phase.value,
            "position": self.position,
            "load": self.position + self.offset,
            "frequency": machine.frequency(self.now),
            "homed": machine.is_homed,
            "project": run.project.number if run else None,
            "step": run.place.step if run else None,
            "pass": run.round if run else None,
            "outputs": [bool(machine.outputs >> bit & 1) for bit in range(3)],
            "leds": machine.leds,
            "inputs": sorted(machine.inputs),
            "selected": self.store.selected,
            "saving": self._storing.number if self._storing else None,
        }

    # -- time --------------------------------------------------------------------------------------------------------

    def due(self) -> float:
        """The next moment (s) at which something happens by itself; inf if none."""
        stored = inf if self._storing is None else self._storing.end
        return min(stored, self.machine.until, self._home_crossing())

    def advance(self, to: float) -> None:
        """Let time pass until this moment (s)."""
        while (moment := self.due()) <= to:
            self.now = max(self.now, moment)
            if self._storing is not None and self._storing.end <= moment:
                self.store.put(self._storing.number, self._storing.project)
                self._storing = None
            elif self._home_crossing() <= moment:
                self._set_input(HOME_INPUT, HOME_INPUT not in self.machine.inputs, moment)
            self.machine.advance(moment)
        self.now = max(self.now, to)
        self.machine.advance(self.now)

    # -- the home switch ---------------------------------------------------------------------------------------------

    def _is_closed(self, at: float) -> bool:
        return self.machine.position(at) + self.offset <= self.quirks.home_at

    def _home_crossing(self) -> float:
        """When the motion meets or leaves a wired home switch (s)."""
        motion, is_closed = self.machine.motion, HOME_INPUT in self.machine.inputs
        if self.quirks.home_switch != "wired" or motion is None or (motion.sign > 0) is not is_closed:
            return inf
        if self._crossing[0] is not motion or self._crossing[1] is not is_closed:
            start = self.machine.base + self.offset
            away = self.quirks.home_at + 1 - start if is_closed else start - self.quirks.home_at
            self._crossing = motion, is_closed, self.machine.since + motion.moment(away)
        return self._crossing[2]

    def _set_input(self, port: int, active: bool, at: float) -> None:
        self.machine.advance(at)
        place = self.machine.position(at)
        is_homing = self.machine.phase is Phase.HOMING
        start = self.store.project(self.store.selected)  # assumption: input 3 starts the selected project
        self.machine.set_input(port, active, at, start=start if self.plugged else None)
        if is_homing and self.machine.phase is not Phase.HOMING and port == HOME_INPUT:
            self.offset += place

    # -- requests ----------------------------------------------------------------------------------------------------

    def reply(self, request: bytes, at: float) -> tuple[bytes, float]:
        """Carry out a request with a correct checksum; the reply, and when it is ready (s). No reply: b""."""
        self.advance(at)
        ready = at + self.quirks.turnaround
        found = decode_request(request)
        if found is None or not self._accepts(request, *found):
            return b"", ready
        command, values = found
        number = values.get("project", 0)
        if command.reply_within is TimeoutClass.STORE:
            begun, ready = ready, ready + STORE_TIME
            is_save = command.name == "save_project"
            saved = replace(self.store.working, number=number) if is_save else Project()
            self._storing = Storing(number, saved, begun, ready)
        elif command.is_edit:
            self._edit(command, values)
        else:
            self._act(command.name, values, at)
        image = self.store.image(number) if command.name == "read_project" else b""
        level = int(values.get("port") in self.machine.inputs)
        return encode_reply(request, selected=self.store.selected, level=level, image=image), ready

    def _accepts(self, request: bytes, command: Command, values: Mapping[str, int]) -> bool:
        """Whether it replies: not to another motor, nor to a number out of range. # assumption"""
        is_own = command.code[0] != MOTOR or request[2] == self.quirks.motor
        rows = [(PARAMETERS[name], raw) for name, raw in values.items()]
        return is_own and all(row.low <= raw <= row.high for row, raw in rows)

    def _edit(self, command: Command, values: Mapping[str, int]) -> None:
        """Edit; a project that runs is not changed, except by a stop mode."""
        run = self.machine.run
        self.store.edit(command.name, values)
        if command.name == "set_stop_mode" and (run is None or run.project.number == self.store.selected):
            self.machine.stop_mode = values["stop_mode"]

    def _act(self, name: str, values: Mapping[str, int], at: float) -> None:
        machine, manual = self.machine, self.store.project(1)
        actions: dict[str, Callable[[], object]] = {
            "start_project": lambda: machine.start(self.store.project(values["project"]), at),
            "jog_forward": lambda: machine.jog(manual, 1, at),
            "jog_reverse": lambda: machine.jog(manual, -1, at),
            "run_once": lambda: machine.run_once(manual, at),
            "home": lambda: machine.home(manual, at),
            "stop_project": lambda: machine.stop_project(at),
            "stop_motor": lambda: machine.stop_motor(at),
            "set_output": lambda: machine.set_output(values["port"], values["level"], at),
        }
        if name in actions:
            actions[name]()
