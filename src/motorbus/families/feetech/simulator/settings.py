"""What the registers of one servo ask of its motor, in counts, seconds and shares, whatever its map calls them.

Which register plays which part comes from `table.control`, what a bit of the phase register means from `table.phase`,
and what only some servos do from `personality`. So nothing here asks for a map by its name. Nor does anything here
know where the shaft is or what pushes it: that is the business of `servo.py`.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.families.feetech.simulator.memory import Memory
from motorbus.families.feetech.simulator.model import Model
from motorbus.families.feetech.simulator.motor import Settings
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import (
    AMPERE,
    BAUD_CODES,
    BAUD_CODES_OF,
    Mode,
    mode_of,
    velocity_scale,
    zero_is_maximum,
)
from motorbus.families.feetech.table.phase import many_turns_are_told

DECIDES_MOTION: Final = frozenset(
    {
        *("torque_enable", "acceleration", "goal_position", "goal_time", "goal_velocity", "goal_torque"),
        *("torque_limit", "max_torque", "operating_mode", "phase", "homing_offset", "unload_mask"),
        *("min_position_limit", "max_position_limit", "max_voltage", "min_voltage", "max_temperature"),
        "angular_resolution",
        *("overload_torque", "overload_time", "protective_torque", "protection_current", "overcurrent_time"),
    }
)
"""A write of one of these makes the servo think again about where it goes."""
_KNOWN: Final = 256
"""Different contents of the registers of which is kept what they come to."""


class Asked(NamedTuple):
    """What all registers but the goal position come to.

    `mode`      what it heeds; None for a number that no source explains
    `facing`    -1 when its feedback counts the other way than its shaft turns, else 1 (bit 7 of phase on STS)
    `fold`      counts of the encoder for one of its positions: its angular resolution (STS3215 memory table V3.6)
    `unit`      counts/s for one unit of its velocity registers
    `limit`     the share of the stall torque that they allow
    `settings`  all of that for its motor; what is not in registers is left as it is
    `rate`      bit/s; None for a code that means nothing: it hears nobody
    `delay`     s between the end of a request and the beginning of the reply
    `volts`     the least and the greatest supply that are no alarm, in 0.1 V
    `on`        its torque is switched on
    `locked`    writes to the EEPROM area are lost at power-off
    """

    mode: Mode | None
    facing: int
    fold: int
    unit: int
    limit: float
    settings: Settings
    rate: int | None
    delay: float
    volts: tuple[int, int]
    on: bool
    locked: bool


class Registers:
    """The registers of one servo, as something that asks for movements."""

    __slots__ = ("_after", "_asked", "_before", "_memory", "_model", "_seen", "_steps", "_switches")

    def __init__(self, model: Model, memory: Memory, switches: Switches) -> None:
        goal, readings = model.table["goal_position"], model.table["present_position"]
        self._model, self._memory, self._switches = model, memory, switches
        self._before = slice(goal.address)
        self._after = slice(goal.address + goal.size, readings.address)
        self._seen = b"", b""
        self._steps = round(model.table["goal_velocity"].scale / goal.scale)  # 1, and 50 on HLS
        self._asked = self._see()

    @property
    def asked(self) -> Asked:
        """What they ask for at present."""
        memory = self._memory
        if not memory.settled:
            live, (before, after) = memory.live, self._seen
            if not (live.startswith(before) and live.startswith(after, self._after.start)):
                self._asked = self._see()  # hosts write goals and little else, so this is rare
            memory.settled = True
        return self._asked

    def _see(self) -> Asked:
        """Look at them anew. A bus is full of servos that differ in their ids alone: they share what they ask for."""
        live, id_at = self._memory.live, self._memory.layout.id
        before, after = bytes(live[self._before]), bytes(live[self._after])
        self._seen = before, after
        known: dict[object, tuple[Asked, Model, Switches]] = self._memory.layout.asked
        key = id(self._model), id(self._switches), before[:id_at], before[id_at + 1 :], after
        found = known.get(key)
        if found is None:
            if len(known) >= _KNOWN:
                known.clear()
            found = known[key] = (
                self._work_out(),
                self._model,
                self._switches,
            )  # which have their id() for so long
        return found[0]

    def _work_out(self) -> Asked:
        memory, switches, model = self._memory, self._switches, self._model
        phase, name = memory["phase"], model.table.name
        low, high = self._limits()
        endless = low == high == 0
        mode, facing, fold = self._mode(), self._facing(), self._fold()
        unit = self._steps * velocity_scale(phase, name)
        velocity = memory["goal_velocity"] * unit
        settings = Settings(
            mode=mode,
            low=low,
            high=high,
            endless=endless,
            turns=endless and model.control.many_turns,
            duty=self._duty() * facing if mode is Mode.PWM else 0.0,
            current=self._current() if mode is Mode.CURRENT else 0.0,
            velocity=velocity,
            fastest=not velocity and (switches.zero_velocity == "maximum" or zero_is_maximum(phase, name)),
            time=0.0 if velocity else self._time(),
            acceleration=self._acceleration(),
            runs_away=switches.half_reversed == "runaway" and self._drive() != facing,
            told=many_turns_are_told(phase, name),
            turn=model.turn,
            fold=fold,
        )
        limit, volts = self._limit(mode), (memory["min_voltage"], memory["max_voltage"])
        rate, delay = self._rate(), self._delay()
        on, locked = memory["torque_enable"] == 1, memory["lock"] != 0
        return Asked(mode, facing, fold, unit, limit, settings, rate, delay, volts, on, locked)

    def _rate(self) -> int | None:
        code, known = self._memory["baud_rate"], BAUD_CODES_OF[self._model.table.name]
        return BAUD_CODES.get(code) if self._switches.baud_codes == "all" or code in known else None

    def _delay(self) -> float:
        """Register 7 in 2 µs.

        SMS: values below 50 act as 50 (FEETECH page on SMS servos). HLS has its second id there, and no delay.
        """
        least = self._model.personality.least_delay
        if "return_delay" in self._model.table and self._switches.return_delay == "heed":
            return max(self._memory["return_delay"] * 2e-6, least)
        return least

    def _mode(self) -> Mode | None:
        control, switches = self._model.control, self._switches
        if not control.modes:
            return mode_of(self._model.table.name, None, self._limits())
        found = control.modes.get(self._memory["operating_mode"])
        return Mode.POSITION if found is None and switches.unknown_mode == "position" else found

    def _facing(self) -> int:
        bits = self._model.personality.reversed_by
        return -1 if bits and self._memory["phase"] >> bits[1] & 1 else 1

    def _drive(self) -> int:
        """-1 when the motor drives the other way (bit 0 of phase on STS and SCS), else 1."""
        bits = self._model.personality.reversed_by
        return -1 if bits and self._memory["phase"] >> bits[0] & 1 else 1

    def _fold(self) -> int:
        if "angular_resolution" not in self._model.table or self._switches.angular_resolution == "ignore":
            return 1
        return self._memory["angular_resolution"] or 1

    def _limit(self, mode: Mode | None) -> float:
        """Torque limit, and where there is one the current cap.

        A map without a torque limit has `max_torque` of its EEPROM for it. An HLS with 0 as its goal torque never moves
        in position and velocity mode (seen on hardware, where the burst of seven bytes that suits an STS had written
        it).
        """
        control = self._model.control
        share = self._memory[control.limit or "max_torque"] / 1000
        if control.current and mode in (Mode.POSITION, Mode.VELOCITY):
            share = min(share, abs(self._current()))
        return share

    def _limits(self) -> tuple[int, int]:
        return self._memory["min_position_limit"], self._memory["max_position_limit"]

    def _acceleration(self) -> float:
        """Counts/s²; 0 in the register, or no register, means the greatest."""
        row, switches = self._model.control.acceleration, self._switches
        return (self._memory[row] * switches.acceleration_unit if row else 0.0) or switches.full_acceleration

    def _duty(self) -> float:
        """Share of the supply in PWM mode, positive towards greater counts of the shaft."""
        wish = self._switches.positive_duty
        smaller = self._model.personality.smaller if wish == "by_map" else wish == "smaller"
        row = self._model.control.duty or self._switches.hls_duty
        return max(-1.0, min(1.0, self._memory[row] / 1000)) * (-1 if smaller else 1) * self._drive()

    def _current(self) -> float:
        """The goal or cap of the current as a share of that at stall."""
        return self._memory[self._model.control.current] * AMPERE / self._model.drive.stall_current

    def _time(self) -> float:
        """s that a way takes when the velocity is 0; 0 where the register is not heeded.

        The whole word is the time: the sign at bit 10 belongs to the duty alone (SCS memory table).
        """
        control, wish = self._model.control, self._switches.goal_time
        heeded = self._model.personality.heeds_time if wish == "by_map" else wish == "heed"
        if not heeded or not control.time:
            return 0.0
        row = self._model.table[control.time]
        word = bytes(self._memory.live[row.address : row.address + row.size])
        return int.from_bytes(word, "little" if row.order == "little" else "big") / 1000
