"""One simulated controller: what it does with a command, and what a test or a control socket does to it.

It keeps no time of its own: the bus says the moment. What it says at which moment, and what the line makes of it, is
the bus's affair; here a command has an answer or none, and a project has an end or none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple, Protocol

from motorbus.core.family import Remark
from motorbus.core.switches import switched
from motorbus.errors import RequestError
from motorbus.families.stepper import execution, wire
from motorbus.families.stepper.execution import Behaviour, Happening, Next, Phase, State
from motorbus.families.stepper.simulator.memory import Memory, Rows
from motorbus.families.stepper.simulator.switches import CHANGEABLE, Switches
from motorbus.families.stepper.simulator.travel import Travel
from motorbus.families.stepper.table import EDITS, HOME_INPUT, PROJECTS, Project, is_allowed

_WHICH: Final = frozenset({"project", "step", "port"})
"""Numbers that say of what; of what there is not, nothing can be acknowledged."""
LOG: Final = 1000
"""Remarks that are kept; the oldest go first."""
TOLD: Final = 10_000
"""Happenings that are kept, likewise: an endless project has no end of them."""


class Said(NamedTuple):
    """What comes of a request: the reply, none when it is empty, and what is stored when the reply is ready."""

    reply: bytes = b""
    store: Callable[[], None] | None = None


SILENCE: Final = Said()


class Surroundings(Protocol):
    """What is around a controller: a clock, hands on its buttons, and its line."""

    now: float
    storing: int | None
    """The project that is being saved or cleared."""

    @property
    def age(self) -> float:
        """Seconds since the simulation began."""

    def midway(self) -> float:
        """When that is half done; infinity while nothing is saved or cleared."""

    def behave(self, switches: Switches, *, reseed: bool) -> None:
        """From now on as these say; with `reseed` chance begins afresh. The controller is told to `rewire`."""

    def notice(self) -> None:
        """Say that a project has ended, though none has."""

    def press(self, port: int, active: bool, at: float) -> None:
        """Let an input change at this moment, with its bounces."""

    def settle(self) -> None:
        """Do what is to be done by now."""

    def cut_off(self) -> None:
        """The supply goes: what is under way on the line is lost."""


class Controller:
    """A controller as a test pokes it.

    `state`    what it is doing, a value of `execution`
    `store`    what it remembers; `memory` is the same by the names of the rows
    `travel`   where its load is, which it does not know
    `told`     what happened lately
    `log`      the latest remarks on what a host should know and is not told, and on what faults have done
    `powered`  whether the supply is there and the cable in
    """

    def __init__(self, switches: Switches, around: Surroundings) -> None:
        self.switches = switches
        self.store = Memory(switches)
        self.told: list[Happening] = []
        self.log: list[Remark] = []
        self.powered = True
        self._remarks = 0
        self._ends: list[float] = []
        self._around = around
        self.travel = Travel(switches)
        self._inputs: frozenset[int] = frozenset()
        self.state: State = execution.power_on(0.0, self.how).state
        self.power_up(0.0)

    @property
    def how(self) -> Behaviour:
        """How it carries projects out."""
        return self.switches

    # -- what a test or a control socket does to it ------------------------------------------------------------

    @property
    def memory(self) -> Mapping[str, int]:
        """The raw value of every row of the project that is being edited."""
        return Rows(self.store)

    @property
    def position(self) -> int:
        """Where the motor is now, in pulses, forward positive; no host can ask."""
        return self.state.position(self._around.now)

    @property
    def outputs(self) -> tuple[bool, bool, bool]:
        """The three outputs, active or not."""
        one, two, three = (bool(self.state.outputs >> bit & 1) for bit in range(3))
        return one, two, three

    def set_input(self, port: int, active: bool) -> None:
        """Press or release what is wired to an input, 1 to 5; it bounces as its switch says.

        Raises RequestError for another port.
        """
        self._around.press(port, active, self._around.now)
        self._around.settle()

    def put(self, number: int, project: Project) -> None:
        """Store a project as if it had been written and saved. Raises RequestError for a number that is none."""
        if not 1 <= number <= PROJECTS:
            raise RequestError(f"there is no project {number}", expected=f"1 to {PROJECTS}")
        self.store.put(number, project)

    def switch(self, **changes: object) -> dict[str, object]:
        """Change switches while it runs, values also as text; gives all that can be changed, as they are then.

        These are the faults, `turnaround` and `save_time`. So-many-th ones are counted from here, and when `seed` is
        among the changes, chance begins afresh. Raises RequestError for an impossible name or value, and has changed
        nothing then.
        """
        found = switched(Switches, "stepper", changes)
        for name in changes.keys() - CHANGEABLE:
            raise RequestError(
                f"option {name} cannot be changed while the controller runs",
                expected=f"one of {', '.join(sorted(CHANGEABLE))}",
                advice="begin the simulation with it",
            )
        if changes:
            self._around.settle()
            chosen: dict[str, Any] = {name: getattr(found, name) for name in changes}
            self.switches = replace(self.switches, **chosen)
            self._around.behave(self.switches, reseed="seed" in changes)
        return {name: getattr(self.switches, name) for name in sorted(CHANGEABLE)}

    def notice(self) -> None:
        """Let it say that a project has ended, though none has. Raises RequestError when it has no supply."""
        if not self.powered:
            raise RequestError("without supply it says nothing", advice="plug it in first")
        self.remark("fault: a notice that nothing has caused")
        self._around.notice()

    def unplug(self) -> None:
        """Pull its plug, supply and line in one: motion, outputs and what was not saved are lost."""
        if self.powered:
            self._around.settle()
            self._take(execution.power_off(self.state, self._around.now))
            self.powered = False
            self._around.cut_off()

    def plug(self) -> None:
        """Put it back: it powers up. Does nothing when it is in."""
        if not self.powered:
            self.powered = True
            self.power_up(self._around.now)
            self._around.settle()

    def power_cycle(self) -> None:
        """Take its supply away and give it back at once."""
        if self.powered:
            self.unplug()
            self.plug()

    def midway(self) -> float:
        """When the project that is being saved or cleared is half written; infinity while none is."""
        return self._around.midway()

    def status(self) -> dict[str, object]:
        """How it is, as plain data; position in pulses."""
        now, run = self._around.now, self.state.run
        return {
            "powered": self.powered,
            "phase": self.state.phase.value,
            "position": self.state.position(now),
            "load": self.travel.position(self.state, now),
            "frequency": self.state.frequency(now),
            "homed": self.state.homed,
            "project": run.project.number if run else None,
            "step": run.place.step if run else None,
            "pass": run.round if run else None,
            "outputs": list(self.outputs),
            "leds": self.state.leds,
            "inputs": sorted(self.state.inputs),
            "selected": self.store.selected,
            "saving": self._around.storing,
        }

    # -- what the bus brings -----------------------------------------------------------------------------------

    def power_up(self, at: float) -> None:
        """The supply comes, at this moment."""
        base = self.state.position(at)
        at_home = self._home_switch(at)
        self._inputs = self._inputs | {HOME_INPUT} if at_home else self._inputs - {HOME_INPUT}
        self.store.restart()
        homes = self.store.project(1)
        home_with = homes if homes.power_on_home else None
        self.told.clear()
        self._ends.clear()
        self._take(execution.power_on(at, self.how, inputs=self._inputs, home_with=home_with, base=base))
        if self.how.flags_scope == "device":
            self._take(execution.set_stop_mode(self.state, self.store.flags["stop_mode"]))

    def rewire(self, at: float) -> None:
        """The switches are others than before: input 5 is as its switch has it now."""
        self.travel.change(self.switches)
        at_home = self._home_switch(at)
        if at_home is not (HOME_INPUT in self._inputs):
            self._wire(HOME_INPUT, at_home, at)

    def _home_switch(self, at: float) -> bool:
        """Whether input 5 is active, as what is wired to it says."""
        kind = self.switches.home_switch
        if kind == "wired":
            return self.travel.closed(self.state, at)
        return kind == "stuck" or (kind == "free" and HOME_INPUT in self._inputs)

    def due(self) -> float:
        """When something happens by itself."""
        return min(execution.due(self.state), self._meets())

    def _meets(self) -> float:
        return self.travel.crossing(self.state, HOME_INPUT in self._inputs)

    def advance(self, to: float) -> tuple[Happening, ...]:
        """Let time pass, at most until `due`; gives what happened."""
        if self._meets() <= min(to, execution.due(self.state)):
            return self._wire(HOME_INPUT, HOME_INPUT not in self._inputs, self._meets())
        return self._take(execution.advance(self.state, to))

    def input(self, port: int, active: bool, at: float) -> tuple[Happening, ...]:
        """An input changes; without supply it is so when the supply comes."""
        if port == HOME_INPUT and self.switches.home_switch != "free":
            return ()
        return self._wire(port, active, at)

    def _wire(self, port: int, active: bool, at: float) -> tuple[Happening, ...]:
        self._inputs = self._inputs | {port} if active else self._inputs - {port}
        chosen = self.store.selected if self.switches.in3_project == "selected" else 1
        project = self._to_run(chosen)
        return self._take(execution.set_input(self.state, port, active, at, in3_project=project))

    def _to_run(self, number: int) -> Project:
        """What starting this project runs; one that was cleared and written anew may not know its own number."""
        return replace(self.store.project(number), number=number)

    def obey(self, data: bytes, at: float) -> Said:
        """Carry out a request whose checksum is right."""
        request = wire.decode_request(data)
        if request is None:
            return self.remark(f"unknown command {data[2]:02X} {data[3]:02X}")
        if request.motor not in (0, self.switches.motor):
            return self.remark(f"motor {request.motor} is another one")
        name, values = request.command.name, request.values
        wrong = [field for field, value in values.items() if not is_allowed(field, value, expert=True)]
        if wrong:
            self.remark(f"{name}: {wrong[0]} {values[wrong[0]]} is out of range")
            ignored = self.switches.out_of_range == "ack" and not _WHICH & set(wrong)
            return Said(self._reply(data)) if ignored else SILENCE
        if name in EDITS:
            return self._edit(data, name, values, at)
        return self._act(data, name, values, at)

    # -- commands -------------------------------------------------------------------------------------------------

    def _edit(self, data: bytes, name: str, values: Mapping[str, int], at: float) -> Said:
        self.advance(at)
        run = self.state.run
        if run is not None:
            self.remark(f"{name} while project {run.project.number} runs: it goes on with what it began with")
        self.store.edit(name, values)
        mine = run is None or run.project.number == self.store.selected or self.how.flags_scope == "device"
        if name == "set_stop_mode" and mine:
            self._take(execution.set_stop_mode(self.state, values["stop_mode"]))
        return Said(self._reply(data))

    def _act(self, data: bytes, name: str, values: Mapping[str, int], at: float) -> Said:
        number = values.get("project", 0)
        if name == "save_project":
            return self._save(data, number)
        if name == "clear_project":
            return Said(self._reply(data), lambda: self.store.clear(number))
        if name == "set_output":
            self._take(execution.set_output(self.state, values["port"], values["level"], at))
        elif name in ("stop_project", "stop_motor"):
            self._take(getattr(execution, name)(self.state, at))
        elif name not in ("read_project", "read_input"):
            found = self._start(name, number, at)
            if not found.accepted:
                self.remark(f"{name} while it is {self.state.phase.value}")
                if self.how.busy == "silent":
                    return SILENCE
        return Said(self._reply(data))

    def _start(self, name: str, number: int, at: float) -> Next:
        if name == "start_project":
            found = execution.start(self.state, self._to_run(number), at)
        elif name in ("jog_forward", "jog_reverse"):
            sign = 1 if name == "jog_forward" else -1
            found = execution.jog(self.state, self.store.project(1), sign, at)
        elif name == "run_once":
            found = execution.run_once(self.state, self.store.project(1), at)
        else:
            found = execution.home(self.state, self.store.project(1), at)
        self._take(found)
        return found

    def _save(self, data: bytes, number: int) -> Said:
        reading = self.switches.save_cross
        if number != self.store.selected and reading != "allow":
            done = "is saved" if reading == "warn" else "is selected and not saved"
            self.remark(f"project {self.store.selected} {done} as project {number}")
            if reading == "refuse":
                return SILENCE
        image = self.store.as_saved(number)
        return Said(self._reply(data), lambda: self.store.save(number, image))

    def _reply(self, data: bytes) -> bytes:
        request = wire.decode_request(data)
        assert request is not None, "only requests are answered"
        port, image = request.values.get("port", 0), b""
        if request.command.name == "read_project":
            image = self.store.image(request.values["project"])
        active = port in self.state.inputs
        level = active if self.switches.input_polarity == "high" else not active
        return wire.encode_reply(data, project=self.store.selected, level=int(level), image=image)

    # -- keeping books ------------------------------------------------------------------------------------------

    def _take(self, found: Next) -> tuple[Happening, ...]:
        self.travel.follow(self.state, found.told)
        self.state = found.state
        self.told += found.told
        del self.told[:-TOLD]
        self._ends += [one.at for one in found.told if one.kind == "completed"]
        return found.told

    def notices(self) -> list[float]:
        """When projects have ended of which it has not been said yet."""
        ends, self._ends = self._ends, []
        return ends

    def remark(self, text: str) -> Said:
        """Note something that a host is not told; gives the silence that goes with it."""
        self._remarks += 1
        self.log.append(Remark(self._remarks, self._around.age, text))
        del self.log[:-LOG]
        return SILENCE

    @property
    def moving(self) -> bool:
        """Whether the motor turns."""
        return self.state.motion is not None and self.state.phase is not Phase.IDLE
