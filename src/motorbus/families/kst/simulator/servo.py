"""One simulated servo: its objects, supply and reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import pi
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.plant import Drive, rest
from motorbus.core.register import Register
from motorbus.errors import RequestError
from motorbus.families.kst import notifications
from motorbus.families.kst.profiles import BIT_RATES, REVERSED, SAVE, Profile, bit_rate_code
from motorbus.families.kst.simulator.motor import Flash, Shaft
from motorbus.families.kst.simulator.quirks import Quirks

OUT_OF_RANGE: Final = 0x0609_0030
TOO_HIGH: Final = 0x0609_0031
TOO_LOW: Final = 0x0609_0032
NOT_STORED: Final = 0x0800_0020  # CiA 301, object 1010h: the reply to a wrong signature
STORED: Final = (
    "node_id",
    "bit_rate_code",
    "mid_point",
    "negative_limit",
    "positive_limit",
    "function_enable",
    "zero",
)
"""What a save keeps: "node id, bit rate, etc." (manual, command 3); travel limits and function byte by a public
flight-controller driver, the mid point by a public demo of a newer protocol; never the target position. `zero` is the
place of the shaft that a mid point sets."""
SOFTWARE: Final = "1.00"  # version in 0x100B # assumption
INTERVAL: Final = 20
"""ms between reports as shipped; the public drivers expect 50 a second. # assumption"""
LOW_VOLTAGE: Final = 6.0  # V; below it the servo sends the alarm # assumption
SPEED: Final = 7.0  # rad/s; 0.15 s for 60 degrees # assumption
ACCELERATION: Final = 100.0  # rad/s² # assumption
DRIVE: Final = Drive(top_speed=1.0, idle_current=0.2, stall_current=2.5)  # currents in A # assumption


class Servo:
    """A simulated servo.

    `unit`      its number on this bus, from 1, whatever its id becomes
    `node`      the id it answers to; `bit_rate` its rate (bit/s)
    `values`    raw values by name, in force until the next restart
    `errors`    bus errors since its restart
    `started`   a start was received
    `lives`     number of restarts; what was to be sent before is not sent
    `reports`   number of changes of its reports; the next one is due by the last change only
    `delay`     s added to its replies
    `temperature` (°C) and `load` (-1 to 1, a share of full torque) may be set
    `extended`  the last request had a 29-bit identifier: unsolicited frames then have one as well

    `send(servo, time, frame)` sends a frame that starts at this time; without a frame `report` makes it then.
    """

    def __init__(
        self,
        unit: int,
        node: int,
        profile: Profile,
        quirks: Quirks,
        now: Callable[[], float],
        send: Callable[[Servo, float, CanFrame | None], None],
    ) -> None:
        self.unit = unit
        self.node = node
        self.bit_rate = quirks.bit_rate
        self.profile = profile
        self.quirks = quirks
        self.plugged = True
        self.errors = self.lives = self.reports = 0
        self.delay = self.load = 0.0
        self.temperature = 25.0
        self.extended = quirks.id_format == "ext"
        self._now = now
        self._send = send
        self._voltage = 7.4
        per_radian = 180 / pi * profile.counts_per_degree
        self.shaft = Shaft(
            now(), quirks.position, speed=SPEED * per_radian, acceleration=ACCELERATION * per_radian
        )
        self._shipped = {row.name: row.default or 0 for row in profile.table.values()}
        shipped = {
            "node_id": node,
            "bit_rate_code": bit_rate_code(quirks.bit_rate),
            "report_interval": INTERVAL,
            "negative_limit": -profile.limit,
            "positive_limit": profile.limit,
        }
        self._shipped |= {name: raw for name, raw in shipped.items() if name in profile.table} | {"zero": 0}
        self.flash = Flash({name: raw for name, raw in self._shipped.items() if name in STORED})
        self._power_up(now())
        self.values["goal_position"] = quirks.position

    # -- for tests and the control socket ------------------------------------------------------------------------

    @property
    def memory(self) -> Mapping[str, int]:
        """The raw value of each row at this time."""
        return {name: self.read(name, self._now()) for name in self.profile.table}

    def unplug(self) -> None:
        """Disconnect bus and supply. The shaft stays."""
        now = self._now()
        self.shaft.halt(now)
        self.flash.load(now, cut=self.quirks.flash_cut)
        self.lives += 1
        self.set_reporting(False, now)
        self.plugged = False

    def plug(self) -> None:
        """Connect bus and supply; no effect if they are connected."""
        if not self.plugged:
            self.plugged = True
            self._power_up(self._now())

    def power_cycle(self) -> None:
        """Restart: what was saved takes effect, the rest is lost."""
        if self.plugged:
            self._power_up(self._now())

    def midway(self) -> float:
        """Time (s) at which half of a save is done; inf without one."""
        return self.flash.midway(self._now())

    def alarm(self, data: bytes = notifications.LOW_VOLTAGE) -> None:
        """Send an alarm of four bytes now."""
        if self.plugged:
            frame = notifications.encode_alarm(self.node, data, extended=self.extended)
            self._send(self, self._now(), frame)

    def status(self) -> dict[str, object]:
        """Its state as plain data; positions in raw counts."""
        now = self._now()
        return {
            "unit": self.unit,
            "node": self.node,
            "pending_node": self.values["node_id"],
            "profile": self.profile.name,
            "plugged": self.plugged,
            "bit_rate": self.bit_rate,
            "pending_bit_rate": BIT_RATES[self.values["bit_rate_code"]],
            "saving": self.flash.saving(now),
            "saved": self.flash.stored(now).items() <= self.values.items(),
            "raw_position": self.raw_position,
            "raw_target": self.values["goal_position"],
            "moving": self.shaft.motion.moving(now),
            "started": self.started,
            "reporting": self.reporting and self._interval > 0,
            "errors": self.errors,
            "voltage": self._voltage,
            "current": self.current(now),
            "temperature": self.temperature,
        }

    @property
    def raw_position(self) -> int:
        """Present position in raw counts; setting it turns the shaft by hand."""
        return self.shaft.reading(self._now())

    @raw_position.setter
    def raw_position(self, raw: int) -> None:
        self.shaft.motion = rest(self._now(), self.shaft.place(raw))

    @property
    def voltage(self) -> float:
        """Supply in V; when it falls below `LOW_VOLTAGE` the servo sends an alarm."""
        return self._voltage

    @voltage.setter
    def voltage(self, volts: float) -> None:
        was_low, self._voltage = self._voltage < LOW_VOLTAGE, volts
        if volts < LOW_VOLTAGE and not was_low:
            self.alarm()

    def load_shaft(self, share: float) -> None:
        """Load the shaft with this share of full torque, -1 to 1."""
        if not -1.0 <= share <= 1.0:
            raise RequestError(f"{share:.0%} is not possible", expected="-100% to 100%")
        self.load = share

    def release_shaft(self) -> None:
        """End the load."""
        self.load = 0.0

    def current(self, at: float) -> float:
        """Supply current, A."""
        return DRIVE.current(self.shaft.motion.velocity(at), self.load) if self.plugged else 0.0

    # -- objects -------------------------------------------------------------------------------------------------

    def read(self, name: str, at: float) -> int:
        """The raw value of an object at this time."""
        match name:
            case "node_id" if self.quirks.pending_id == "active":
                return self.node
            case "present_position":
                return self.shaft.reading(at)
            case "status":  # current (16 bits), temperature (8 bits, signed), one unused byte
                current = min(0xFFFF, round(abs(self.current(at)) / self.profile.current_scale))
                return current | (max(-128, min(127, round(self.temperature))) & 0xFF) << 16
            case "firmware_version" | "software_version":
                return int.from_bytes(self.version(name)[:4], "little")
        return self.values[name]

    def version(self, name: str) -> bytes:
        """The text of a version, the first character first (manual, command 8)."""
        text = self.quirks.firmware if name == "firmware_version" else SOFTWARE
        return text.encode("ascii").ljust(4, b"\0")

    def write(self, row: Register, raw: int, at: float) -> int:
        """Write a raw value; returns the abort code, 0 if it was accepted."""
        values, name = self.values, row.name
        match name:
            case "store":  # the signature "save" (manual, command 3)
                if raw != SAVE or self.quirks.save_reply == "abort":
                    return NOT_STORED
                self.flash.save(values, at, self.quirks.flash_time)
            case "goal_position" | "negative_limit" | "positive_limit":
                clamped = max(row.low, min(row.high, raw))
                if raw != clamped and self.quirks.out_of_range != "clamp":
                    return TOO_HIGH if raw > clamped else TOO_LOW
                if name == "goal_position":
                    self._move(clamped, at)
                else:
                    values[name] = clamped
                    if (
                        self.shaft.reversed
                    ):  # a change of one limit changes the other (flight-controller driver)
                        other = "positive_limit" if name == "negative_limit" else "negative_limit"
                        values[other] = -clamped  # as its mirror image # assumption
            case "report_interval":  # XQPOWER raises a short interval; 0 means none # assumption
                values[name] = max(row.low, raw) if raw or row.low > 1 else 0
                self._interval = values[name] / 1000
                self.set_reporting(self.reporting, at)
            case "mid_point":  # one source writes 0 and one 1, so any value sets it
                self.shaft.set_zero(at)
                values |= {name: raw, "zero": self.shaft.zero, "goal_position": 0}  # it stays # assumption
            case "function_enable":  # bit 5 reverses at once and the shaft stays # assumption
                values[name] = raw
                if bool(raw >> REVERSED & 1) != self.shaft.reversed:
                    self.shaft.halt(at)
                    self.shaft.reversed = not self.shaft.reversed
                    values["goal_position"] = self.shaft.reading(at)
            case _:
                if not row.low <= raw <= row.high:
                    return OUT_OF_RANGE
                values[name] = raw
        return 0

    def _move(self, raw: int, at: float) -> None:
        """Move at once (manual, command 5); before a start XQPOWER acknowledges a target and ignores it."""
        if self.started or self.profile.nmt != "standard":
            limit = self.profile.limit  # clamped to the travel limits # assumption
            low, high = self.values.get("negative_limit", -limit), self.values.get("positive_limit", limit)
            self.values["goal_position"] = max(low, min(high, raw))
            self.shaft.move(self.values["goal_position"], at)

    # -- supply, start and reports -------------------------------------------------------------------------------

    def _power_up(self, at: float) -> None:
        """Load the flash. The shaft stays; the target is the default, 0 (manual, command 5). # assumption"""
        self.lives += 1
        self.values = self._shipped | self.flash.load(at, cut=self.quirks.flash_cut)
        self.node = self.values["node_id"]
        self.bit_rate = BIT_RATES[self.values["bit_rate_code"]]
        self.errors, self.started = 0, False
        self.shaft.halt(at)
        self.shaft.zero = self.values["zero"]
        self.shaft.reversed = bool(self.values.get("function_enable", 0) >> REVERSED & 1)
        self._interval = (self.quirks.reports_ms or self.values.get("report_interval", INTERVAL)) / 1000
        self.set_reporting(self.quirks.reports_ms > 0, at)
        if self.quirks.boot_notice and self.lives > 1:
            self._send(self, at, notifications.encode_boot(self.node, extended=self.extended))
        if self._voltage < LOW_VOLTAGE:
            self.alarm()

    def receive_start(self, order: notifications.Start, at: float) -> None:
        """Start or stop in the form that this servo knows; lost during a save. # assumption"""
        form = self.profile.nmt if self.quirks.nmt == "profile" else self.quirks.nmt
        if form in order.forms and not self.flash.saving(at):
            self.started = order.on
            self.set_reporting(order.on, at)

    def set_reporting(self, on: bool, at: float) -> None:
        """Start or stop the reports; a start begins a new interval."""
        self.reporting = on
        self.reports += 1
        if on and self._interval:
            self._send(self, at + self._interval, None)

    def report(self, at: float) -> CanFrame:
        """The report that is due, under 0x580 + id; XQPOWER sends another one under 0x180 + id, which is left out."""
        self._send(self, at + self._interval, None)
        return notifications.encode_report(self.node, self.shaft.reading(at), extended=self.extended)

    def send(self, frame: CanFrame, at: float) -> None:
        """Send a frame that starts at this time."""
        self._send(self, at, frame)
