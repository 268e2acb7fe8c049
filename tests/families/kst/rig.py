"""Simulated KST servos whose position changes with every request, so that any answer but the present one is known.

The oracle counts requests. A servo is at another place after each; a value is true of a call if it is the place after
one of the requests that were heard during the call. Places repeat after 1801 requests.
"""

from __future__ import annotations

from collections.abc import Mapping
from random import Random

from motorbus.core.can_bits import bits
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import SimulatedNode
from motorbus.core.request import Data
from motorbus.core.steps import gather
from motorbus.errors import MotorbusError
from motorbus.families.kst import FAMILY, Servo
from motorbus.families.kst.sdo import encode_abort_reply
from motorbus.families.kst.simulator import KstBus
from motorbus.link.base import Delivery, Line, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from tests.support.world import make_bus

RATE = 500_000
BIT = 1 / RATE
PLACES = 1801
INDEX, OTHER_INDEX = 0x6002, 0x6003
OTHER_VALUE = 0x55
"""What the lowest byte of a value of something else differs by from the true one: a place of another request."""
NOT_THERE = 0x0602_0000
SWAPPED = int.from_bytes(NOT_THERE.to_bytes(4, "little"), "big")


class Turning:
    """A simulator whose servos turn by one count with every request that reaches it; `heard` counts them."""

    def __init__(self, bus: KstBus) -> None:
        self.bus = bus
        self.heard = 0

    @property
    def nodes(self) -> Mapping[int, SimulatedNode]:
        return self.bus.nodes

    def receive(self, data: Data, at: float) -> None:
        self.bus.receive(CanFrame(0x7FF, b""), at)  # lets its clock know
        self.heard += 1
        for servo in self.bus.servos:
            servo.raw_position = self.heard % PLACES - 900
        self.bus.receive(data, at)

    def advance(self, to: float) -> list[tuple[float, Data]]:
        return self.bus.advance(to)

    def due(self) -> float | None:
        return self.bus.due()

    def tune(self, rate: int) -> None:
        self.bus.tune(rate)


class Rig:
    """A bus with true bit time, the servos at its end, and the ledger of what the calls returned."""

    def __init__(self, ids: tuple[int, ...] = (0x25,), line: Line | None = None, **options: object) -> None:
        simulator = FAMILY.simulator(ids, "", **options)
        assert isinstance(simulator, KstBus)
        self.servos = Turning(simulator)
        self.link = MemoryLink(self.servos, rate=RATE, line=line or PerfectLine(), pace=True)
        self.bus = make_bus(self.link, FAMILY.open())
        self.devices = {node: Servo(self.bus, node) for node in ids}
        self.good = self.failed = self.wrong = 0
        self.errors: list[MotorbusError] = []

    async def reading(self, node: int, count: int) -> None:
        """So many positions of one node, beside those of others."""
        operation = type(self.devices[node]).position.function
        for _ in range(count):
            before = self.servos.heard
            try:
                value = await operation(self.devices[node])
            except MotorbusError as error:
                self._fail(error)
            else:
                self._judge(before, value)

    def read_all(self, count: int) -> None:
        """So many positions of each node, all nodes at once."""

        async def together() -> None:
            await gather(*[self.reading(node, count) for node in self.devices])

        self.bus.run(together())

    def _judge(self, before: int, value: float) -> None:
        """Is this where the servo was after one of the requests since then?"""
        place = self.devices[next(iter(self.devices))].table["present_position"].to_raw(value) + 900
        true = any(asked % PLACES == place for asked in range(before + 1, self.servos.heard + 1))
        self.good += true
        self.wrong += not true

    def _fail(self, error: MotorbusError) -> None:
        self.failed += 1
        self.errors.append(error)


class Mischief:
    """What can happen to a reply on CAN, by chance, the same for the same seed.

    Damaged frames do not exist (the controller drops them), so: `lost`; `late`, and all that follows with it, as
    devices and adapters keep the order; and replies to something else, in place of the true one or just before it.
    After a fault, `rest` replies are left alone. `fired` counts faults.
    """

    def __init__(self, seed: int, probability: float, *kinds: str, rest: int = 0) -> None:
        self.random = Random(seed)
        self.probability = probability
        self.kinds = kinds
        self.rest = rest
        self.resting = 0
        self.late_by = (0.001, 0.5)
        self.fired = dict.fromkeys(kinds, 0)
        self._last = 0.0

    @property
    def count(self) -> int:
        """All faults so far."""
        return sum(self.fired.values())

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            return [Delivery(at, Side.DEVICE, data)]
        assert isinstance(data, CanFrame)
        moment = max(at, self._last)
        self.resting -= len(data.data) == 8
        if len(data.data) != 8 or self.resting >= 0 or self.random.random() >= self.probability:
            return self._deliver([(moment, data)])
        self.resting = self.rest
        kind = self.random.choice(self.kinds)
        self.fired[kind] += 1
        return self._deliver(self._struck(kind, data, moment))

    def _deliver(self, frames: list[tuple[float, CanFrame]]) -> list[Delivery]:
        self._last = max([self._last, *(at for at, _ in frames)])
        return [Delivery(at, Side.HOST, frame) for at, frame in frames]

    def _struck(self, kind: str, frame: CanFrame, at: float) -> list[tuple[float, CanFrame]]:
        if kind == "lost":
            return []
        if kind == "late":
            return [(at + self.random.uniform(*self.late_by), frame)]
        name, _, place = kind.partition(" ")
        other = self._other(name, frame)
        return [(at, other)] if place == "instead" else [(at, other), (at + bits(frame) * BIT, frame)]

    def _other(self, name: str, frame: CanFrame) -> CanFrame:
        data = frame.data
        value = bytes((data[4] ^ OTHER_VALUE,)) + data[5:]  # with the true one, believing it would do no harm
        if name == "index":
            return frame._replace(data=data[:1] + OTHER_INDEX.to_bytes(2, "little") + data[3:4] + value)
        if name == "sub":
            return frame._replace(data=data[:3] + bytes((self.random.randrange(1, 256),)) + value)
        if name == "kind":
            return frame._replace(data=b"\x60" + data[1:4] + bytes(4))
        code = {"abort": NOT_THERE, "swapped": SWAPPED}[name]
        return encode_abort_reply(frame.id - 0x580, int.from_bytes(data[1:3], "little"), data[3], code)
