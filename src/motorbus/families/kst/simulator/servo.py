"""One simulated servo: its objects, supply and reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import pi
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.plant import Drive, move, rest
from motorbus.core.register import Register, Storage
from motorbus.core.simulated import PoweredDevice
from motorbus.errors import RequestError
from motorbus.families.kst import notifications
from motorbus.families.kst.profiles import BIT_RATES, REVERSED, SAVE, Profile, bit_rate_code
from motorbus.families.kst.simulator.flash import Flash
from motorbus.families.kst.simulator.quirks import Quirks

OUT_OF_RANGE: Final = 0x0609_0030
TOO_HIGH: Final = 0x0609_0031
TOO_LOW: Final = 0x0609_0032
NOT_STORED: Final = 0x0800_0020  # CiA 301, object 1010h: the reply to a wrong signature
SOFTWARE: Final = "1.00"  # version in 0x100B # assumption
INTERVAL: Final = 20
"""ms between reports as shipped; the public drivers expect 50 a second. # assumption"""
LOW_VOLTAGE: Final = 6.0  # V; below it the servo sends the alarm # assumption
ACCELERATION: Final = 100.0  # rad/s² # assumption
DRIVE: Final = Drive(top_speed=1.0, idle_current=0.2, stall_current=2.5)  # currents in A # assumption


class Servo(PoweredDevice):
    """A simulated servo.

    `unit`            its number on this bus, from 1, whatever its id becomes
    `node`            the id it answers to; `bit_rate` its rate (bit/s)
    `values`          raw values by name, in force until the next restart; "zero" is the place of the shaft that reads 0
    `motion`          of the shaft, in raw counts
    `errors`          bus errors since its restart
    `started`         a start was received
    `power_losses`    number of losses of supply; what was to be sent before is not sent
    `report_changes`  number of starts and stops of its reports; the next report is due by the last one only
    `delay`           s added to its replies
    `temperature`     (°C) and `load` (-1 to 1, a share of full torque) may be set
    `extended`        the last request had a 29-bit identifier: the frames of the servo then have one as well

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
        self.errors = self.power_losses = self.report_changes = 0
        self.delay = self.load = 0.0
        self.temperature = 25.0
        self.extended = quirks.id_format == "ext"
        self._now = now
        self.send = send
        self._voltage = 7.4
        self.motion = rest(now(), quirks.position)
        self._shipped = {row.name: row.default or 0 for row in profile.table.values()} | {
            "node_id": node,
            "bit_rate_code": bit_rate_code(quirks.bit_rate),
            "report_interval": INTERVAL,
            "negative_limit": -profile.limit,
            "positive_limit": profile.limit,
            "function_enable": 0,
            "zero": 0,
        }
        kept = [row.name for row in profile.table.values() if row.storage is Storage.EEPROM]
        self.flash = Flash({name: self._shipped[name] for name in (*kept, "zero")})
        self.power_on()
        self.values["goal_position"] = quirks.position

    # -- for tests and the control socket ------------------------------------------------------------------------

    @property
    def memory(self) -> Mapping[str, int]:
        """The raw value of each row at this time."""
        return {name: self.read(name, self._now()) for name in self.profile.table}

    def midway(self) -> float:
        """Time (s) at which half of a save is done; inf without one."""
        return self.flash.midway(self._now())

    def alarm(self, data: bytes = notifications.LOW_VOLTAGE) -> None:
        """Send an alarm of four bytes now."""
        if self.plugged:
            self.send(self, self._now(), notifications.encode_alarm(self.node, data))

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
            "moving": self.motion.moving(now),
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
        return self._reading(self._now())

    @raw_position.setter
    def raw_position(self, raw: int) -> None:
        self.motion = rest(self._now(), self._place(raw))

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
        return DRIVE.current(self.motion.velocity(at), self.load) if self.plugged else 0.0

    # -- objects -------------------------------------------------------------------------------------------------

    def read(self, name: str, at: float) -> int:
        """The raw value of an object at this time."""
        match name:
            case "node_id" if self.quirks.pending_id == "active":
                return self.node
            case "present_position":
                return self._reading(at)
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
                    if self._reversed:  # a change of one limit changes the other (flight-controller driver)
                        other = "positive_limit" if name == "negative_limit" else "negative_limit"
                        values[other] = -clamped  # a reversed servo mirrors a changed limit # assumption
            case "report_interval":  # XQPOWER raises a short interval; 0 means none # assumption
                values[name] = max(row.low, raw) if raw or row.low > 1 else 0
                self._interval = values[name] / 1000
                self.set_reporting(self.reporting, at)
            case "mid_point":  # one source writes 0 and one 1, so any value sets it
                place = round(self.motion.position(at))
                self.motion = rest(at, place)
                values |= {
                    name: raw,
                    "zero": place,
                    "goal_position": 0,
                }  # it stays at a new mid point # assumption
            case "function_enable":  # bit 5 reverses at once and the shaft stays # assumption
                turned = (raw ^ values[name]) >> REVERSED & 1
                values[name] = raw
                if turned:
                    self.motion = rest(at, self.motion.position(at))
                    values["goal_position"] = self._reading(at)
            case _:
                if not row.low <= raw <= row.high:
                    return OUT_OF_RANGE
                values[name] = raw
        return 0

    def _move(self, raw: int, at: float) -> None:
        """Move at once (manual, command 5); before a start XQPOWER acknowledges a target and ignores it."""
        if self.started or self.profile.nmt != "standard":
            low, high = self.values["negative_limit"], self.values["positive_limit"]
            goal = self.values["goal_position"] = max(
                low, min(high, raw)
            )  # clamped to the limits # assumption
            position, velocity, _ = self.motion.state(at)
            unit = 180 / pi * self.profile.counts_per_degree  # counts per rad
            limits = {"speed": self.quirks.speed * unit, "acceleration": ACCELERATION * unit}
            self.motion = move(at, position, self._place(goal), velocity=velocity, **limits)

    @property
    def _reversed(self) -> bool:
        return bool(self.values["function_enable"] >> REVERSED & 1)

    def _reading(self, at: float) -> int:
        """Present position: a whole number of counts that fits 16 bits."""
        counts = round(self.motion.position(at)) - self.values["zero"]
        return max(-32768, min(32767, -counts if self._reversed else counts))

    def _place(self, raw: int) -> int:
        """The place of the shaft with this reading."""
        return self.values["zero"] + (-raw if self._reversed else raw)

    # -- supply, start and reports -------------------------------------------------------------------------------

    def power_off(self) -> None:
        """A save in progress is cut; the shaft stays."""
        now = self._now()
        self.motion = rest(now, self.motion.position(now))
        self.flash.lose_power(now, self.quirks.flash_cut)
        self.power_losses += 1
        self.set_reporting(False, now)

    def power_on(self) -> None:
        """Load the flash. After a restart the target is the default, 0 (manual, command 5). # assumption"""
        at = self._now()
        self.values = self._shipped | self.flash.stored(at)
        self.node = self.values["node_id"]
        self.bit_rate = BIT_RATES[self.values["bit_rate_code"]]
        self.errors, self.started = 0, False
        self._interval = (self.quirks.reports_ms or self.values["report_interval"]) / 1000
        self.set_reporting(self.quirks.reports_ms > 0, at)
        if self.quirks.boot_notice and self.power_losses:
            self.send(self, at, notifications.encode_boot(self.node))
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
        self.report_changes += 1
        if on and self._interval:
            self.send(self, at + self._interval, None)

    def report(self, at: float) -> CanFrame:
        """The report that is due, under 0x580 + id; XQPOWER sends another one under 0x180 + id, which is left out."""
        self.send(self, at + self._interval, None)
        return notifications.encode_report(self.node, self._reading(at))._replace(extended=self.extended)
