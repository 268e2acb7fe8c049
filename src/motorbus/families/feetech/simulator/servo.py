"""One simulated servo: registers, shaft, supply, alarms, and what each instruction does to it.

Overload: more torque than register 36 (SCS: 39) for the time of register 35 (SCS: 38), then the torque falls to
register 34 (SCS: 37). HLS servos have no such registers. Over-current is left out. An alarm that the unload
mask (19) does not name changes nothing else. Source: STS3215 memory table V3.6, SCS memory table 1902.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, tau
from operator import attrgetter
from typing import Any, Final

from motorbus.core import units
from motorbus.core.plant import Motion, move, rest
from motorbus.core.simulated import PoweredDevice
from motorbus.errors import RequestError
from motorbus.families.feetech.protocol import MAX_ID, MAX_PARAMETERS, Instruction, suits
from motorbus.families.feetech.registers.codes import BAUD_CODES, alarms
from motorbus.families.feetech.registers.rows import AMPERE
from motorbus.families.feetech.simulator.memory import Memory
from motorbus.families.feetech.simulator.models import Model
from motorbus.families.feetech.simulator.motor import (
    FEEBLE,
    FULL_ACCELERATION,
    TO_A_PLACE,
    Course,
    Order,
    follow,
)
from motorbus.families.feetech.simulator.quirks import Quirks
from motorbus.families.feetech.traits import Mode

AMBIENT: Final = 30.0  # °C of a servo, whatever it does # assumption
LEAST_SMS_DELAY: Final = 50  # FEETECH page on SMS servos: smaller values of register 7 act as 50
HAND_SPEED: Final = 1.0  # rad/s of a limp shaft that is pushed # assumption
LONGEST_PUSH: Final = 10 * tau
ACCELERATION_UNIT: Final = 100.0  # counts/s² (memory table V3.6; servolab measured 104 to 105)
FARTHEST: Final = 7.5  # turns to a goal over many turns (memory table V3.6: 30719 counts)
BOOTLOADER_TIME: Final = 0.8  # s (kuterd/feetech-fw-util)
RESTORE_TIME: Final = 0.5  # s in which it receives nothing; servolab waits at most 1 s # assumption
MIDDLE: Final = 128  # in torque_enable
VOLTAGE, HEAT, CURRENT, OVERLOAD = 0x01, 0x04, 0x08, 0x20  # alarm bits
LOADED: Final = {
    "torque_limit": "max_torque",  # STS3215 memory table V3.6; FD: SMBL and HLS as well
    "goal_torque": "protection_current",  # HLS memory table, as the three below
    "live_p": "position_p",
    "live_d": "position_d",
    "live_i": "position_i",
}
"""RAM row -> EEPROM row from which it is loaded at power-up."""
CALIBRATING: Final = ("hls", "sts")
"""Maps with 0x0B: FTServo_Python, reOfsCal; dispatcher of STS3215 firmware 3.10 (kuterd/feetech-fw-util)."""
_COUNTING: Final = {"operating_mode", "homing_offset", "phase", "angular_resolution"}
_LIMITS: Final = {"min_position_limit", "max_position_limit"}


def _influence(name: str) -> Any:
    """An attribute that a test may set at any time; the servo then starts a new course."""

    def set_and_move(servo: Servo, value: object) -> None:
        setattr(servo, name, value)
        servo.move()

    return property(attrgetter(name), set_and_move)


class Servo(PoweredDevice):
    """A simulated servo.

    `memory`      its registers; `memory["goal_position"]` is a raw value
    `course`      movement of its shaft, in counts of the encoder without end
    `zero`        the place of the encoder that reads 0
    `pending`     address and data of a REG WRITE
    `lacks`       codes of instructions that it does not know
    `jitter`      bits by which its replies may be late
    `lives`       number of losses of supply and restarts; a reply of an earlier life is not sent
    `deaf_until`  moment (s) before which it receives nothing
    `trips_at`    moment (s) at which the overload protection trips; inf: never
    `error`       the error byte of its status packets: alarms only
    `available`   share of the stall torque that the motor may use, 0 to 1; 0: limp

    A test may set these at any time; the servo then starts a new course:

    `voltage`     supply, V; outside min_voltage to max_voltage it is an alarm
    `temperature` in °C; above max_temperature it is an alarm
    `alarm`       more alarm bits, until a restart
    `load`        share of the stall torque that the outside takes; positive pushes to smaller positions
    `blocked`     places that the shaft cannot leave; None: it is free
    """

    voltage = _influence("_voltage")
    temperature = _influence("_temperature")
    alarm = _influence("_alarm")
    load = _influence("_load")
    blocked = _influence("_blocked")

    def __init__(
        self, id: int, model: Model, quirks: Quirks, now: Callable[[], float], baud_code: int | None
    ) -> None:
        """`baud_code` is stored as the baud rate; None: as shipped."""
        self.model = model
        self.quirks = quirks
        shipped = model.shipped | model.identity
        self.memory = Memory(model.table, shipped, now, quirks.store_time, quirks.torn)
        self.pending: tuple[int, bytes] | None = None
        self.lacks: set[int] = set()
        self.lives = self.jitter = self.zero = self._alarm = 0
        self._voltage, self._temperature = model.voltage, AMBIENT
        self._load, self._blocked = 0.0, None
        self._now = now
        self._traits = model.traits
        self._tripped = False
        self._above = inf, inf  # s in which the torque is above the limit
        position = model.traits.turn // 2 if quirks.position < 0 else quirks.position
        self.course = Course(rest(now(), position))
        # The second id of an HLS is shipped as its first one. # assumption
        for name, raw in {"id": id, "second_id": id, "baud_rate": baud_code}.items():
            if raw is not None and name in model.table:
                self.memory[name] = raw
        self.memory.stored[:] = self.memory.live
        self.power_on()
        self.deaf_until = -inf

    # -- for tests and the control socket ----------------------------------------------------------

    def status(self) -> dict[str, object]:
        """Its state as plain data; positions in raw counts."""
        return {
            "id": self.id,
            "model": self.model.name,
            "plugged": self.plugged,
            "baud_rate": self.baud_rate,
            "raw_position": self.raw_position,
            "raw_goal_position": self.memory["goal_position"],
            "torque_enabled": self.memory["torque_enable"] == 1,
            "moving": self.motion.moving(self._now()),
            "locked": self.memory["lock"] != 0,
            "alarm": list(alarms(self.error, self.model.table.name)),
            "voltage": self.voltage,
            "temperature": self.temperature,
        }

    def midway(self) -> float:
        """The moment (s) at which the EEPROM cell in work is half stored; inf without one."""
        waiting = self.memory.waiting
        return (waiting[0].begin + waiting[0].end) / 2 if waiting else inf

    @property
    def raw_position(self) -> int:
        """Present position in raw counts; setting it turns the shaft by hand."""
        return self.position(self._now())

    @raw_position.setter
    def raw_position(self, raw: int) -> None:
        place = round(self.motion.position(self._now())) + (raw - self.raw_position) * self._resolution
        self._start(Course(rest(self._now(), place)))

    def block_shaft(self, between: tuple[float, float] | None = None) -> None:
        """Block the shaft here, or between two positions (rad).

        Raises RequestError when it is outside of them.
        """
        here, present = round(self.motion.position(self._now())), self.raw_position * self.model.angle
        low, high = sorted(here + self._counts(angle - present) for angle in between or (present, present))
        if not low <= here <= high:
            raise RequestError(
                f"the shaft is at {units.show(present, 'position')}",
                expected="a range that contains this position",
            )
        self.blocked = low, high

    def push_shaft(self, angle: float) -> None:
        """Turn the shaft by hand by an angle (rad): a limp one at 1 rad/s, another one at once; it returns."""
        if abs(angle) > LONGEST_PUSH:
            raise RequestError(f"{units.show(angle, 'position')} is too far", expected="at most 10 turns")
        now = self._now()
        goal = self.motion.position(now) + self._counts(angle)
        if self.blocked is not None:
            goal = min(max(goal, self.blocked[0]), self.blocked[1])
        if self.available >= FEEBLE:
            self.course = Course(rest(now, goal))
            self.move()
        else:
            speed = abs(self._counts(HAND_SPEED))
            self._start(
                Course(move(now, self.motion.position(now), goal, speed=speed, acceleration=10 * speed))
            )

    def load_shaft(self, share: float) -> None:
        """Load the shaft with this share of the stall torque, -1 to 1; positive: to smaller positions."""
        if not -1.0 <= share <= 1.0:
            raise RequestError(f"{share:.0%} is not possible", expected="-100% to 100%")
        self.load = share

    def release_shaft(self) -> None:
        """End block and load."""
        self.load, self.blocked = 0.0, None

    # -- supply ------------------------------------------------------------------------------------

    def power_off(self) -> None:
        """The supply goes: what is not stored is lost, the shaft stays."""
        self.lives += 1
        self.memory.power_off()
        self.available = 0.0
        self._start(self._limp())

    def power_on(self) -> None:
        """The supply comes. An impossible id or baud rate is replaced by the shipped one. # assumption"""
        self.restart()
        for name, possible in (("id", range(MAX_ID + 1)), ("baud_rate", BAUD_CODES)):
            if self.memory[name] not in possible:
                self.memory[name] = self.memory.shipped[self.model.table[name].address]
        self.deaf_until = self._now() + self.quirks.startup_time if self.quirks.startup_time else -inf

    def restart(self) -> None:
        """Start the firmware: limp, within one turn, nothing pending, no alarm (users of STS servos)."""
        now, memory, quirks = self._now(), self.memory, self.quirks
        self.lives += 1
        self.pending, self._alarm, self._tripped = None, 0, False
        self._above = inf, inf
        memory.restart()
        for row, source in LOADED.items():
            if row in self.model.table:
                memory[row] = memory[source]
        memory["lock"] = quirks.lock_at_power_up
        memory["torque_enable"] = quirks.torque_at_power_up
        self.forget_turns()
        if quirks.goal_at_power_up == "present" or quirks.torque_at_power_up:
            memory["goal_position"] = self.position(now)
        self.move()

    # -- settings ----------------------------------------------------------------------------------

    @property
    def id(self) -> int:
        return self.memory.values["id"]

    @property
    def baud_rate(self) -> int | None:
        """Bit/s; None for an unknown code: it receives nothing."""
        # The codes 8 to 11 are rates in all maps. # assumption
        return BAUD_CODES.get(self.memory.values["baud_rate"])

    @property
    def reply_delay(self) -> float:
        """Seconds from request to reply: register 7 in 2 µs (memory table V3.6; HLS has no such row)."""
        steps = self.memory.values.get("return_delay", 0)
        least = LEAST_SMS_DELAY if self.model.table.name in ("smbl", "smcl") else 0
        return max(steps, least) * 2e-6

    @property
    def mode(self) -> Mode | None:
        """None for a code that no source explains."""
        values = self.memory.values
        limits = values["min_position_limit"], values["max_position_limit"]
        return self._traits.mode_of(values.get("operating_mode"), limits)

    @property
    def _resolution(self) -> int:
        """Encoder counts for one count of a position (memory table V3.6)."""
        # It multiplies in single-turn mode too. # assumption
        return self.memory.values.get("angular_resolution") or 1

    @property
    def _current(self) -> float:
        """Goal or limit of the current, a share of that at stall."""
        return self.memory[self._traits.current] * AMPERE / self.model.drive.stall_current

    def receives(self, rate: int | None, at: float) -> bool:
        """Whether it receives a packet of this rate (None: any)."""
        return self.plugged and at >= self.deaf_until and rate in (None, self.baud_rate)

    # -- motion ------------------------------------------------------------------------------------

    @property
    def motion(self) -> Motion:
        return self.course.motion

    def trip(self) -> None:
        """The overload protection trips."""
        self._tripped = True
        self.move()

    def position(self, at: float) -> int:
        """The present position in counts, as its register has it: within one turn without phase bit 4."""
        counts = round((round(self.motion.position(at)) - self.zero) / self._resolution)
        return counts if self._traits.tells_turns(self.memory["phase"]) else counts % self._traits.turn

    def move(self, *, step: bool = False) -> None:
        """Start the course that registers and world ask for now; `step`: the one that a step orders."""
        values, traits, table, mode = self.memory.values, self._traits, self.model.table, self.mode
        self.error = self._alarm | (OVERLOAD if self._tripped else 0)
        if not values["min_voltage"] <= round(self._voltage * 10) <= values["max_voltage"]:
            self.error |= VOLTAGE
        if self._temperature > values["max_temperature"]:
            self.error |= HEAT
        self.available = self._share(mode)
        if self.available < FEEBLE or mode is None:  # an unknown mode rests # assumption
            self._start(self._limp())
            return
        now, phase = self._now(), values["phase"]
        unit = table["goal_velocity"].scale / table["goal_position"].scale
        velocity = values["goal_velocity"] * round(unit) * traits.velocity_scale(phase)
        acceleration = values[traits.acceleration] * ACCELERATION_UNIT if traits.acceleration else 0.0
        goal = 0.0
        match mode:
            case Mode.POSITION:
                goal = self._place(now)
            case Mode.STEP:  # a step counts from the last goal, where it is on its way # assumption
                on_the_way = self.motion.moving(now) and not self.motion.cruise
                goal = self.motion.goal if on_the_way else self.motion.position(now)
                if step:
                    goal = round(goal) + values["goal_position"] * self._resolution
            case Mode.VELOCITY:
                goal = velocity
            case Mode.CURRENT:
                goal = self._current
            case Mode.PWM if traits.duty:  # of HLS the row is not published: nothing moves # assumption
                row = traits.duty_row(table)
                duty = row.decode(self.memory.read(row.address, row.size)) / 1000
                # STS: to smaller angles (servolab, measured); other maps: to larger ones. # assumption
                goal = max(-1.0, min(1.0, duty)) * (-1 if table.name == "sts" else 1)
        order = Order(
            mode=mode,
            goal=goal,
            speed=abs(velocity) or (inf if traits.zero_is_maximum(phase) else 0.0),
            # Only SCS use it; of STS3215 "some firmware" (memory table V3.6), here none. # assumption
            time=0.0 if traits.modes else values[traits.time] / 1000,
            acceleration=acceleration or FULL_ACCELERATION,
            torque=self.available,
            load=self._load,
            blocked=self._blocked,
        )
        self._start(follow(order, self.motion, now, self.model.drive))

    def _share(self, mode: Mode | None) -> float:
        """The torque that registers and alarms leave. An HLS with goal_torque 0 is limp (seen on hardware)."""
        values, traits = self.memory.values, self._traits
        if not self.plugged or values["torque_enable"] != 1:
            return 0.0
        share = values[traits.limit or "max_torque"] / 1000
        if traits.current and mode in (Mode.POSITION, Mode.VELOCITY):
            share = min(share, abs(self._current))
        releasing = self.error & values["unload_mask"]
        if releasing & OVERLOAD and not self._alarm & OVERLOAD:
            share = min(share, self._value("protective_torque"))
            releasing &= ~OVERLOAD
        return 0.0 if releasing else min(share, 1.0)

    def _limp(self) -> Course:
        now = self._now()
        return Course(rest(now, self.motion.position(now)))

    def _start(self, course: Course) -> None:
        """Follow this course; the overload protection watches it."""
        self.course, now = course, self._now()
        limit, duration = self._value("overload_torque"), self._value("overload_time")
        begin, until = inf, inf
        if limit and duration:  # an overload torque or time of 0 protects from nothing # assumption
            lasts = abs(course.torque(inf)) > limit
            if abs(course.load) > limit:
                begin, until = now, inf if lasts else course.motion.done_at
            elif lasts:
                begin = max(now, course.motion.done_at)
        first, last = self._above
        if begin == now and first <= now <= last:
            begin = first  # above the limit without a break
        self._above = begin, until
        trip = begin + duration
        self.trips_at = max(now, trip) if trip <= until and not self._tripped else inf

    def _value(self, name: str) -> float:
        """The value of a row in its unit; 0 where the map has no such row."""
        raw = self.memory.values.get(name, 0)
        return raw * self.model.table[name].scale if raw else 0.0

    def _place(self, now: float) -> float:
        """The place of goal_position; within one turn the way does not cross the seam (STS_servos#7)."""
        # A goal beyond the limits is clamped. # assumption
        values = self.memory.values
        goal, low, high = (
            values[name] for name in ("goal_position", "min_position_limit", "max_position_limit")
        )
        if low == high == 0 and self._traits.many_turns:
            farthest = int(FARTHEST * self._traits.turn) - 1
            return self.zero + max(-farthest, min(goal, farthest)) * self._resolution
        goal = max(low, min(goal, high))
        return round(self.motion.position(now)) + (goal - self.position(now)) * self._resolution

    def _counts(self, angle: float) -> float:
        """An angle (rad) in counts of the encoder."""
        return angle / self.model.angle * self._resolution

    def forget_turns(self) -> None:
        """Stand still, within the first turn."""
        now = self._now()
        self.course = Course(rest(now, self.motion.position(now) % self._traits.turn))
        self.set_zero()

    def set_zero(self) -> None:
        """Apply the homing offset, in position mode only (feetech-cli, servolab, on STS3215)."""
        now, memory, turn = self._now(), self.memory, self._traits.turn
        applies = "homing_offset" in self.model.table and self.mode is Mode.POSITION
        offset = memory["homing_offset"] * self._resolution if applies else 0
        counts = round(self.motion.position(now))
        self.zero = counts - (counts - offset) % turn

    # -- requests ----------------------------------------------------------------------------------

    def read(self, address: int, count: int) -> bytes:
        """The bytes of a READ."""
        for row in self.memory.touched(address, count):
            if row.name in FEEDBACK:
                self.memory[row.name] = FEEDBACK[row.name](self, self._now())
        return self.memory.read(address, count)

    def write(self, address: int, data: bytes) -> None:
        """Obey a WRITE."""
        memory, traits, quirks = self.memory, self._traits, self.quirks
        torque = memory["torque_enable"]
        names = memory.write(address, data, locked=memory["lock"] != 0, strict=quirks.out_of_range == "drop")
        if "torque_enable" in names:
            switch = memory["torque_enable"]
            if switch == MIDDLE and traits.modes and traits.calibrates == "offset":
                memory["torque_enable"] = torque  # 128 is a command and does not stay # assumption
                self.calibrate(traits.turn // 2)
                return
            if not switch and quirks.overload_clears == "torque_off":
                self._tripped, self._above = False, (inf, inf)
                self._alarm &= ~(OVERLOAD | CURRENT)
        if names & _COUNTING or (not traits.modes and names & _LIMITS):
            self.set_zero()
        ordered = "goal_position" in names
        if ordered and traits.goal_switches_on and self.mode in TO_A_PLACE:
            memory["torque_enable"] = 1
        if names - {"lock"}:
            self.move(step=ordered)

    def carry_out(self, code: int, parameters: bytes, at: float) -> bytes | None:
        """Carry out an instruction; returns the parameters of the reply, None: no reply.

        An unknown instruction and a wrong number of parameters are not answered: there is no error code for them
        (FEETECH serial bus servo protocol manual V1.01, 1.1 and 1.3).
        """
        traits = self._traits
        if code in self.lacks:
            return None
        if code in (Instruction.WRITE, Instruction.REG_WRITE) and len(parameters) == 1:
            return b""  # a write without data is acknowledged # assumption
        if not suits(code, parameters):
            return None
        match code:
            case Instruction.PING:
                pass
            case Instruction.READ:
                address, count = parameters
                return self.read(address, count) if count <= MAX_PARAMETERS else None
            case Instruction.WRITE:
                self.write(parameters[0], parameters[1:])
            case Instruction.REG_WRITE:  # a second REG WRITE replaces the first # assumption
                self.pending = parameters[0], parameters[1:]
            case Instruction.ACTION:
                pending, self.pending = self.pending, None
                if pending is not None:
                    self.write(*pending)
            case Instruction.RESET if self.quirks.factory_restore:
                # All as shipped but the id (servolab, STS3215 with firmware 3.10), then a restart.
                # The second id stays as well. # assumption
                self.memory.restore_factory(("id", "second_id"), RESTORE_TIME)
                self.restart()
                self.deaf_until = at + RESTORE_TIME
            case Instruction.BOOTLOADER:  # 0x08 is not answered, and the motor is limp meanwhile # assumption
                self.restart()
                self.deaf_until = at + BOOTLOADER_TIME
                return None
            # HLS (FTServo_Python, hls/reset.py), and brushless models (a public STS3215 table: "STBL")
            case Instruction.CLEAR_TURNS if traits.clear_turns and (
                self.model.table.name == "hls" or self.model.name.endswith("bl")
            ):
                self.forget_turns()
                self._hold()
            case Instruction.CALIBRATE if self.model.table.name in CALIBRATING:
                self.calibrate(int.from_bytes(parameters, "little") if parameters else traits.turn // 2)
            case _:
                return None
        return b""

    def calibrate(self, counts: int) -> None:
        """Give the present pose this position by the homing offset, cut to the range of its row; then hold.

        At one pose an STS is one count beside (lerobot#3370).
        """
        memory, turn, row = self.memory, self._traits.turn, self.model.table["homing_offset"]
        difference = round(self.motion.position(self._now())) - counts * self._resolution
        offset = round(((difference + turn // 2) % turn - turn // 2) / self._resolution)
        memory["homing_offset"] = max(row.low, min(row.high, offset))
        if not memory["lock"]:  # the offset of a calibration is stored only with the lock open # assumption
            memory.store(range(row.address, row.address + row.size), self.quirks.store_time)
        self.set_zero()
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


def _load(servo: Servo, at: float) -> int:
    """The duty of the motor, in 0.1 %."""
    if servo.available < FEEBLE:
        return 0
    return round(1000 * servo.model.drive.duty(servo.motion.velocity(at), servo.course.torque(at)))


def _current(servo: Servo, at: float) -> int:
    if servo.available < FEEBLE or not servo.model.traits.tells_current(servo.memory["phase"]):
        return 0
    return round(servo.model.drive.current(servo.motion.velocity(at), servo.course.torque(at)) / AMPERE)


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
    "present_load": _load,
    "present_voltage": lambda servo, at: round(servo.voltage * 10),
    "present_temperature": lambda servo, at: round(servo.temperature),
    "reg_write_pending": lambda servo, at: int(servo.pending is not None),
    "hardware_error": lambda servo, at: servo.error,
    "moving": _moving,
    "goal_position_echo": lambda servo, at: servo.memory["goal_position"],
    "present_current": _current,
}
"""Row -> raw value at this moment (s)."""
