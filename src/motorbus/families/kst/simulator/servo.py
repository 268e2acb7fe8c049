"""One simulated servo: its SDO server, objects, flash, supply and reports.

The manual comes first; CiA 301 fills its gaps.
The order of the checks of a request is object, access, length, value, as in common CANopen servers. # assumption
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf, pi
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.plant import Drive, move, rest
from motorbus.core.register import Register, Storage
from motorbus.core.simulated import PoweredDevice
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.profiles import RATES, REVERSED, SAVE, Profile, bit_rate_code
from motorbus.families.kst.simulator.quirks import Quirks

UNKNOWN_COMMAND: Final = 0x0504_0001
WRITE_ONLY: Final = 0x0601_0001
READ_ONLY: Final = 0x0601_0002
NO_OBJECT: Final = 0x0602_0000
OTHER_LENGTH: Final = 0x0607_0010
TOO_LONG: Final = 0x0607_0012
TOO_SHORT: Final = 0x0607_0013
NO_SUBINDEX: Final = 0x0609_0011
OUT_OF_RANGE: Final = 0x0609_0030
TOO_HIGH: Final = 0x0609_0031
TOO_LOW: Final = 0x0609_0032
NOT_STORED: Final = 0x0800_0020  # CiA 301, object 1010h: the reply to a wrong signature
TURNAROUND: Final = 0.0001  # s from the end of a request to the start of its reply # assumption
FLASH_TIME: Final = 0.15  # s that a save takes; a public autopilot driver leaves 150 ms
VERSION: Final = int.from_bytes(b"V1.2", "little")  # of firmware and software # assumption
INTERVAL: Final = 20
"""ms between reports as shipped; the public drivers expect 50 a second. # assumption"""
SPEED: Final = 7.0  # rad/s; 0.15 s for 60 degrees is usual # assumption
ACCELERATION: Final = 100.0  # rad/s² # assumption
DRIVE: Final = Drive(top_speed=1.0, idle_current=0.2, stall_current=2.5)  # currents in A # assumption


class Servo(PoweredDevice):
    """A simulated servo.

    `unit`         its number on this bus, from 1, whatever its id becomes
    `node`         the id it answers to; `bit_rate` its rate (bit/s)
    `values`       raw values by name, in force until the next restart; "zero" is the place of the shaft that reads 0
    `motion`       of the shaft, in raw counts
    `started`      a start was received
    `delay`        s added to its replies
    `temperature`  (°C), `load` (-1 to 1, a share of full torque) and `speed` (rad/s) may be set
    `extended`     the last request had a 29-bit identifier: the frames of the servo then have one as well
    """

    def __init__(
        self,
        unit: int,
        node: int,
        profile: Profile,
        quirks: Quirks,
        now: Callable[[], float],
    ) -> None:
        self.unit, self.node, self.bit_rate = unit, node, quirks.bit_rate
        self.profile, self.quirks = profile, quirks
        self.delay = self.load = 0.0
        self._busy_until = self._saved_at = -inf
        self.temperature, self.speed = 25.0, SPEED
        self.extended = quirks.id_format == "ext"
        self.motion = rest(now(), 0)
        self._now = now
        self._shipped = {row.name: row.default or 0 for row in profile.table.values()} | {
            "node_id": node,
            "bit_rate_code": bit_rate_code(quirks.bit_rate),
            "report_interval": INTERVAL,
            "negative_limit": -profile.limit,
            "positive_limit": profile.limit,
            "firmware_version": VERSION,
            "software_version": VERSION,
            "zero": 0,
        }
        kept = [row.name for row in profile.table.values() if row.storage is Storage.EEPROM]
        self._old = self._new = {name: self._shipped[name] for name in (*kept, "zero")}
        self.power_on()

    # -- for tests and the control socket ------------------------------------------------------------------------

    @property
    def memory(self) -> Mapping[str, int]:
        """The raw value of each row at this time."""
        return {name: self.read(name, self._now()) for name in self.profile.table}

    def status(self) -> dict[str, object]:
        """Its state as plain data; positions in raw counts."""
        now = self._now()
        return {
            "unit": self.unit,
            "node": self.node,
            "profile": self.profile.name,
            "plugged": self.plugged,
            "bit_rate": self.bit_rate,
            "saving": self.saving(now),
            "saved": self.stored(now).items() <= self.values.items(),
            "raw_position": self.raw_position,
            "raw_target": self.values["goal_position"],
            "moving": self.motion.moving(now),
            "started": self.started,
            "reporting": self._report_at < inf,
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

    # -- requests ------------------------------------------------------------------------------------------------

    def receive(self, frame: CanFrame, request: sdo.Sdo | None, at: float) -> None:
        """Carry out a request (None: not known) and reply, one after the other."""
        self.extended = frame.extended
        if self.saving(at):
            return  # lost (autopilot driver)
        index, subindex = int.from_bytes(frame.data[1:3], "little"), frame.data[3]
        reply = UNKNOWN_COMMAND if request is None else self._answer(request, at)
        if isinstance(reply, int):  # an abort repeats index (manual, command 9) and sub-index # assumption
            reply = sdo.encode_abort_reply(self.node, index, subindex, reply)
        if reply is not None:
            self._busy_until = max(at, self._busy_until) + TURNAROUND
            reply = reply._replace(extended=self.extended)
            self._outbox.append((self._busy_until + self.delay, reply))

    def _answer(self, request: sdo.Sdo, at: float) -> CanFrame | int | None:
        """The reply to this request, an abort code, or None for no reply.

        The data bytes of a read are ignored (manual, command 4; reserved in CiA 301).
        """
        kind, index, subindex, data, size = request
        if kind == "abort":
            return None
        row = self.profile.table.at(index, subindex)
        if row is None:
            return NO_SUBINDEX if index in [one.address for one in self.profile.table.values()] else NO_OBJECT
        if kind == "upload":
            if not row.readable:
                return WRITE_ONLY
            value = self.read(row.name, at) & (1 << 8 * row.size) - 1
            return sdo.encode_upload_reply(self.node, index, subindex, value.to_bytes(row.size, "little"))
        if not row.writable:
            return READ_ONLY
        if size is not None and self.quirks.sized == "no":
            return UNKNOWN_COMMAND
        if size not in (None, row.size):
            return TOO_LONG if len(data) > row.size else TOO_SHORT
        if size is None and self.quirks.sized == "yes" and row.size != sdo.EXPEDITED:
            return OTHER_LENGTH
        # Without a stated length the size of the object counts, and the other bytes are ignored (CiA 301).
        code = self.write(row, row.decode(data[: row.size]), at)
        if code or (row.name == "store" and self.quirks.save_reply == "none"):
            return code or None
        return sdo.encode_download_reply(self.node, index, subindex)

    # -- objects -------------------------------------------------------------------------------------------------

    def read(self, name: str, at: float) -> int:
        """The raw value of an object at this time. Before a restart the node id is the one written. # assumption"""
        match name:
            case "present_position":
                return self._reading(at)
            case "status":  # current (16 bits), temperature (8 bits, signed), one unused byte
                current = min(0xFFFF, round(abs(self.current(at)) / self.profile.current_scale))
                return current | (max(-128, min(127, round(self.temperature))) & 0xFF) << 16
        return self.values[name]

    def write(self, row: Register, raw: int, at: float) -> int:
        """Write a raw value; returns the abort code, 0 if it was accepted."""
        values, name = self.values, row.name
        match name:
            case "store":  # the signature "save" (manual, command 3)
                if raw != SAVE or self.quirks.save_reply == "abort":
                    return NOT_STORED
                self._save(at)
            case "goal_position" | "negative_limit" | "positive_limit":
                clamped = max(row.low, min(row.high, raw))
                if raw != clamped and self.quirks.out_of_range != "clamp":
                    return TOO_HIGH if raw > clamped else TOO_LOW
                if name == "goal_position":
                    self._move(clamped, at)
                    return 0
                values[name] = clamped
                if self._reversed:  # a change of one limit changes the other (autopilot driver)
                    other = "positive_limit" if name == "negative_limit" else "negative_limit"
                    values[other] = -clamped  # a reversed servo mirrors a changed limit # assumption
            case "report_interval":  # XQPOWER raises a short interval; 0 means none # assumption
                values[name] = max(row.low, raw) if raw or row.low > 1 else 0
                if self._report_at < inf:
                    self._set_reporting(at)
            case "mid_point":  # one source writes 0 and one 1, so any value sets it
                place = round(self.motion.position(at))
                self.motion = rest(at, place)  # it stays at a new mid point # assumption
                values |= {name: raw, "zero": place, "goal_position": 0}
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
            goal = max(low, min(high, raw))  # clamped to the limits # assumption
            self.values["goal_position"] = goal
            position, velocity, _ = self.motion.state(at)
            unit = 180 / pi * self.profile.counts_per_degree  # counts per rad
            limits = {"speed": self.speed * unit, "acceleration": ACCELERATION * unit}
            self.motion = move(at, position, self._place(goal), velocity=velocity, **limits)

    @property
    def _reversed(self) -> bool:
        return bool(self.values.get("function_enable", 0) >> REVERSED & 1)

    def _reading(self, at: float) -> int:
        """Present position: a whole number of counts that fits 16 bits."""
        counts = round(self.motion.position(at)) - self.values["zero"]
        return max(-32768, min(32767, -counts if self._reversed else counts))

    def _place(self, raw: int) -> int:
        """The place of the shaft with this reading."""
        return self.values["zero"] + (-raw if self._reversed else raw)

    # -- flash and supply ----------------------------------------------------------------------------------------

    def _save(self, at: float) -> None:
        self._old = self.stored(at)
        self._new = {name: self.values[name] for name in self._old}
        self._saved_at = at + FLASH_TIME

    def stored(self, at: float) -> dict[str, int]:
        """The values of the last complete save."""
        return self._old if self.saving(at) else self._new

    def saving(self, at: float) -> bool:
        """A save is running."""
        return at < self._saved_at

    def midway(self) -> float:
        """Time (s) at which half of a save is done; inf without one."""
        return self._saved_at - FLASH_TIME / 2 if self.saving(self._now()) else inf

    def power_off(self) -> None:
        """A save in progress is cut; the shaft stays."""
        now = self._now()
        self.motion = rest(now, self.motion.position(now))
        self._new = self._new if self.quirks.flash_cut == "new" else self.stored(now)
        self._saved_at = -inf
        self._restart(now)

    def power_on(self) -> None:
        """Load the flash. After a restart the target is the default, 0 (manual, command 5). # assumption"""
        self._restart(self._now())
        self.node, self.bit_rate = self.values["node_id"], RATES[self.values["bit_rate_code"]]

    def _restart(self, at: float) -> None:
        self.values = self._shipped | self.stored(at)
        self.started = False
        self._busy_until = -inf
        self._outbox: list[tuple[float, CanFrame]] = []
        self._report_at = inf

    # -- frames that it sends, start and reports -----------------------------------------------------------------

    def due(self) -> float:
        """Time (s) of its next frame; inf for none."""
        return min([self._report_at, *(at for at, _ in self._outbox[:1])])

    def take(self, moment: float) -> list[CanFrame]:
        """The frames that it starts to send up to this time.

        A report has the identifier 0x580 + id; XQPOWER sends another one under 0x180 + id, which is left out.
        """
        frames = [frame for at, frame in self._outbox if at <= moment]
        del self._outbox[: len(frames)]
        if self._report_at <= moment:
            self._set_reporting(self._report_at)
            data = self._reading(moment).to_bytes(2, "little", signed=True) + b"\0\0"
            frames.append(CanFrame(sdo.REPLY + self.node, data, self.extended))
        return frames

    def receive_start(self, order: notifications.Start, at: float) -> None:
        """Start or stop in the form that this servo knows; lost during a save. # assumption"""
        form = self.profile.nmt if self.quirks.nmt == "profile" else self.quirks.nmt
        if form in order.forms and not self.saving(at):
            self.started, self._report_at = order.on, inf
            if order.on:
                self._set_reporting(at)

    def _set_reporting(self, at: float) -> None:
        """The next report follows one interval after this time; an interval of 0: none."""
        self._report_at = at + (self.values["report_interval"] / 1000 or inf)
