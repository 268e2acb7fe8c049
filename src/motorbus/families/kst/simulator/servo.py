"""One simulated servo: its objects, supply and reports."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import inf, pi
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.plant import Drive
from motorbus.core.register import Register
from motorbus.errors import RequestError
from motorbus.families.kst import notifications
from motorbus.families.kst.profiles import BIT_RATES, REVERSED, SAVE, Profile
from motorbus.families.kst.simulator.motor import Flash, Shaft
from motorbus.families.kst.simulator.quirks import Quirks

OUT_OF_RANGE: Final = 0x0609_0030
TOO_HIGH: Final = 0x0609_0031
TOO_LOW: Final = 0x0609_0032
NOT_STORED: Final = 0x0800_0020
"""CiA 301, object 1010h: the reply to a wrong signature."""
SOFTWARE: Final = "1.00"
"""Version in 0x100B. # assumption"""
INTERVAL: Final = 20
"""ms between reports as shipped; the public drivers expect 50 a second. # assumption"""
LOW_VOLTAGE: Final = 6.0
"""V; below it the servo sends the alarm. # assumption"""
ACCELERATION: Final = 100.0
"""rad/s². # assumption"""
DRIVE: Final = Drive(top_speed=1.0, idle_current=0.2, stall_current=2.5)
"""Currents in A. # assumption"""


class Servo:
    """A simulated servo.

    `unit`      its number on this bus, from 1, whatever its id becomes
    `node`      the id it answers to; `bit_rate` its rate (bit/s)
    `values`    raw values by name, in force until the next restart
    `memory`    the raw value of each row as a host reads it
    `errors`    bus errors since its restart
    `started`   a start was received; `lives` counts its restarts
    `delay`     s added to its replies; `busy_until` is when its last reply began
    `temperature` (°C) and `load` (-1 to 1, a share of full torque) may be set
    `extended`  the last request had a 29-bit identifier: unsolicited frames then have one as well
    `changed`   is called when its id, rate, plug or reports change
    """

    def __init__(
        self,
        unit: int,
        node: int,
        profile: Profile,
        quirks: Quirks,
        now: Callable[[], float],
        send: Callable[[Servo, float, CanFrame], None],
    ) -> None:
        self.changed: Callable[[], None] = lambda: None
        self.unit = unit
        self.profile = profile
        self.quirks = quirks
        self.delay = 0.0
        self.busy_until = -inf
        self.errors = 0
        self.lives = 0
        self.started = False
        self.temperature = 25.0
        self.load = 0.0
        self.extended = quirks.id_format == "ext"
        self._now = now
        self._send = send
        self._voltage = 7.4
        self._plugged = True
        self._interval = 0.0
        self._reports_from = inf
        self._reported = 0
        per_radian = 180 / pi * profile.counts_per_degree
        self.shaft = Shaft(
            now(),
            quirks.position,
            speed=quirks.speed * per_radian,
            acceleration=ACCELERATION * per_radian,
        )
        self._factory = _factory(node, profile, quirks)
        self.flash = Flash(self._factory)
        self.values: dict[str, int] = {}
        self._node, self._bit_rate = node, quirks.bit_rate
        self._power_up(now())
        self.values["goal_position"] = quirks.position

    # -- for tests and the control socket ------------------------------------------------------------------------

    @property
    def memory(self) -> Mapping[str, int]:
        """The raw value of each row at this time."""
        return _Memory(self, self._now)

    @property
    def node(self) -> int:
        return self._node

    @node.setter
    def node(self, node: int) -> None:
        self._node = node
        self.changed()

    @property
    def bit_rate(self) -> int:
        return self._bit_rate

    @bit_rate.setter
    def bit_rate(self, rate: int) -> None:
        self._bit_rate = rate
        self.changed()

    @property
    def plugged(self) -> bool:
        """Its cable is connected."""
        return self._plugged

    @plugged.setter
    def plugged(self, yes: bool) -> None:
        self._plugged = yes
        self.changed()

    def unplug(self) -> None:
        """Disconnect bus and supply. The shaft stays."""
        now = self._now()
        self.shaft.halt(now)
        self.flash.load(now, cut=self.quirks.flash_cut)
        self.lives += 1
        self._reports_from = inf
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
            "reporting": self.report_due() is not None,
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
        self.shaft.turn_by_hand(raw, self._now())

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
            case "firmware_version":
                return int.from_bytes(self.quirks.firmware.encode()[:4], "little")
            case "software_version":
                return int.from_bytes(SOFTWARE.encode()[:4], "little")
            case _:
                return self.values[name]

    def write(self, row: Register, raw: int, at: float) -> int:
        """Write a raw value; returns the abort code, 0 if it was accepted."""
        values, name = self.values, row.name
        match name:
            case "store":  # the signature "save" (manual, command 3)
                values[name] = raw
                if raw != SAVE or self.quirks.save_reply == "abort":
                    return NOT_STORED
                self.flash.save(values, at, self.quirks.flash_time)
            case "goal_position":
                return self._write_goal(raw, at)
            case "negative_limit" | "positive_limit":
                raw, code = self._into_range(raw, row.low, row.high)
                if code:
                    return code
                values[name] = raw
                if self.shaft.reversed:  # a change of one limit changes the other (flight-controller driver)
                    other = "positive_limit" if name == "negative_limit" else "negative_limit"
                    values[other] = -raw  # as its mirror image # assumption
            case "report_interval":  # XQPOWER raises a short interval; 0 means none # assumption
                if raw or row.low > 1:
                    raw = max(row.low, raw)
                values[name] = raw
                self.report_every(raw / 1000, at)
            case "mid_point":  # one source writes 0 and one 1, so any value sets it
                self.shaft.set_zero(at)
                values[name], values["zero"] = raw, self.shaft.zero
                values["goal_position"] = self.shaft.reading(at)  # the target stays here # assumption
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

    def _write_goal(self, raw: int, at: float) -> int:
        """It takes effect at once (manual, command 5); before a start XQPOWER acknowledges and ignores it."""
        limit = self.profile.limit
        raw, code = self._into_range(raw, -limit, limit)
        if code:
            return code
        if self.accepts_targets:
            low, high = self.travel
            self.values["goal_position"] = max(
                low, min(high, raw)
            )  # clamped to the travel limits # assumption
            self.shaft.move(self.values["goal_position"], at)
        return 0

    def _into_range(self, raw: int, low: int, high: int) -> tuple[int, int]:
        """The value to use and 0, or the value and the abort code."""
        if low <= raw <= high:
            return raw, 0
        if self.quirks.out_of_range == "clamp":
            return max(low, min(high, raw)), 0
        return raw, TOO_HIGH if raw > high else TOO_LOW

    # -- frames of the host --------------------------------------------------------------------------------------

    def receives_at(self, rate: int | None) -> bool:
        """It is connected and set to this rate (None: any rate)."""
        return self.plugged and (rate is None or rate == self.bit_rate)

    def takes(self, extended: bool) -> bool:
        """It accepts this identifier format."""
        return self.quirks.id_format in ("asked", "ext" if extended else "std")

    def send(self, frame: CanFrame, at: float) -> None:
        """Send a frame that starts at this time."""
        self._send(self, at, frame)

    def receive_start(self, order: notifications.Start, at: float) -> None:
        """Start or stop in the form that this servo knows; lost during a save. # assumption"""
        form = self.profile.nmt if self.quirks.nmt == "profile" else self.quirks.nmt
        if form in order.forms and not self.flash.saving(at):
            self.started = order.on
            self._set_reporting(order.on, at)

    @property
    def accepts_targets(self) -> bool:
        """Whether a target moves it: XQPOWER must be started first (public XQPOWER module)."""
        return self.started or self.profile.nmt != "standard"

    @property
    def travel(self) -> tuple[int, int]:
        """The travel limits in force, raw."""
        limit = self.profile.limit
        return self.values.get("negative_limit", -limit), self.values.get("positive_limit", limit)

    # -- reports -------------------------------------------------------------------------------------------------

    def report_every(self, seconds: float, at: float) -> None:
        """Set the interval of reports; 0: none."""
        self._interval = seconds
        self.changed()
        if self._reports_from < inf:
            self._set_reporting(True, at)

    def report_due(self) -> float | None:
        """Time (s) of the next report, or None."""
        if self._reports_from == inf or not self._interval:
            return None
        return self._reports_from + self._interval * (self._reported + 1)

    def begin(self, at: float) -> None:
        """The clock begins: so do reports from power-up on."""
        if self._reports_from < inf:
            self._set_reporting(True, at)

    def report(self, at: float) -> CanFrame:
        """The report that is due, under 0x580 + id; XQPOWER sends another one under 0x180 + id, which is left out."""
        self._reported += 1
        return notifications.encode_report(self.node, self.shaft.reading(at), extended=self.extended)

    def _set_reporting(self, on: bool, at: float) -> None:
        self._reports_from, self._reported = (at if on else inf), 0
        self.changed()

    def _power_up(self, at: float) -> None:
        """Load the flash. The shaft stays; the target is the default, 0 (manual, command 5). # assumption"""
        self.lives += 1
        self.values = self._factory | self.flash.load(at, cut=self.quirks.flash_cut)
        self.node = self.values["node_id"]
        self.bit_rate = BIT_RATES[self.values["bit_rate_code"]]
        self.errors, self.busy_until, self.started = 0, -inf, False
        self.shaft.halt(at)
        self.shaft.zero = self.values["zero"]
        self.shaft.reversed = bool(self.values.get("function_enable", 0) >> REVERSED & 1)
        interval = self.quirks.reports_ms or self.values.get("report_interval", INTERVAL)
        self._interval = interval / 1000
        self._set_reporting(bool(self.quirks.reports_ms), at)
        if self.quirks.boot_notice and self.lives > 1:
            self._send(self, at, notifications.encode_boot(self.node, extended=self.extended))
        if self._voltage < LOW_VOLTAGE:
            self.alarm()


class _Memory(Mapping[str, int]):
    def __init__(self, servo: Servo, now: Callable[[], float]) -> None:
        self._servo = servo
        self._now = now

    def __getitem__(self, name: str) -> int:
        return self._servo.read(self._servo.profile.table[name].name, self._now())

    def __iter__(self) -> Iterator[str]:
        return iter(self._servo.profile.table)

    def __len__(self) -> int:
        return len(self._servo.profile.table)


def _factory(node: int, profile: Profile, quirks: Quirks) -> dict[str, int]:
    """Raw values of all rows as shipped, with this id and rate."""
    codes = {rate: code for code, rate in BIT_RATES.items()}
    special = {
        "node_id": node,
        "bit_rate_code": codes[quirks.bit_rate],
        "report_interval": INTERVAL,
        "negative_limit": -profile.limit,
        "positive_limit": profile.limit,
    }
    return {row.name: special.get(row.name, row.default or 0) for row in profile.table.values()} | {"zero": 0}
