"""One simulated servo: what a test or a control socket does to it, and what a restart does.

It keeps four things apart that the manual keeps apart: what is in force (`node`, `bit_rate`), what was written
(`memory`), what a restart will bring back (flash), and where the shaft stands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import inf, pi
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.errors import RequestError
from motorbus.families.kst import notifications, sdo
from motorbus.families.kst.profiles import BIT_RATES, Profile
from motorbus.families.kst.simulator import objects
from motorbus.families.kst.simulator.memory import REVERSE, Memory
from motorbus.families.kst.simulator.motor import DRIVE, Shaft, Warmth
from motorbus.families.kst.simulator.server import SdoServer
from motorbus.families.kst.simulator.switches import Switches

COUNTS_PER_RADIAN = 180 / pi
"""Times the counts per degree of the profile."""
MAILBOX: Final = 16
"""Requests that may wait for a servo; an assumption, no source tells the size of its receive buffer."""


class Servo:
    """A servo as a test pokes it.

    `unit`      its number on this bus, from 1; it keeps that whatever its id becomes
    `node`      the id it answers to, `bit_rate` the rate it is set to
    `values`    what was written, live and stored, by name
    `memory`    the raw value of every row, as a host would read it (or last wrote it, where it cannot be read)
    `shaft`     its shaft, on the bus's clock
    `errors`    bus errors it has counted since its restart
    `started`   whether a start was heard, `plugged` whether its cable is in; `lives` counts its supply's comings
    `delay`     s that it answers later than the others; `busy_until` is when its last answer began
    `extended`  whether it was last asked with a 29-bit identifier: what it says unasked has the same form
    `changed`   is called when it may be others who can reach it, or when its next report may be at another moment
    """

    def __init__(
        self,
        unit: int,
        node: int,
        profile: Profile,
        switches: Switches,
        now: Callable[[], float],
        say: Callable[[Servo, float, CanFrame], None],
    ) -> None:
        self.changed: Callable[[], None] = _nothing
        self.unit = unit
        self.profile = profile
        self.switches = switches
        self.delay = 0.0
        self.busy_until = -inf
        self.errors = 0
        self.lives = 0
        self.started = False
        self._plugged = True
        self.extended = switches.id_format == "ext"
        self._now = now
        self._say = say
        self._voltage = switches.voltage
        self._warmth = Warmth(switches.temperature)
        self._server = SdoServer(self)
        self._interval = 0.0
        self._reports_from = inf
        self._reported = 0
        per_radian = COUNTS_PER_RADIAN * profile.counts_per_degree
        speed, acceleration = switches.speed * per_radian, switches.acceleration * per_radian
        self.shaft = Shaft(now(), switches.position, speed=speed, acceleration=acceleration)
        self.values = Memory(_factory(node, profile, switches))
        self._node, self._bit_rate = node, switches.bit_rate
        self._power_up(now())
        self.values["goal_position"] = switches.position

    # -- what a test or a control socket does to it ------------------------------------------------------------

    @property
    def memory(self) -> Mapping[str, int]:
        """The raw value of every row at this moment."""
        return _Memory(self, self._now)

    @property
    def node(self) -> int:
        """The id it answers to."""
        return self._node

    @node.setter
    def node(self, node: int) -> None:
        self._node = node
        self.changed()

    @property
    def bit_rate(self) -> int:
        """The rate it is set to, bit/s."""
        return self._bit_rate

    @bit_rate.setter
    def bit_rate(self, rate: int) -> None:
        self._bit_rate = rate
        self.changed()

    @property
    def plugged(self) -> bool:
        """Whether its cable is in."""
        return self._plugged

    @plugged.setter
    def plugged(self, yes: bool) -> None:
        self._plugged = yes
        self.changed()

    def unplug(self) -> None:
        """Pull its cable, bus and supply in one. The shaft stays; an answer on its way is lost."""
        self.shaft.halt(self._now())
        self.values.lose_supply(self._now(), cut=self.switches.flash_cut)
        self.lives += 1
        self._reports_from = inf
        self.plugged = False

    def plug(self) -> None:
        """Put its cable back: it powers up. Does nothing when it is in."""
        if not self.plugged:
            self.plugged = True
            self._power_up(self._now())

    def power_cycle(self) -> None:
        """Take its supply away and give it back: what was not saved is lost, what was saved is in force."""
        if self.plugged:
            self._power_up(self._now())

    restart = power_cycle

    def midway(self) -> float:
        """When its flash is written to the half; infinity while it is not."""
        return self.values.midway(self._now())

    def alarm(self, data: bytes = notifications.LOW_VOLTAGE) -> None:
        """Say an alarm of four bytes now; the usual one is low voltage (public demo of a newer protocol)."""
        if self.plugged:
            self._say(self, self._now(), notifications.encode_alarm(self.node, data, extended=self.extended))

    def status(self) -> dict[str, object]:
        """How it is, as plain data; positions in raw counts."""
        now = self._now()
        return {
            "unit": self.unit,
            "node": self.node,
            "pending_node": self.values["node_id"],
            "profile": self.profile.name,
            "plugged": self.plugged,
            "bit_rate": self.bit_rate,
            "pending_bit_rate": BIT_RATES[self.values["bit_rate_code"]],
            "saving": self.values.saving(now),
            "saved": self.values.saved(now),
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
        """The present position in raw counts; set it to turn the shaft by hand, at rest afterwards."""
        return self.shaft.reading(self._now())

    @raw_position.setter
    def raw_position(self, raw: int) -> None:
        self.shaft.turn_by_hand(raw, self._now())

    @property
    def voltage(self) -> float:
        """The supply in V; falling below the limit of the switch `low_voltage` it says so once."""
        return self._voltage

    @voltage.setter
    def voltage(self, volts: float) -> None:
        was_low, self._voltage = self._is_low, volts
        if self._is_low and not was_low:
            self.alarm()

    @property
    def temperature(self) -> float:
        """°C; set it and it is as warm, and so are its surroundings."""
        return self._warmth.temperature(self._now())

    @temperature.setter
    def temperature(self, degrees: float) -> None:
        self._warmth.become(degrees, self._now())

    @property
    def load(self) -> float:
        """What the outside takes of its full torque, -1 to 1; it draws current for that and grows warm."""
        return self._warmth.load

    @load.setter
    def load(self, share: float) -> None:
        self._warmth.follow(share, self._now())

    def load_shaft(self, share: float) -> None:
        """Let the outside take this share of the full torque, -1 to 1."""
        if not -1.0 <= share <= 1.0:
            raise RequestError(f"{share:.0%} is not possible", expected="-100% to 100%")
        self.load = share

    def release_shaft(self) -> None:
        """End the load."""
        self.load = 0.0

    def current(self, at: float) -> float:
        """The supply current in A, by the model that `motor` tells."""
        return DRIVE.current(self.shaft.motion.velocity(at), self.load) if self.plugged else 0.0

    # -- what the bus brings -----------------------------------------------------------------------------------

    def hears(self, rate: int | None) -> bool:
        """Whether it is there and set to this rate (None: whichever it is)."""
        return self.plugged and (rate is None or rate == self.bit_rate)

    def takes(self, extended: bool) -> bool:
        """Whether it heeds identifiers of this form."""
        return self.switches.id_format in ("asked", "ext" if extended else "std")

    def obey(self, request: sdo.SdoRequest, at: float) -> None:
        """Carry a request out and answer it, one after the other: a servo has one SDO server."""
        if self.busy_until - at > MAILBOX * self.switches.turnaround:
            return  # no controller holds more; a host that floods it loses frames, and the others are served again soon
        self.extended = request.extended
        reply = self._server.answer(request, at)
        if reply is None:
            return
        if request.node == sdo.BROADCAST:
            asked = (
                self.switches.broadcast_ack if request.kind == "download" else self.switches.broadcast_read
            )
            if not asked:
                return
        self.busy_until = max(at, self.busy_until) + self.switches.turnaround
        self._say(self, self.busy_until + self.delay, reply)

    def obey_start(self, order: notifications.Start, at: float) -> None:
        """Start or stop, when it is said in the form this one knows; nobody answers that.

        During a write to flash it is lost like every other order, an assumption.
        """
        form = self.profile.nmt if self.switches.nmt == "profile" else self.switches.nmt
        if form not in order.forms or self.values.saving(at):
            return
        self.started = order.on
        self._report(order.on, at)

    # -- what it says unasked ----------------------------------------------------------------------------------

    def report_every(self, seconds: float, at: float) -> None:
        """Another interval between reports from this moment on; 0: none."""
        self._interval = seconds
        self.changed()
        if self._reports_from < inf:
            self._report(True, at)

    def report_due(self) -> float | None:
        """When it next says by itself where it is, or None."""
        if self._reports_from == inf or not self._interval:
            return None
        return self._reports_from + self._interval * (self._reported + 1)

    def wake(self, at: float) -> None:
        """The clock begins here: so do the reports that were to come from power-up on."""
        if self._reports_from < inf:
            self._report(True, at)

    def report(self, at: float) -> list[CanFrame]:
        """The report that is due, in one form or both (newer KST: 0x580 + id; XQPOWER: 0x180 + id as well)."""
        self._reported += 1
        wanted = self.switches.report_form
        forms = ("sdo", "pdo") if wanted == "both" else (wanted,)
        raw = self.shaft.reading(at)
        return [
            notifications.encode_report(self.node, raw, form=form, extended=self.extended) for form in forms
        ]

    def _report(self, on: bool, at: float) -> None:
        self._reports_from, self._reported = (at if on else inf), 0
        self.changed()

    # -- what it is --------------------------------------------------------------------------------------------

    @property
    def travel(self) -> tuple[int, int]:
        """The travel limits in force, as raw targets."""
        limit = self.profile.limit
        if "negative_limit" not in self.values:
            return -limit, limit
        return self.values["negative_limit"], self.values["positive_limit"]

    @property
    def heeds_positions(self) -> bool:
        """Whether a target position moves it: XQPOWER wants to be started first."""
        needs = self.switches.needs_start
        wants_start = self.profile.nmt == "standard" if needs == "profile" else needs == "yes"
        return self.started or not wants_start

    @property
    def _is_low(self) -> bool:
        return self._voltage < self.switches.low_voltage

    def _power_up(self, at: float) -> None:
        switches = self.switches
        self.lives += 1
        self.values.restart(at, cut=switches.flash_cut)
        self.node = self.values["node_id"]
        self.bit_rate = BIT_RATES[self.values["bit_rate_code"]]
        self.errors, self.busy_until, self.started = 0, -inf, False
        self._server.forget()
        self.shaft.halt(at)
        self.shaft.zero = self.values["zero"]
        self.shaft.reversed = bool(self.values.get("function_enable", 0) & REVERSE)
        if switches.after_restart == "move":
            self.shaft.go(switches.default_position, at)
        self._interval = (switches.reports_ms or self._interval_as_shipped) / 1000
        self._report(bool(switches.reports_ms), at)
        if switches.boot_notice and self.lives > 1:
            self._say(self, at, notifications.encode_boot(self.node, extended=self.extended))
        if self._is_low:
            self.alarm()

    @property
    def _interval_as_shipped(self) -> int:
        return self.values.get("report_interval", objects.INTERVAL)


def _nothing() -> None:
    """Nobody goes by it."""


class _Memory(Mapping[str, int]):
    """Every row of a servo by name, worked out when asked."""

    def __init__(self, servo: Servo, now: Callable[[], float]) -> None:
        self._servo = servo
        self._now = now

    def __getitem__(self, name: str) -> int:
        return objects.read(self._servo, self._servo.profile.table[name].name, self._now())

    def __iter__(self) -> Iterator[str]:
        return iter(self._servo.profile.table)

    def __len__(self) -> int:
        return len(self._servo.profile.table)


def _factory(node: int, profile: Profile, switches: Switches) -> dict[str, int]:
    """The values of all rows as it is shipped, with the id and the rate it is made with."""
    codes = {rate: code for code, rate in BIT_RATES.items()}
    special = {
        "node_id": node,
        "bit_rate_code": codes[switches.bit_rate],
        "goal_position": switches.default_position,
        "report_interval": objects.INTERVAL,
        "negative_limit": -profile.limit,
        "positive_limit": profile.limit,
        "store": 0,
    }
    rows = {row.name: special.get(row.name, row.default or 0) for row in profile.table.values()}
    return rows | {"zero": 0}
