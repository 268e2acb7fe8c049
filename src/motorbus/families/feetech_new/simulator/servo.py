"""One simulated servo: registers, shaft, supply and alarms. It knows no packets."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, tau
from typing import Final

from motorbus.core import units
from motorbus.core.plant import Motion, move, rest
from motorbus.core.simulated import PoweredDevice
from motorbus.errors import RequestError
from motorbus.families.feetech_new.protocol import MAX_ID
from motorbus.families.feetech_new.registers.codes import BAUD_CODES, alarms
from motorbus.families.feetech_new.registers.rows import AMPERE
from motorbus.families.feetech_new.simulator.memory import Memory
from motorbus.families.feetech_new.simulator.models import Model
from motorbus.families.feetech_new.simulator.motor import (
    FEEBLE,
    FULL_ACCELERATION,
    Course,
    Order,
    follow,
    limp,
)
from motorbus.families.feetech_new.simulator.protection import HEAT, VOLTAGE, Overload
from motorbus.families.feetech_new.simulator.quirks import Quirks
from motorbus.families.feetech_new.traits import Mode

AMBIENT: Final = 30.0  # °C # assumption
HAND_SPEED: Final = 1.0  # rad/s of a limp shaft that is pushed # assumption
LONGEST_PUSH: Final = 10 * tau
ACCELERATION_UNIT: Final = 100.0  # counts/s² (memory table V3.6; servolab measured 104 to 105)
FARTHEST: Final = 7.5  # turns to a goal over many turns (memory table V3.6: 30719 counts)
MIDDLE: Final = 128  # in torque_enable
LOADED: Final = {
    "torque_limit": "max_torque",  # STS3215 memory table V3.6; FD: SMBL and HLS as well
    "goal_torque": "protection_current",  # HLS memory table, as the three below
    "live_p": "position_p",
    "live_d": "position_d",
    "live_i": "position_i",
}
"""RAM row -> EEPROM row from which it is loaded at power-up."""


class Servo(PoweredDevice):
    """A simulated servo.

    `memory`      its registers; `memory["goal_position"]` is a raw value
    `motion`      of its shaft, in counts of the encoder without end
    `zero`        the place of the encoder that reads 0
    `alarm`       alarm bits that a test sets; voltage, temperature and overload add theirs
    `pending`     address and data of a REG WRITE
    `lacks`       codes of instructions that it does not know
    `jitter`      bits by which its replies may be late
    `lives`       number of losses of supply and restarts; a reply of an earlier life is not sent
    `deaf_until`  moment (s) before which it receives nothing
    """

    def __init__(
        self,
        id: int,
        model: Model,
        quirks: Quirks,
        now: Callable[[], float],
        changed: Callable[[], None],
        position: int | None = None,
    ) -> None:
        """`changed` is called when its id or second id may have changed."""
        self.model = model
        self.quirks = quirks
        self.memory = Memory(model.layout, now, quirks.store_time, quirks.torn)
        self.overload = Overload(self.memory, model.drive)
        self.pending: tuple[int, bytes] | None = None
        self.lacks: set[int] = set()
        self.lives = self.jitter = self.zero = self._alarm = 0
        self._load, self._blocked = 0.0, (-inf, inf)
        self._voltage, self._temperature = model.voltage, AMBIENT
        self._now = now
        self._changed = changed
        self._reversed = False
        self.course = Course(rest(now(), model.traits.turn // 2 if position is None else position))
        # As shipped the second id is the first: it then changes nothing. # assumption
        for name, raw in {"id": id, "second_id": id, **model.stored}.items():
            if name in model.table:
                self.memory[name] = raw
        self.memory.stored[:] = self.memory.live
        self.power_on()
        self.deaf_until = -inf

    # -- for tests and the control socket ------------------------------------------------------------------------

    def status(self) -> dict[str, object]:
        """Its state as plain data; positions in raw counts."""
        return {
            "id": self.memory["id"],
            "model": self.model.name,
            "plugged": self.plugged,
            "baud_rate": self.baud_rate,
            "raw_position": self.raw_position,
            "raw_goal_position": self.memory["goal_position"],
            "torque_enabled": self.memory["torque_enable"] == 1,
            "moving": self.motion.moving(self._now()),
            "locked": self.locked,
            "alarm": list(alarms(self.error, self.model.table.name)),
            "voltage": self.voltage,
            "temperature": self.temperature,
        }

    def midway(self) -> float:
        """The moment (s) at which the EEPROM cell in work is half stored; inf without one."""
        return self.memory.midway()

    @property
    def alarm(self) -> int:
        return self._alarm

    @alarm.setter
    def alarm(self, bits: int) -> None:
        self._alarm = bits
        self.move()

    @property
    def voltage(self) -> float:
        """Supply, V; outside min_voltage to max_voltage it is an alarm."""
        return self._voltage

    @voltage.setter
    def voltage(self, volts: float) -> None:
        self._voltage = volts
        self.move()

    @property
    def temperature(self) -> float:
        """In °C; above max_temperature it is an alarm."""
        return self._temperature

    @temperature.setter
    def temperature(self, degrees: float) -> None:
        self._temperature = degrees
        self.move()

    @property
    def raw_position(self) -> int:
        """Present position in raw counts; setting it turns the shaft by hand."""
        return self.position(self._now())

    @raw_position.setter
    def raw_position(self, raw: int) -> None:
        place = round(self.motion.position(self._now())) + (raw - self.raw_position) * self._resolution
        self._start(Course(rest(self._now(), place)))

    def block_shaft(self, between: tuple[float, float] | None = None) -> None:
        """Block the shaft here, or between two positions (rad). Raises RequestError when it is outside of them."""
        now = self._now()
        here, present = round(self.motion.position(now)), self.raw_position * self.model.angle
        low, high = sorted(here + self._counts(angle - present) for angle in between or (present, present))
        if not low <= here <= high:
            raise RequestError(
                f"the shaft is at {units.show(present, 'position')}",
                expected="a range that contains this position",
            )
        self._blocked = low, high
        self.move()

    def push_shaft(self, angle: float) -> None:
        """Turn the shaft by hand by an angle (rad): a limp one at 1 rad/s, one with torque at once; it returns."""
        if abs(angle) > LONGEST_PUSH:
            raise RequestError(f"{units.show(angle, 'position')} is too far", expected="at most 10 turns")
        now = self._now()
        here = self.motion.position(now)
        goal = min(max(here + self._counts(angle), self._blocked[0]), self._blocked[1])
        if self.available >= FEEBLE:
            self.course = Course(rest(now, goal))
            self.move()
        else:
            speed = abs(self._counts(HAND_SPEED))
            self._start(Course(move(now, here, goal, speed=speed, acceleration=10 * speed)))

    def load_shaft(self, share: float) -> None:
        """Load the shaft with this share of the stall torque, -1 to 1; positive pushes to smaller positions."""
        if not -1.0 <= share <= 1.0:
            raise RequestError(f"{share:.0%} is not possible", expected="-100% to 100%")
        self._load = share
        self.move()

    def release_shaft(self) -> None:
        """End block and load."""
        self._load, self._blocked = 0.0, (-inf, inf)
        self.move()

    # -- supply --------------------------------------------------------------------------------------------------

    def power_off(self) -> None:
        """The supply goes: what is not stored is lost, the shaft stays."""
        self.lives += 1
        self.memory.power_off()
        self._start(limp(self.motion, self._now()))

    def power_on(self) -> None:
        """The supply comes; a torn id or baud rate that no servo can have is as shipped. # assumption"""
        self.restart()
        for name, possible in (("id", range(MAX_ID + 1)), ("baud_rate", BAUD_CODES)):
            if self.memory[name] not in possible:
                address = self.model.table[name].address
                self.memory.live[address] = self.model.layout.shipped[address]
        self.deaf_until = self._now() + self.quirks.startup_time if self.quirks.startup_time else -inf

    def restart(self) -> None:
        """Start the firmware: limp, within one turn, nothing pending, no alarm (users of STS servos)."""
        now, memory, quirks = self._now(), self.memory, self.quirks
        self.lives += 1
        self.pending, self._alarm = None, 0
        self.overload.clear()
        memory.restart()
        for row, source in LOADED.items():
            if row in self.model.table:
                memory[row] = memory[source]
        memory["lock"] = quirks.lock_at_power_up
        memory["torque_enable"] = quirks.torque_at_power_up
        self._changed()
        self.forget_turns()
        if quirks.goal_at_power_up == "present" or quirks.torque_at_power_up:
            memory["goal_position"] = self.position(now)
        self.move()

    # -- settings ------------------------------------------------------------------------------------------------

    @property
    def id(self) -> int:
        return self.memory["id"]

    @property
    def second_id(self) -> int | None:
        """Another id whose writes it obeys; None where the map has no such row."""
        return self.memory["second_id"] if "second_id" in self.model.table else None

    @property
    def baud_rate(self) -> int | None:
        """Bit/s; None for a code that means nothing: it receives nothing. Codes 8 to 11 are rates. # assumption"""
        return BAUD_CODES.get(self.memory["baud_rate"])

    @property
    def reply_delay(self) -> float:
        """Seconds from request to reply: register 7 in 2 µs (memory table V3.6; HLS has no such row)."""
        own = self.memory["return_delay"] * 2e-6 if "return_delay" in self.model.table else 0.0
        return max(own, self.model.reply_delay)

    @property
    def locked(self) -> bool:
        """Writes to the EEPROM are lost at power-off."""
        return self.memory["lock"] != 0

    @property
    def mode(self) -> Mode | None:
        """None for a code that no source explains."""
        code = self.memory["operating_mode"] if self.model.traits.modes else None
        return self.model.traits.mode_of(code, self._limits)

    @property
    def _limits(self) -> tuple[int, int]:
        return self.memory["min_position_limit"], self.memory["max_position_limit"]

    @property
    def _resolution(self) -> int:
        """Encoder counts for one count of a position (memory table V3.6); in single-turn mode too. # assumption"""
        return self.memory["angular_resolution"] or 1 if "angular_resolution" in self.model.table else 1

    @property
    def error(self) -> int:
        """The error byte of its status packets: alarms only."""
        memory = self.memory
        bits = self._alarm | (self.overload.bit if self.overload.tripped else 0)
        if not memory["min_voltage"] <= round(self._voltage * 10) <= memory["max_voltage"]:
            bits |= VOLTAGE
        return bits | (HEAT if self._temperature > memory["max_temperature"] else 0)

    @property
    def available(self) -> float:
        """Share of the stall torque that the motor may use, 0 to 1; 0: limp.

        An HLS with goal_torque 0 is limp in position and velocity mode (seen on hardware).
        """
        memory, traits = self.memory, self.model.traits
        if not self.plugged or memory["torque_enable"] != 1:
            return 0.0
        share = memory[traits.limit or "max_torque"] / 1000
        if traits.current and self.mode in (Mode.POSITION, Mode.VELOCITY):
            share = min(share, abs(self._current))
        releasing, bit = self.error & memory["unload_mask"], self.overload.bit
        if releasing & bit and not self._alarm & bit:
            share = min(share, self.overload.torque)
            releasing &= ~bit
        return 0.0 if releasing else min(share, 1.0)

    @property
    def _current(self) -> float:
        """Goal or limit of the current, a share of that at stall."""
        return self.memory[self.model.traits.current] * AMPERE / self.model.drive.stall_current

    def hears(self, rate: int | None, at: float) -> bool:
        """Whether it receives a packet of this rate (None: any)."""
        return self.plugged and at >= self.deaf_until and rate in (None, self.baud_rate)

    # -- motion --------------------------------------------------------------------------------------------------

    @property
    def motion(self) -> Motion:
        return self.course.motion

    def trip(self) -> None:
        """The overload protection trips; `overload.next` is the moment."""
        self.overload.tripped = True
        self.move()

    def position(self, at: float) -> int:
        """The present position in counts, as its register has it: within one turn unless phase bit 4 is set."""
        counts = round((round(self.motion.position(at)) - self.zero) / self._resolution)
        traits = self.model.traits
        return counts if traits.tells_turns(self.memory["phase"]) else counts % traits.turn

    def move(self) -> None:
        """Start the course that registers and world ask for now."""
        now = self._now()
        place = self._goal(now) if self.mode is Mode.POSITION else self._last(now)
        self._start(follow(self._order(place), self.motion, now, self.model.drive))

    def step(self) -> None:
        """Step mode: go on by goal_position from the last goal. # assumption"""
        now = self._now()
        place = round(self._last(now)) + self.memory["goal_position"] * self._resolution
        self._start(follow(self._order(place), self.motion, now, self.model.drive))

    def _start(self, course: Course) -> None:
        self.course = course
        self.overload.watch(course, self._now())

    def _last(self, now: float) -> float:
        """The goal of the present movement; where it is if it has none."""
        motion = self.motion
        return motion.goal if motion.moving(now) and not motion.cruise else motion.position(now)

    def _goal(self, now: float) -> float:
        """The place of goal_position, clamped to the limits # assumption

        Within one turn the way does not cross the seam (STS_servos#7).
        """
        traits, goal, limits = self.model.traits, self.memory["goal_position"], self._limits
        if limits == (0, 0):
            if not traits.many_turns:
                return self.zero + goal * self._resolution
            farthest = int(FARTHEST * traits.turn) - 1
            return self.zero + min(max(goal, -farthest), farthest) * self._resolution
        goal = min(max(goal, limits[0]), limits[1])
        return round(self.motion.position(now)) + (goal - self.position(now)) * self._resolution

    def _order(self, place: float) -> Order:
        memory, traits, table, mode = self.memory, self.model.traits, self.model.table, self.mode
        phase, acceleration, share, time = memory["phase"], FULL_ACCELERATION, 0.0, 0.0
        unit = traits.velocity_scale(phase) * round(
            table["goal_velocity"].scale / table["goal_position"].scale
        )
        velocity = memory["goal_velocity"] * unit
        if traits.acceleration:
            acceleration = memory[traits.acceleration] * ACCELERATION_UNIT or FULL_ACCELERATION
        if self.model.heeds_time:
            time = memory[traits.time] / 1000
        if mode is Mode.CURRENT:
            share = self._current
        elif mode is Mode.PWM and traits.duty:
            row = traits.duty_row(table)
            duty = row.decode(memory.read(row.address, row.size)) / 1000
            share = max(-1.0, min(1.0, -duty if self.model.smaller else duty))
        return Order(
            mode=mode,
            torque=self.available,
            load=self._load,
            blocked=self._blocked,
            place=place,
            speed=abs(velocity) or (inf if traits.zero_is_maximum(phase) else 0.0),
            time=time,
            velocity=velocity,
            share=share,
            acceleration=acceleration,
        )

    def _counts(self, angle: float) -> float:
        """An angle (rad) in counts of the encoder."""
        return angle / self.model.angle * self._resolution

    def forget_turns(self) -> None:
        """Stand still, within the first turn."""
        now = self._now()
        self.course = Course(rest(now, self.motion.position(now) % self.model.traits.turn))
        self.count_anew()

    def count_anew(self) -> None:
        """Put zero where the homing offset says, in position mode only (feetech-cli, servolab, on STS3215)."""
        now, memory, turn = self._now(), self.memory, self.model.traits.turn
        bit = self.model.reversed_by
        if self._reversed != (bit is not None and bool(memory["phase"] >> bit & 1)):
            self._reversed = not self._reversed
            self.course = Course(rest(now, -self.motion.position(now)))
        applies = "homing_offset" in self.model.table and self.mode is Mode.POSITION
        offset = memory["homing_offset"] * self._resolution if applies else 0
        counts = round(self.motion.position(now))
        self.zero = counts - (counts - offset) % turn

    # -- requests ------------------------------------------------------------------------------------------------

    def read(self, address: int, count: int) -> bytes:
        """The bytes of a READ."""
        for row in self.memory.layout.touched(address, count):
            feedback = FEEDBACK.get(row.name)
            if feedback:
                self.memory[row.name] = feedback(self, self._now())
        return self.memory.read(address, count)

    def write(self, address: int, data: bytes) -> None:
        """Obey a WRITE."""
        memory, traits = self.memory, self.model.traits
        torque = memory["torque_enable"]
        strict = self.quirks.out_of_range == "drop"
        names = memory.write(address, data, locked=self.locked, strict=strict)
        if names & {"id", "second_id"}:
            self._changed()
        if "torque_enable" in names and memory["torque_enable"] == MIDDLE and self.model.switch_128:
            memory["torque_enable"] = torque  # a command and no state # assumption
            self.calibrate(traits.turn // 2)
            return
        released = "torque_enable" in names and not memory["torque_enable"]
        if released and self.quirks.overload_clears == "torque_off":
            self.overload.clear()
        decisive = {"operating_mode", "homing_offset", "phase", "angular_resolution"}
        if not traits.modes:
            decisive |= {"min_position_limit", "max_position_limit"}
        if names & decisive:
            self.count_anew()
        mode = self.mode
        if "goal_position" in names and traits.goal_switches_on and mode in (Mode.POSITION, Mode.STEP):
            memory["torque_enable"] = 1
        if "goal_position" in names and mode is Mode.STEP:
            self.step()
        elif names - {"lock"}:
            self.move()

    def calibrate(self, counts: int) -> None:
        """Give the present pose this position by the homing offset, cut to what the register can express; then hold.

        At one pose an STS is one count beside (lerobot#3370). It is stored only with the lock open. # assumption
        """
        memory, turn, row = self.memory, self.model.traits.turn, self.model.table["homing_offset"]
        difference = round(self.motion.position(self._now())) - counts * self._resolution
        offset = round(((difference + turn // 2) % turn - turn // 2) / self._resolution)
        memory["homing_offset"] = max(row.low, min(row.high, offset))
        if not self.locked:
            memory.store(range(row.address, row.address + row.size))
        self.count_anew()
        self._hold()

    def clear_turns(self) -> None:
        """Count the position within one turn again (FTServo_Python, hls/reset.py); then hold."""
        self.forget_turns()
        self._hold()

    def _hold(self) -> None:
        self.memory["goal_position"] = self.raw_position
        self.move()


def _velocity(servo: Servo, at: float) -> int:
    table = servo.model.table
    unit = servo.model.traits.velocity_scale(servo.memory["phase"])
    return round(
        servo.motion.velocity(at) / unit * table["present_position"].scale / table["present_velocity"].scale
    )


def _current(servo: Servo, at: float) -> int:
    if not servo.model.traits.tells_current(servo.memory["phase"]):
        return 0
    return round(servo.course.current(at, servo.model.drive) / AMPERE)


def _moving(servo: Servo, at: float) -> int:
    """Bit 0: it moves; bit 1 (HLS memory table): the goal is not reached."""
    memory, moving = servo.memory, int(servo.motion.moving(at))
    if 1 in servo.model.table["moving"].bits:
        band = max(memory["dead_band_cw"], memory["dead_band_ccw"])
        moving |= 2 * (abs(servo.position(at) - memory["goal_position"]) > band)
    return moving


FEEDBACK: Final[dict[str, Callable[[Servo, float], int]]] = {
    "present_position": Servo.position,
    "present_velocity": _velocity,
    "present_load": lambda servo, at: round(1000 * servo.course.duty(at, servo.model.drive)),
    "present_voltage": lambda servo, at: round(servo.voltage * 10),
    "present_temperature": lambda servo, at: round(servo.temperature),
    "reg_write_pending": lambda servo, at: int(servo.pending is not None),
    "hardware_error": lambda servo, at: servo.error,
    "moving": _moving,
    "goal_position_echo": lambda servo, at: servo.memory["goal_position"],
    "present_current": _current,
}
"""Row -> raw value at this moment (s)."""
