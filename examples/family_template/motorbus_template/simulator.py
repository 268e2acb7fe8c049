"""SIMULATOR: how a real one behaves. Here belong memory, physics and timing, as seen from the wire.

Time comes in as an argument; nothing here waits, ticks or knows the driver. What two sources tell differently of
the real device becomes a named switch with a default. `nodes[id].memory` shows the raw value of every row as a
host would read it, so that tests can compare.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from math import inf
from typing import Final

from motorbus.core import plant
from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Register, Storage
from motorbus.core.request import Data
from motorbus.errors import RequestError

from . import wire
from .table import COUNT, TABLE

RATE: Final = 500_000
"""bit/s; what those of the first year have (250 kbit/s) is not simulated."""
THINKS: Final = 0.0003
"""s from the end of a request to the beginning of the answer."""
STORES: Final = 0.004
"""s more when EEPROM is written."""
ACCELERATION: Final = 40.0 / COUNT
"""counts/s²."""
HOT: Final = 80
"""°C above which the temperature alarm is set."""


class Servo:
    """One Metronome: its memory, its shaft, and what a request does to them.

    `temperature` (°C) may be set by a test. `memory[name]` is the raw value of a row at this moment.
    """

    def __init__(self, bus: Metronomes, node_id: int, temperature: float) -> None:
        self.bus = bus
        self.temperature = temperature
        self.plugged = True
        self._values = {row.name: row.default or 0 for row in TABLE.values()} | {"node_id": node_id}
        self.node_id = node_id
        self.motion = plant.rest(0.0, 0.0)
        self.reported_at = inf

    @property
    def memory(self) -> Mapping[str, int]:
        """The raw value of every row, as a host would read it at this moment."""
        now = self.bus.now
        return {
            **self._values,
            "present_position": round(self.motion.position(now)),
            "moving": int(self.motion.moving(now)),
            "present_temperature": round(self.temperature),
        }

    # -- what a test or a control socket does to it ---------------------------------------------------------

    def unplug(self) -> None:
        """Pull its cable: bus and supply."""
        self._let_go(self.bus.now)
        self.plugged = False

    def plug(self) -> None:
        """Put its cable back: it powers up."""
        if not self.plugged:
            self.plugged = True
            self.power_cycle()

    def power_cycle(self) -> None:
        """RAM is as shipped afterwards, EEPROM as it was stored; the shaft stays where it is."""
        self._let_go(self.bus.now)
        self._values |= {row.name: row.default or 0 for row in TABLE.values() if row.storage is Storage.RAM}
        self.node_id = self._values["node_id"]

    def status(self) -> dict[str, object]:
        """How it is, as plain data."""
        return {"plugged": self.plugged, **self.memory}

    # -- what a request does --------------------------------------------------------------------------------

    def obey(self, request: wire.Message, at: float) -> tuple[int, bytes, float]:
        """Status and value of the answer, and how much later than usual it comes (s)."""
        if request.command == wire.Command.STOP:
            self._go(at, 0.0, self.motion.velocity(at))
            return self._alarms, b"", 0.0
        if request.command == wire.Command.READ and request.object == wire.PROOF:
            return self._alarms, bytes((~request.subindex & 0xFF,)), 0.0
        row = TABLE.at(request.object, request.subindex)
        if row is None or not row.readable:
            return self._alarms | 1, b"", 0.0
        if request.command == wire.Command.READ:
            return self._alarms, self._code(row), 0.0
        if request.command != wire.Command.WRITE:
            return self._alarms | 5, b"", 0.0
        refusal = self._write(row, row.decode(request.value[-row.size :]), at)
        slow = STORES if row.storage is Storage.EEPROM and not refusal else 0.0
        return self._alarms | refusal, b"", slow

    @property
    def _alarms(self) -> int:
        return 1 << 4 if self.temperature > HOT else 0

    def _code(self, row: Register) -> bytes:
        return (self.memory[row.name] % (1 << 8 * row.size)).to_bytes(row.size, "big")

    def _write(self, row: Register, raw: int, at: float) -> int:
        values = self._values
        if not row.writable:
            return 2
        goes_beyond = row.name == "goal_position" and not (
            values["min_position"] <= raw <= values["max_position"]
        )
        if not row.low <= raw <= row.high or goes_beyond:
            return 3
        if row.storage is Storage.EEPROM and values["lock"]:
            return 4
        values[row.name] = raw
        if row.name == "torque_enable" and not raw:
            self._let_go(at)
        elif row.name in ("goal_position", "torque_enable") and values["torque_enable"]:
            self._go(at, values["move_velocity"] / 1000 / COUNT, self.motion.velocity(at))
        return 0

    # -- how it moves ---------------------------------------------------------------------------------------

    def _let_go(self, at: float) -> None:
        """Friction holds it at once."""
        self.motion = plant.rest(at, self.motion.position(at))
        self.reported_at = inf

    def _go(self, at: float, speed: float, velocity: float) -> None:
        """To the goal, or (speed 0) to a halt as soon as it can."""
        position, goal = self.motion.position(at), float(self._values["goal_position"])
        if not speed and not velocity:
            self._let_go(at)
            return
        self.motion = plant.move(
            at, position, goal, velocity=velocity, speed=speed, acceleration=ACCELERATION
        )
        self.reported_at = at

    def report_due(self) -> float | None:
        """When it next says by itself where it is: in intervals while it moves, and once when it arrives."""
        if self.reported_at == inf:
            return None
        interval = self._values["report_interval"] * 0.001 or inf
        return min(self.reported_at + interval, self.motion.done_at)

    def report(self, at: float) -> CanFrame:
        """Say it."""
        arrived = at >= self.motion.done_at
        self.reported_at = inf if arrived else at
        reason = wire.Reason.ARRIVED if arrived else wire.Reason.UNDER_WAY
        position = round(self.motion.position(at))
        return wire.encode_report(self.node_id, reason, position.to_bytes(4, "big", signed=True))


class Metronomes:
    """A simulated bus with these nodes, all of one model. Raises RequestError for impossible ones."""

    def __init__(self, ids: tuple[int, ...], model: str = "", temperature: object = 25.0) -> None:
        if model not in ("", "metronome"):
            raise RequestError(f"there is no simulated {model!r}", expected="metronome")
        if not ids or not set(ids) <= set(wire.NODES):
            raise RequestError(f"ids {ids} cannot be simulated", expected="one or more of 1 to 63")
        self.now = 0.0
        self.rate = 0
        self._nodes = {node: Servo(self, node, float(str(temperature))) for node in ids}
        self._outgoing: list[tuple[float, int, CanFrame]] = []
        self._order = count()

    @property
    def nodes(self) -> Mapping[int, Servo]:
        """The servos by the id they were made with."""
        return self._nodes

    def tune(self, rate: int) -> None:
        """The host's rate; at another one than `RATE` they neither hear nor are heard."""
        self.rate = rate

    def receive(self, data: Data, at: float) -> None:
        """A frame of the host has arrived."""
        self.now = max(self.now, at)
        if not isinstance(data, CanFrame) or self.rate != RATE:
            return
        request = wire.decode_request(data)
        if request is None:
            return
        for servo in self._nodes.values():
            if servo.plugged and request.node in (servo.node_id, wire.EVERYONE):
                status, value, later = servo.obey(request, at)
                if request.node != wire.EVERYONE:
                    self._say(at + THINKS + later, wire.encode_answer(request, status, value))

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Every frame that a servo begins to send up to this moment, in order."""
        while (moment := self._report_due()) is not None and moment <= to:
            self.now = max(self.now, moment)
            for servo in self._nodes.values():
                if servo.report_due() == moment:
                    self._say(moment, servo.report(moment))
        self.now = max(self.now, to)
        self._outgoing.sort()
        said: list[tuple[float, Data]] = [(when, frame) for when, _, frame in self._outgoing if when <= to]
        del self._outgoing[: len(said)]
        return said

    def due(self) -> float | None:
        """When the next frame begins, or None."""
        moments = [when for when, _, _ in self._outgoing]
        report = self._report_due()
        return min(moments if report is None else [*moments, report], default=None)

    def _report_due(self) -> float | None:
        dues = [servo.report_due() for servo in self._nodes.values() if servo.plugged]
        return min((due for due in dues if due is not None), default=None)

    def _say(self, when: float, frame: CanFrame) -> None:
        self._outgoing.append((when, next(self._order), frame))
