"""One simulated servo: its memory, its shaft, and what a write, an alarm or a power cut does to them.

It knows nothing of packets; `bus.py` does. Each method that may change something takes the moment at which it
happens. What was measured on a real one is said with its source; what nobody knows is a switch.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from motorbus.core.plant import rest
from motorbus.families.feetech.simulator import motor
from motorbus.families.feetech.simulator.feedback import FEEDBACK
from motorbus.families.feetech.simulator.memory import Layout, Memory
from motorbus.families.feetech.simulator.model import Model
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import BAUD_CODES, alarms, velocity_scale

_VOLTAGE, _TEMPERATURE = 0x01, 0x04
_CALIBRATE = 128
_DECIDES_MOTION = frozenset(
    {
        "torque_enable",
        "acceleration",
        "goal_position",
        "goal_time",
        "goal_velocity",
        "torque_limit",
        "operating_mode",
        "phase",
        "min_position_limit",
        "max_position_limit",
        "homing_offset",
        "unload_mask",
        "max_voltage",
        "min_voltage",
        "max_temperature",
    }
)


class Servo:
    """A servo as a test pokes it.

    `motion`       the movement of its shaft in counts, on the bus's clock; `motion.start` says since when
    `memory`       its control table; `memory["goal_position"]` is a raw value, `memory.wear` counts EEPROM writes
    `alarm`        alarm bits that a test raises; voltage and temperature raise theirs by themselves
    `voltage`      its supply in V, and `temperature` in °C
    `torque`       what the outside takes of its stall torque, -1 to 1
    `plugged`      whether its cable is in; `lives` counts how often its supply came or went
    """

    def __init__(
        self,
        id: int,
        model: Model,
        layout: Layout,
        switches: Switches,
        now: Callable[[], float],
        renamed: Callable[[], None],
        position: int | None = None,
    ) -> None:
        self.model = model
        self.switches = switches
        self.memory = Memory(layout)
        self.torque = 0.0
        self.plugged = True
        self.lives = 0
        self.pending: tuple[int, bytes] | None = None
        self.zero = 0
        self._alarm = 0
        self._voltage = model.voltage
        self._temperature = 30.0
        self._deaf_until = -inf
        self._now = now
        self._renamed = renamed
        self.motion = rest(now(), model.turn // 2 if position is None else position)
        self.memory["id"] = id
        self.memory.stored[:] = self.memory.live
        self._power_up(now())
        self._deaf_until = -inf

    # What a test or a control socket does to it.

    def unplug(self) -> None:
        """Pull its cable, bus and supply in one. The shaft stays where it is; a reply on its way is lost."""
        self.motion = rest(self._now(), self.motion.position(self._now()))
        self.plugged = False
        self.lives += 1

    def plug(self) -> None:
        """Put its cable back: it powers up. Does nothing when it is in."""
        if not self.plugged:
            self.plugged = True
            self._power_up(self._now())

    def power_cycle(self) -> None:
        """Take its supply away and give it back: RAM and turn count are lost, the EEPROM is as it was stored."""
        if self.plugged:
            self._power_up(self._now())

    def status(self) -> dict[str, object]:
        """How it is, as plain data."""
        now = self._now()
        return {
            "id": self.id,
            "model": self.model.name,
            "plugged": self.plugged,
            "baud_rate": self.baud_rate,
            "raw_position": self.raw_position,
            "raw_goal_position": self.memory["goal_position"],
            "torque_enabled": self.memory["torque_enable"] == 1,
            "moving": self.motion.moving(now),
            "locked": self.locked,
            "alarm": list(alarms(self.error)),
            "voltage": self.voltage,
            "temperature": self.temperature,
        }

    @property
    def alarm(self) -> int:
        """Alarm bits raised by a test; a power cycle clears them (users report that nothing else did)."""
        return self._alarm

    @alarm.setter
    def alarm(self, bits: int) -> None:
        self._alarm = bits
        self._move(self._now())

    @property
    def voltage(self) -> float:
        """The supply in V; outside registers 15 to 14 it raises the voltage alarm."""
        return self._voltage

    @voltage.setter
    def voltage(self, volts: float) -> None:
        self._voltage = volts
        self._move(self._now())

    @property
    def temperature(self) -> float:
        """°C; above register 13 it raises the temperature alarm."""
        return self._temperature

    @temperature.setter
    def temperature(self, degrees: float) -> None:
        self._temperature = degrees
        self._move(self._now())

    @property
    def raw_position(self) -> int:
        """The present position in counts, as register 56 tells it."""
        return FEEDBACK["present_position"](self, self._now())

    @raw_position.setter
    def raw_position(self, counts: int) -> None:
        """Turn the shaft by hand, at rest afterwards."""
        now = self._now()
        self.motion = rest(now, round(self.motion.position(now)) + counts - self.raw_position)

    # What the bus asks.

    @property
    def id(self) -> int:
        """The id it answers to."""
        return self.memory["id"]

    @property
    def baud_rate(self) -> int | None:
        """The rate it is set to, in bit/s; None for a code that means nothing: it hears nobody."""
        return BAUD_CODES.get(self.memory["baud_rate"])

    @property
    def return_delay(self) -> float:
        """Seconds between the end of a request and the beginning of the reply: register 7 in 2 µs."""
        return self.memory["return_delay"] * 2e-6

    @property
    def locked(self) -> bool:
        """Whether writes to the EEPROM area are lost at power-off."""
        return self.memory["lock"] != 0

    @property
    def error(self) -> int:
        """The error byte of its status packets, which register 65 repeats: alarms and nothing else."""
        memory, bits = self.memory, self._alarm
        if not memory["min_voltage"] <= round(self.voltage * 10) <= memory["max_voltage"]:
            bits |= _VOLTAGE
        if self.temperature > memory["max_temperature"]:
            bits |= _TEMPERATURE
        return bits

    @property
    def strong(self) -> bool:
        """Whether the motor may push: supply, torque on, no alarm that unloads it, a torque limit that moves it."""
        memory = self.memory
        wanted = memory["torque_enable"] == 1 and memory["torque_limit"] >= motor.FEEBLE
        return self.plugged and wanted and not self.error & memory["unload_mask"]

    @property
    def burden(self) -> float:
        """What the outside takes of the stall torque just now: nothing of a limp servo."""
        return self.torque if self.strong else 0.0

    def hears(self, rate: int | None, at: float) -> bool:
        """Whether it is there, awake and set to this rate (None: whichever it is)."""
        return self.plugged and at >= self._deaf_until and (rate is None or rate == self.baud_rate)

    def read(self, address: int, count: int, at: float) -> bytes:
        """The bytes a READ gets; readings are worked out for this moment."""
        for row in self.memory.layout.touched(address, count):
            if row.name in FEEDBACK:
                self.memory[row.name] = FEEDBACK[row.name](self, at)
        return self.memory.read(address, count)

    def write(self, address: int, data: bytes, at: float) -> float:
        """Obey a WRITE; gives how much later (s) it is acknowledged because the EEPROM took its time."""
        torque = self.memory["torque_enable"]
        done = self.memory.write(
            address, data, locked=self.locked, strict=self.switches.out_of_range == "drop"
        )
        if done.names:
            self._react(done.names, torque, at)
        return self.switches.store_time if done.stored else 0.0

    def reg_write(self, address: int, data: bytes) -> None:
        """Keep a write for `action`. A power cycle forgets it."""
        if self.pending is None or self.switches.reg_write_again == "replace":
            self.pending = address, data

    def action(self, at: float) -> float:
        """Carry out what REG WRITE left; nothing when there is nothing. Gives the delay as `write` does."""
        if self.pending is None:
            return 0.0
        (address, data), self.pending = self.pending, None
        return self.write(address, data, at)

    def calibrate(self, counts: int, at: float) -> None:
        """Make the present pose read `counts` by way of the homing offset.

        The old offset is taken out first: the encoder counts, not the reading. Only ±2047 can be said, so the one
        pose that would need 2048 reads one count beside (overflows on a real one: lerobot#3370). It then holds.
        """
        turn = self.model.turn
        encoder = round(self.motion.position(at)) % turn
        offset = (encoder - counts + turn // 2) % turn - turn // 2
        self.memory["homing_offset"] = max(1 - turn // 2, offset)
        if not self.locked or self.switches.calibration_store == "always":
            self.memory.store("homing_offset")
        self._count_anew(at)
        self.memory["goal_position"] = FEEDBACK["present_position"](self, at)
        self._move(at)

    def restore_factory(self, at: float) -> None:
        """0x06: as shipped, offset 0, the id kept (servolab, STS3215 firmware 3.10); then it starts again."""
        self.memory.restore_factory(frozenset({"id"} if self.switches.restore_id == "keep" else ()))
        self._power_up(at)
        self._deaf_until = at + self.switches.restore_time

    def enter_bootloader(self, at: float) -> None:
        """0x08: deaf, and back as after power-up (every reset of that controller enters the bootloader).

        What the motor does meanwhile is not known; here it is limp from the beginning.
        """
        self._power_up(at)
        self._deaf_until = at + self.switches.bootloader_time

    def _power_up(self, at: float) -> None:
        self.lives += 1
        self.pending = None
        self._alarm = 0
        memory, switches = self.memory, self.switches
        memory.power_up()
        memory["torque_limit"] = memory["max_torque"]
        memory["lock"] = int(switches.lock_at_power_up)
        memory["torque_enable"] = int(switches.torque_at_power_up)
        self.motion = rest(at, self.motion.position(at) % self.model.turn)  # the turn count is lost
        self._count_anew(at)
        if switches.goal_at_power_up == "present" or switches.torque_at_power_up:
            memory["goal_position"] = FEEDBACK["present_position"](self, at)
        self._deaf_until = at + switches.startup_time if switches.startup_time else -inf
        self._renamed()
        self._move(at)

    def _react(self, names: frozenset[str], torque: int, at: float) -> None:
        memory = self.memory
        if "id" in names:
            self._renamed()
        if "torque_enable" in names and memory["torque_enable"] == _CALIBRATE:
            memory["torque_enable"] = torque  # an order and no state; what 40 reads afterwards is not known
            self.calibrate(self.model.turn // 2, at)
            return
        if names & {"operating_mode", "homing_offset"}:
            self._count_anew(at)
        ordered = "goal_position" in names and memory["operating_mode"] in (motor.POSITION, motor.STEP)
        if ordered and self.switches.goal_enables_torque:
            memory["torque_enable"] = 1
        if ordered and memory["operating_mode"] == motor.STEP:
            self.motion = motor.step(self._settings(), self.motion, at, self.model.drive, self.switches)
        elif names & _DECIDES_MOTION:
            self._move(at)

    def _move(self, at: float) -> None:
        self.motion = motor.plan(self._settings(), self.motion, at, self.model.drive, self.switches)

    def _count_anew(self, at: float) -> None:
        offset = self.memory["homing_offset"] if self.memory["operating_mode"] == motor.POSITION else 0
        self.zero = motor.zero_for(self.motion.position(at), offset, self.model.turn)

    def _settings(self) -> motor.Settings:
        memory = self.memory
        return motor.Settings(
            strong=self.strong,
            mode=memory["operating_mode"],
            goal=memory["goal_position"],
            duty=memory["goal_time"],
            goal_velocity=memory["goal_velocity"],
            velocity_unit=velocity_scale(memory["phase"]),
            acceleration=memory["acceleration"],
            low=memory["min_position_limit"],
            high=memory["max_position_limit"],
            phase=memory["phase"],
            zero=self.zero,
            turn=self.model.turn,
        )
