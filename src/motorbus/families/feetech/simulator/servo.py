"""One simulated servo: its memory, its shaft, and what an alarm or a power cut does to them.

It knows nothing of packets; `bus.py` does. Each method that may change something takes the moment at which it
happens. What was measured on a real one is said with its source; what nobody knows is a switch. What the registers
ask for is worked out in `settings.py`. What is read of it stands in `feedback.py`, what a write or an order does to it
in `effects.py`: both know the servo, which knows neither.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, tau

from motorbus.core import units
from motorbus.core.plant import move, rest
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator import motor, power
from motorbus.families.feetech.simulator.body import Body
from motorbus.families.feetech.simulator.memory import Layout
from motorbus.families.feetech.simulator.model import Model
from motorbus.families.feetech.simulator.protection import OVERLOAD
from motorbus.families.feetech.simulator.settings import Asked, Registers
from motorbus.families.feetech.simulator.switches import Switches
from motorbus.families.feetech.table import Mode, alarms

_VOLTAGE = 0x01
_HAND_SPEED = 1.0
"""rad/s of a limp shaft that is pushed. # assumption"""
_LONGEST_PUSH = 10 * tau


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

    __slots__ = (
        *("lives", "pending", "zero", "facing", "fold", "deaf_until", "renamed"),
        *("_registers", "_alarm"),
    )

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
        self._registers = Registers(model, self.memory, switches)
        self.lives = 0
        self.pending: tuple[int, bytes] | None = None
        self.zero = 0
        self.facing = 1
        self.fold = 1
        self.deaf_until = -inf
        self.renamed = renamed
        self._alarm = 0
        # What the second id ships as is not known: at first it is the main id, so that it changes nothing.
        for name in ("id", "second_id"):
            if name in model.table:
                self.memory[name] = id
        for name, raw in model.set_to.items():
            self.memory[name] = raw
        self.memory.stored[:] = self.memory.live
        self.power_up(now())
        self.deaf_until = -inf

    # What a test or a control socket does to it.

    def unplug(self) -> None:
        """Pull its cable, bus and supply in one. The shaft stays where it is; a reply on its way is lost, and so is
        what was on its way to the EEPROM."""
        self.plugged = False
        self.lives += 1
        self.memory.flash.cut()
        self.move(self._now())

    def plug(self) -> None:
        """Put its cable back: it powers up. Does nothing when it is in."""
        if not self.plugged:
            self.plugged = True
            self.power_up(self._now())

    def power_cycle(self) -> None:
        """Take its supply away and give it back: RAM and turn count are lost, the EEPROM is as it was stored."""
        if self.plugged:
            self.power_up(self._now())

    def midway(self) -> float:
        """When the EEPROM cell under work is half done; infinity while none is."""
        flash = self.memory.flash
        return flash.moment_of(flash.done + 0.5)

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

    @property
    def raw_position(self) -> int:
        """The present position in counts, as register 56 tells it."""
        return self.position(self._now())

    @raw_position.setter
    def raw_position(self, counts: int) -> None:
        """Turn the shaft by hand, at rest afterwards."""
        now = self._now()
        turned = self._along * (counts - self.raw_position)
        self.motion = rest(now, round(self.motion.position(now)) + turned)
        self.stands(now)

    def block_shaft(self, between: tuple[float, float] | None = None) -> None:
        """Block the shaft where it is, or between two positions (rad). Raises RequestError when it is outside them."""
        here = round(self.motion.position(self._now()))
        if between is None:
            self.blocked = here, here
            return
        first, last = (here + self._counts(angle) - self._along * self.raw_position for angle in between)
        low, high = min(first, last), max(first, last)
        if not low <= here <= high:
            present = units.show(
                self.raw_position * self.memory.layout.scales["present_position"], "position"
            )
            raise RequestError(f"the shaft is at {present}", expected="a range that contains this position")
        self.blocked = low, high

    def push_shaft(self, angle: float) -> None:
        """Turn the shaft by hand by an angle (rad): a limp one at 1 rad/s; one with torque at once, and it returns."""
        if abs(angle) > _LONGEST_PUSH:
            raise RequestError(f"{units.show(angle, 'position')} is too far", expected="at most 10 turns")
        now = self._now()
        here = self.motion.position(now)
        goal = here + self._counts(angle)
        if self.blocked is not None:
            goal = min(max(goal, self.blocked[0]), self.blocked[1])
        if self.strong:
            self.motion = rest(now, goal)
            self.move(now)
        else:
            speed = abs(self._counts(_HAND_SPEED))
            self.go_freely(move(now, here, goal, speed=speed, acceleration=10 * speed), 0.0, now)

    def load_shaft(self, share: float) -> None:
        """Let the outside take this share of the stall torque, -1 to 1; positive pushes towards smaller positions."""
        if not -1.0 <= share <= 1.0:
            raise RequestError(f"{share:.0%} is not possible", expected="-100% to 100%")
        self.torque = self.facing * share

    def release_shaft(self) -> None:
        """End what block, push and load do."""
        self.torque, self.blocked = 0.0, None

    @property
    def _along(self) -> int:
        """Counts of the shaft for one count of a position, signed."""
        return self.facing * self.fold

    def _counts(self, angle: float) -> float:
        """An angle (rad) in counts of the shaft."""
        return self._along * angle / self.memory.layout.scales["present_position"]

    # What its supply does to it.

    def power_up(self, at: float, *, cut: bool = True) -> None:
        """Start anew at this moment: limp, at rest, within one turn, and nothing pending (users of STS servos).

        With `cut` the supply was away, and what was on its way to the EEPROM is lost.
        """
        switches = self.switches
        self.lives += 1
        self.pending = None
        self._alarm = 0
        self.protection.forget()
        power.begin(self.memory, switches, cut=cut)
        self.forget_turns(at)
        if switches.goal_at_power_up == "present" or switches.torque_at_power_up:
            self.memory["goal_position"] = self.position(at)
        self.deaf_until = at + switches.startup_time if switches.startup_time else -inf
        self.renamed()
        self.move(at)

    def brown_out(self, at: float) -> None:
        """The supply was too low for a moment, and the torque is off whatever it is after a real power-up.

        A servo that held its load again at once would fall again at once, and for ever; what real ones do is not known.
        """
        self.power_up(at)
        if self.memory["torque_enable"]:
            self.memory["torque_enable"] = 0
            self.move(at)

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
        return self._registers.asked.rate

    @property
    def return_delay(self) -> float:
        """Seconds between the end of a request and the beginning of the reply."""
        return self._registers.asked.delay

    @property
    def locked(self) -> bool:
        """Whether writes to the EEPROM area are lost at power-off."""
        return self._registers.asked.locked

    @property
    def told_voltage(self) -> int:
        """What register 62 says of its supply, in 0.1 V."""
        return round(self.voltage * 10) if self._sag else self._told_voltage

    @property
    def error(self) -> int:
        """The error byte of its status packets, which register 65 repeats: alarms and nothing else."""
        return self._error(self._registers.asked)

    def _error(self, asked: Asked) -> int:
        least, most = asked.volts
        bits = self._alarm | self.protection.error
        told = self.told_voltage if self._sag else self._told_voltage
        return bits if least <= told <= most else bits | _VOLTAGE

    def speaks(self) -> tuple[int, int, float]:
        """What belongs to each of its packets: its id, its error byte, and the return delay before it (s)."""
        asked = self._registers.asked
        memory = self.memory
        return memory.live[memory.layout.id], self._error(asked), asked.delay

    def hears(self, rate: int | None, at: float) -> bool:
        """Whether it is there, awake and set to this rate (None: whichever it is)."""
        if not self.plugged or at < self.deaf_until or (self._sag and not self.fed(at)):
            return False
        return rate is None or rate == self._registers.asked.rate

    # What it does.

    @property
    def asked(self) -> Asked:
        """What its registers ask for."""
        return self._registers.asked

    @property
    def mode(self) -> Mode | None:
        """What it heeds; None when the number in its mode register is not explained by anybody."""
        return self.asked.mode

    @property
    def available(self) -> float:
        """The share of the stall torque that the motor may give just now, 0 to 1; 0: it is limp.

        Supply, torque on, no alarm that unloads it, torque limit and current cap: this is the one place for them.
        """
        return self._available(self._registers.asked)

    def _available(self, asked: Asked) -> float:
        """The same, by what the registers allow."""
        if not self.plugged or not asked.on:
            return 0.0
        unloading, limit = self._error(asked), asked.limit
        if not unloading:
            return limit if limit < 1.0 else 1.0
        if self.tripped and not self._alarm & OVERLOAD:
            unloading &= ~OVERLOAD  # it leaves a part of the torque
        return 0.0 if unloading & self.memory["unload_mask"] else min(limit, self.protection.left)

    @property
    def strong(self) -> bool:
        """Whether the motor pushes at all."""
        return self.available >= motor.FEEBLE

    @property
    def burden(self) -> float:
        """What the outside takes of the stall torque just now: nothing of a limp servo."""
        if not self._world.torque:
            return 0.0
        available = self.available
        return max(-available, min(available, self.torque)) if available >= motor.FEEBLE else 0.0

    def encoder(self, at: float) -> float:
        """Where the encoder is, in counts without end."""
        return self.facing * self.motion.position(at)

    def position(self, at: float) -> int:
        """The present position in counts, as it says it."""
        settings = self._registers.asked.settings
        encoder = self.facing * self.motion.position(at)
        return motor.reading(encoder, self.zero, settings.told, settings.turn, self.fold)

    def arrived(self, at: float) -> bool:
        """Whether it is where its goal is, within the dead band of its position."""
        band = max(self.memory["dead_band_cw"], self.memory["dead_band_ccw"])
        return abs(self.position(at) - self.memory["goal_position"]) <= band

    def move(self, at: float) -> None:
        """Think again about where to go."""
        self._go(motor.plan, at)

    def step(self, at: float) -> None:
        """Take the step that a write of the goal orders in step mode."""
        self._go(motor.step, at)

    def _go(self, planned: motor.Planner, at: float) -> None:
        self.protection.weigh(at)
        wanted, motion = self._wanted(self._registers.asked), self.motion
        if self.facing > 0 and wanted.torque >= 1 and self.free:  # most are like that
            self.go_freely(planned(wanted, motion, at, self.model.drive, self.switches), wanted.torque, at)
        elif self.facing > 0:
            self.bear(lambda drive: planned(wanted, motion, at, drive, self.switches), wanted, at)
        else:
            before, turned = (
                motor.mirrored(motion),
                wanted._replace(duty=-wanted.duty, current=-wanted.current),
            )
            self.bear(
                lambda drive: motor.mirrored(planned(wanted, before, at, drive, self.switches)), turned, at
            )

    def _wanted(self, asked: Asked) -> motor.Settings:
        goal = self.memory["goal_position"]
        return motor.settings(
            asked.settings, self._available(asked), self.facing * self.burden, goal, self.zero
        )

    def face(self, at: float) -> None:
        """Count in the direction and the steps that the registers say; when they change, the turn count begins anew."""
        if (self.facing, self.fold) != (self.asked.facing, self.asked.fold):
            self.count_anew(at)

    def forget_turns(self, at: float) -> None:
        """Stand still, within the first turn."""
        self.facing, self.fold = self.asked.facing, self.asked.fold
        self.motion = rest(at, self.facing * (self.encoder(at) % self.model.turn))
        self.count_anew(at)

    def count_anew(self, at: float) -> None:
        """Put zero where the homing offset says, in position mode only (feetech-cli, servolab, on STS3215)."""
        self.facing, self.fold = self.asked.facing, self.asked.fold
        applied = "homing_offset" in self.model.table and self.mode is Mode.POSITION
        offset = self.memory["homing_offset"] if applied else 0
        self.zero = motor.zero_for(self.encoder(at), offset * self.fold, self.model.turn)
