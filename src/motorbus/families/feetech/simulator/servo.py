"""One simulated servo: its memory, its shaft, and what a write, an alarm or a power cut does to them.

It knows nothing of packets; `bus.py` does. Each method that may change something takes the moment at which it
happens. What was measured on a real one is said with its source; what nobody knows is a switch. What the registers
ask for is worked out in `settings.py`, what an order does besides in `effects.py`, a power-up in `power.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from motorbus.core.plant import rest
from motorbus.families.feetech.simulator import effects, motor
from motorbus.families.feetech.simulator.body import Body
from motorbus.families.feetech.simulator.feedback import FEEDBACK
from motorbus.families.feetech.simulator.memory import Layout
from motorbus.families.feetech.simulator.model import Model
from motorbus.families.feetech.simulator.power import power_up, stand
from motorbus.families.feetech.simulator.protection import OVERLOAD
from motorbus.families.feetech.simulator.settings import (
    blind,
    facing_of,
    fold_of,
    mode_now,
    settings,
    torque_limit,
    velocity_steps,
)
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import BAUD_CODES, BAUD_CODES_OF, Mode, alarms, velocity_scale

_VOLTAGE = 0x01


class Servo(Body):
    """A servo as a test pokes it.

    `model`        what it is; `model.table` are its registers
    `motion`       the movement of its shaft in counts, on the bus's clock; `motion.start` says since when
    `memory`       its control table; `memory["goal_position"]` is a raw value, `memory.wear` counts EEPROM writes
    `alarm`        alarm bits that a test raises; voltage and temperature raise theirs by themselves
    `voltage`      its supply in V, and `temperature` in °C
    `torque`       what the outside takes of its stall torque, -1 to 1
    `plugged`      whether its cable is in; `lives` counts how often its supply came or went
    `pending`      what REG WRITE left for ACTION
    `zero`         the place of the encoder that reads 0; `facing` -1 when the encoder counts against the shaft;
                   `fold` counts of the encoder make one of a position
    `deaf_until`   it hears nothing before this moment
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
        super().__init__(model, layout, switches, now, model.turn // 2 if position is None else position)
        self.lives = 0
        self.pending: tuple[int, bytes] | None = None
        self.zero = 0
        self.facing = 1
        self.fold = 1
        self.deaf_until = -inf
        self.renamed = renamed
        self._alarm = 0
        self._all_codes = switches.baud_codes == "all"
        self._steps = velocity_steps(model)
        self._delays = "return_delay" in model.table and switches.return_delay == "heed"
        # What the second id ships as is not known: at first it is the main id, so that it changes nothing.
        for name in ("id", "second_id"):
            if name in model.table:
                self.memory[name] = id
        for name, raw in model.set_to.items():
            self.memory[name] = raw
        self.memory.stored[:] = self.memory.live
        power_up(self, now())
        self.deaf_until = -inf

    # What a test or a control socket does to it.

    def unplug(self) -> None:
        """Pull its cable, bus and supply in one. The shaft stays where it is; a reply on its way is lost."""
        now = self._now()
        self.plugged = False
        self.lives += 1
        stand(self, now)

    def plug(self) -> None:
        """Put its cable back: it powers up. Does nothing when it is in."""
        if not self.plugged:
            self.plugged = True
            power_up(self, self._now())

    def power_cycle(self) -> None:
        """Take its supply away and give it back: RAM and turn count are lost, the EEPROM is as it was stored."""
        if self.plugged:
            power_up(self, self._now())

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
            "alarm": list(alarms(self.error, self.model.table.name)),
            "voltage": self.voltage,
            "temperature": self.temperature,
        }

    @property
    def alarm(self) -> int:
        """Alarm bits that were raised by hand; they stay until they are cleared or the power is cut."""
        return self._alarm

    @alarm.setter
    def alarm(self, bits: int) -> None:
        self._alarm = bits
        self.move(self._now())

    def clear_alarm(self) -> None:
        """Forget what was raised, as a power cut does."""
        self._alarm = 0
        self.protection.forget()

    @property
    def raw_position(self) -> int:
        """The present position in counts, as register 56 tells it."""
        now = self._now()
        return FEEDBACK["present_position"](self, now)

    @raw_position.setter
    def raw_position(self, counts: int) -> None:
        """Turn the shaft by hand, at rest afterwards."""
        now = self._now()
        turned = self.facing * self.fold * (counts - self.raw_position)
        self.motion = rest(now, round(self.motion.position(now)) + turned)
        self.stands(now)

    # What the bus asks.

    @property
    def id(self) -> int:
        """The id it answers to."""
        return self.memory["id"]

    @property
    def second_id(self) -> int | None:
        """The id by which it takes writes as well; None when its map has none."""
        return self.memory["second_id"] if "second_id" in self.model.table else None

    @property
    def baud_rate(self) -> int | None:
        """The rate it is set to, in bit/s; None for a code that means nothing: it hears nobody."""
        code = self.memory["baud_rate"]
        return (
            BAUD_CODES.get(code) if self._all_codes or code in BAUD_CODES_OF[self.model.table.name] else None
        )

    @property
    def return_delay(self) -> float:
        """Seconds between the end of a request and the beginning of the reply: register 7 in 2 µs.

        SMS: values below 50 act as 50 (FEETECH page on SMS servos). HLS has its second id there, and no delay.
        """
        if self._delays:
            return max(self.memory["return_delay"] * 2e-6, self.model.personality.least_delay)
        return self.model.personality.least_delay

    @property
    def locked(self) -> bool:
        """Whether writes to the EEPROM area are lost at power-off."""
        return self.memory["lock"] != 0

    @property
    def told_voltage(self) -> int:
        """What register 62 says of its supply, in 0.1 V."""
        return 0 if self.switches.wrong_bridge == "blind" and blind(self) else round(self.voltage * 10)

    @property
    def error(self) -> int:
        """The error byte of its status packets, which register 65 repeats: alarms and nothing else."""
        memory, bits = self.memory, self._alarm | self.protection.error
        if not memory["min_voltage"] <= self.told_voltage <= memory["max_voltage"]:
            bits |= _VOLTAGE
        return bits

    def hears(self, rate: int | None, at: float) -> bool:
        """Whether it is there, awake and set to this rate (None: whichever it is)."""
        awake = self.plugged and at >= self.deaf_until and self.fed(at)
        return awake and (rate is None or rate == self.baud_rate)

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
            effects.react(self, done.names, torque, at)
        if done.stored:
            self.stores()
        return self.storing(at)

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

    # What it does.

    @property
    def mode(self) -> Mode | None:
        """What it heeds; None when the number in its mode register is not explained by anybody."""
        return mode_now(self)

    @property
    def velocity_unit(self) -> int:
        """Counts/s for one unit of its velocity registers."""
        return self._steps * velocity_scale(self.memory["phase"], self.model.table.name)

    @property
    def available(self) -> float:
        """The share of the stall torque that the motor may give just now, 0 to 1; 0: it is limp.

        Supply, torque on, no alarm that unloads it, torque limit and current cap: this is the one place for them.
        """
        memory, unloading = self.memory, self.error
        if self.tripped and not self._alarm & OVERLOAD:
            unloading &= ~OVERLOAD  # it leaves a part of the torque
        if not self.plugged or memory["torque_enable"] != 1 or unloading & memory["unload_mask"]:
            return 0.0
        return min(torque_limit(self), self.protection.left)

    @property
    def strong(self) -> bool:
        """Whether the motor pushes at all."""
        return self.available >= motor.FEEBLE

    @property
    def burden(self) -> float:
        """What the outside takes of the stall torque just now: nothing of a limp servo."""
        available = self.available if self.torque else 0.0
        return max(-available, min(available, self.torque)) if available >= motor.FEEBLE else 0.0

    def encoder(self, at: float) -> float:
        """Where the encoder is, in counts without end."""
        return self.facing * self.motion.position(at)

    def arrived(self, at: float) -> bool:
        """Whether it is where its goal is, within the dead band of its position."""
        band = max(self.memory["dead_band_cw"], self.memory["dead_band_ccw"])
        return abs(FEEDBACK["present_position"](self, at) - self.memory["goal_position"]) <= band

    def move(self, at: float) -> None:
        """Think again about where to go."""
        self._go(motor.plan, at)

    def step(self, at: float) -> None:
        """Take the step that a write of the goal orders in step mode."""
        self._go(motor.step, at)

    def _go(self, planned: motor.Planner, at: float) -> None:
        self.protection.weigh(at)
        wanted, motion = settings(self, at), self.motion
        if self.facing > 0:
            self.bear(lambda drive: planned(wanted, motion, at, drive, self.switches), wanted, at)
        else:
            before, turned = (
                motor.mirrored(motion),
                wanted._replace(duty=-wanted.duty, current=-wanted.current),
            )
            self.bear(
                lambda drive: motor.mirrored(planned(wanted, before, at, drive, self.switches)), turned, at
            )

    def face(self, at: float) -> None:
        """Count in the direction and the steps that the registers say; when they change, the turn count begins anew."""
        if (self.facing, self.fold) != (facing_of(self), fold_of(self)):
            self.count_anew(at)

    def forget_turns(self, at: float) -> None:
        """Stand still, within the first turn."""
        self.facing, self.fold = facing_of(self), fold_of(self)
        self.motion = rest(at, self.facing * (self.encoder(at) % self.model.turn))
        self.count_anew(at)

    def count_anew(self, at: float) -> None:
        """Put zero where the homing offset says, in position mode only (feetech-cli, servolab, on STS3215)."""
        self.facing, self.fold = facing_of(self), fold_of(self)
        applied = "homing_offset" in self.model.table and self.mode is Mode.POSITION
        offset = self.memory["homing_offset"] if applied else 0
        self.zero = motor.zero_for(self.encoder(at), offset * self.fold, self.model.turn)
