"""What the machines of all families share: a bus whose line, supply and devices can be struck, and what must hold then.

A step is a call of some verb, a fault that will strike one of the next exchanges, or a rest. Faults are those of
`motorbus.simulation.faults`, so what has happened is a script: a failure prints it, by position. Time is virtual, and
what a step chooses comes from one number, so the same steps are the same run.

Every call has to end by a moment that is reckoned before it; what it says is held against the history of the devices; a
call that no fault has touched is right at once and never said twice; and two calls after the last fault the bus is as
good as new.

Left out, because docs/explanation/taint.md says that no host can know better on these wires:
- replies that overtake each other by more than the quiet time, and copies that come later than at once;
- two faults in one packet, or two bytes that change places, for a sum of 8 bits;
- the copy of an acknowledgement in place of the next one: nothing is struck right behind a copy;
- requests that an adapter holds back and then sends in one lump: on the one wire of FEETECH servos they and the answers
  would collide, which this simulator does not show; on CAN and to a stepper controller they may come so;
- a level of an input that is read once; what two devices with one id say together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Hashable, Mapping
from contextlib import suppress
from random import Random
from typing import Any, ClassVar, Final

from hypothesis import note
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from hypothesis.strategies import integers, sampled_from

from motorbus.core.family import Family, Simulator
from motorbus.core.operation import Data, Exchange
from motorbus.errors import MotorbusError
from motorbus.link.memory import MemoryLink
from motorbus.simulation.faults import FaultyLine, World
from tests.support.history import History
from tests.support.oracle import FalseWord, Oracle, Outcome, Window
from tests.support.world import RETRIES, is_idle, make_bus, receiver_of

BUFFER: Final = 4096
LOTS: Final = 1 << 16
USUAL: Final = 8
"""Exchanges that a plain verb makes at most, with what it has to ask before."""
LONG: Final = 30
"""Exchanges from which on a verb is called seldom in a walk, or there is nothing but such."""
OTHER: Final = ("unplug", "foreign")
"""What happens to the bus in the middle of a call, beside the faults of a script."""
KEPT: Final = 20_000
"""Changes of a device that are remembered; a call takes a few."""

Verb = Callable[[Random], Window]


class Line(FaultyLine):
    """A line whose script grows."""

    @property
    def due(self) -> bool:
        """A fault may still happen; one whose byte did not come never will."""
        return any((fault.exchange or 0) > self.exchange for fault in self.pending)


class Heeded(MemoryLink):
    """A link that notes what is written to it, in `said`, until somebody clears that."""

    def __init__(self, *args: Any, **how: Any) -> None:
        super().__init__(*args, **how)
        self.said: list[Data] = []

    def write(self, data: Data) -> None:
        super().write(data)
        self.said.append(data)


class Rig:
    """A bus of one family under fire. `verbs` are what is called, `faults` what strikes, each by its name.

    A fault is a text of a script without its exchange, where `{byte}`, `{bits}`, `{late}` and `{node}` are by lot; what
    stands behind a semicolon happens in the exchange after it, behind a bar in the same one. `just` is how late a reply
    comes when it comes at about the moment at which it is given up (s).
    """

    just: ClassVar[tuple[float, float]]

    faults: ClassVar[Mapping[str, str]]
    costs: ClassVar[Mapping[str, int]]
    """How many exchanges a verb makes at most, where that is more than `USUAL`."""
    reads: ClassVar[Collection[str]]
    """Verbs that order nothing: whatever order is sent while they are called is of before."""
    plain: ClassVar[tuple[str, ...]]
    """Verbs in the middle of which the adapter is pulled."""
    pulling: ClassVar[tuple[float, float]] = (-5, -2)
    """How long after the beginning of a call, as a power of ten of a second."""
    suits: ClassVar[Mapping[str, str]] = {}
    """Faults that show most in one verb, which a walk calls then."""
    stores: ClassVar[str]
    """A verb that writes what is kept without supply."""
    once: ClassVar[Collection[Hashable]] = ()
    """Orders that do something each time they are carried out, so none is said twice in a call."""

    def __init__(self, family: Family, simulator: Simulator, rate: int, **how: Any) -> None:
        self.simulator: Any = simulator
        self.history = History(simulator, keep=KEPT)
        self.world = World(self.history)
        self.line = Line((), self.world, most=1000)
        self.link = Heeded(self.world, rate=rate, line=self.line, **how)
        self.bus = make_bus(self.link, family.configured(), report=lambda event: None)
        self.family = self.bus.family
        self.oracle = Oracle(self.link, self.history, lambda: self.world.ahead)
        self.verbs: dict[str, Verb] = {}
        self.calls: Counter[str] = Counter()
        self.untouched = 0
        self.quarantine = 0
        self.pulls = self.strangers = 0
        self.may: Callable[[Hashable, Data], bool] | None = None
        self.slow = self.longest()
        self.bound = USUAL * self.slow

    def slowest(self) -> Exchange[Any]:
        """The exchange that takes longest."""
        raise NotImplementedError

    def longest(self) -> float:
        """s after which an exchange is over whatever the line does: each try with its quiet time and a probe."""
        rate = self.link.rate
        each = [
            self.family.air_time(one, rate) + self.family.turnaround(one) + 0.02
            for one in (self.slowest(), self.family.probe(1, 0))
        ]
        quiet = self.family.quiet_time(rate)
        return (RETRIES + 2) * (sum(each) + 2 * quiet) + quiet

    # -- steps --------------------------------------------------------------------------------------------------------

    def call(self, name: str, lot: int) -> None:
        """Call a verb and judge it."""
        touched, fired, again = self.troubled, self.line.count, self.again
        calls = self.verbs | {"unplug": self.pulled, "foreign": self.overheard}
        self.bound = self.costs.get(name, USUAL) * self.slow
        self.stir(Random(~lot))
        self.link.said.clear()
        self.may = None
        window = calls[name](Random(lot))
        self.calls[name] += 1
        self.heed(name)
        if self.quarantine and not self.line.due:
            self.quarantine -= 1
            if not self.quarantine:
                self.rest()  # what is one behind since the copy must not stay so
        if touched or self.line.count > fired or self.troubled or name in OTHER:
            return
        self.untouched += 1
        if window.says in (Outcome.UNREAD, Outcome.UNKNOWN):
            raise FalseWord(f"{name}: no fault has touched it, and it failed") from window.error
        if self.again > again:
            raise FalseWord(f"{name}: no fault has touched it, and it was said twice")

    def order(self, said: Data) -> Hashable | None:
        """What this orders, None when it changes nothing."""
        raise NotImplementedError

    def heed(self, name: str) -> None:
        """Judge what this call has sent: no order but its own, and none twice of which each counts."""
        orders = [(order, said) for said in self.link.said if (order := self.order(said)) is not None]
        for order, said in orders:
            if name in self.reads or (self.may is not None and not self.may(order, said)):
                raise FalseWord(f"{name}: {order} was sent, which is an order of before: {said!r}")
        for order, often in Counter(order for order, _ in orders).items():
            if order in self.once and often > 1:
                raise FalseWord(f"{name}: {order} was sent {often} times, and each counts")

    def strike(self, name: str, lot: int) -> None:
        """Let this fault happen in one of the next exchanges; not right behind another one."""
        if self.line.due or self.quarantine:
            return
        random = Random(lot)
        place = {
            "byte": random.randrange(11),
            "bits": f"{random.choice([1, random.randrange(1, 256)]):02X}",
            "late": f"{10 ** random.uniform(-4, -0.2):.6f}",
            "just": f"{random.uniform(*self.just):.6f}",
            "near": f"{10 ** random.uniform(-4, -1.6):.6f}",
            "node": random.choice([*self.history.nodes]),
        }
        exchange = self.line.exchange + random.randrange(1, 4)
        for one in self.faults[name].format(**place).split(";"):
            for part in one.split("|"):
                self.line.extend(f"exchange {exchange} {part}")
            exchange += 1
        if "copied" in name:
            self.quarantine = 3

    def rest(self) -> None:
        """Let everything that is late arrive; then the second call at most is right."""
        for _ in range(8):
            if self.line.due or self.line.holds_back:
                self.spend()
        self.settle()
        self.spend()
        window = self.probe()
        if window.error is not None:
            raise FalseWord("the second call after the last fault failed") from window.error
        if not is_idle(self.bus):
            raise FalseWord("the bus is not idle")
        self.quarantine = 0

    def pulled(self, random: Random) -> Window:
        """The adapter is pulled in the middle of a plain call, and put back."""
        self.link.unplug(self.link.now() + 10 ** random.uniform(*self.pulling))
        try:
            window = self.verbs[random.choice(self.plain)](random)
            self.link.advance(0.02)
        finally:
            self.link.plug()
        self.pulls += 1
        return window

    def overheard(self, random: Random) -> Window:
        """Somebody else's packet comes in the middle of the plainest call."""
        self.intrude(10 ** random.uniform(-4, -2), self.foreign(random))
        return self.probe()

    def intrude(self, later: float, data: Data) -> None:
        """Somebody else says this, so much later (s)."""
        self.link.inject(data, later)
        self.strangers += 1

    def stir(self, random: Random) -> None:
        """Let what is measured be another value than at the call before, or an old one would pass for a new one."""
        raise NotImplementedError

    def foreign(self, random: Random) -> Data:
        """A good packet that answers nothing that was asked."""
        raise NotImplementedError

    def settle(self) -> None:
        """Let time pass until nothing is under way."""
        self.link.advance(
            max(0.0, min(self.line.last_arrival, self.link.now() + 10.0) - self.link.now()) + 2.0
        )

    def spend(self) -> None:
        """Make an exchange that may fail; what waits for something to be stored gets that."""
        self.verbs[self.stores](Random(self.line.exchange)) if self.world.armed else self.probe()

    def probe(self) -> Window:
        """The plainest call there is, of everybody in turn, judged."""
        raise NotImplementedError

    # -- what must hold -----------------------------------------------------------------------------------------------

    @property
    def troubled(self) -> bool:
        """Something that was struck is still under way, or something is away."""
        return bool(
            not self.link.quiet
            or self.line.holds_back
            or self.line.last_arrival > self.link.now()
            or self.world.scheduled
        )

    @property
    def again(self) -> int:
        """How often the bus has said something twice."""
        return sum(ledger.retries for ledger in self.bus.statistics.nodes.values())

    def sound(self) -> None:
        """No caller holds the bus, and the receiver keeps few bytes."""
        if not is_idle(self.bus):
            raise FalseWord(
                "a request still waits for the bus, or holds it or its lock, and no call is running"
            )
        if (held := kept(receiver_of(self.bus))) > BUFFER:
            raise FalseWord(f"the receiver keeps {held} bytes")

    def told(self) -> str:
        """What has happened, as a script."""
        return f"{self.line.record}\n# {self.oracle.judged} judged, {dict(self.calls)}"


def kept(receiver: object) -> int:
    """Bytes that a receiver holds, and what it is made of."""
    names = [name for kind in type(receiver).__mro__ for name in getattr(kind, "__slots__", ())]
    inside = [getattr(receiver, name, None) for name in {*names, *getattr(receiver, "__dict__", ())}]
    own = sum(len(value) for value in inside if isinstance(value, bytes | bytearray))
    return own + sum(kept(value) for value in inside if type(value).__module__.startswith("motorbus."))


class Machine(RuleBasedStateMachine):
    """The steps of one family; `make` builds its rig."""

    make: ClassVar[Callable[[], Rig]]
    fired: ClassVar[int] = 0
    """How many faults have struck in all runs of it."""

    @initialize()
    def begin(self) -> None:
        self.rig = type(self).make()

    def teardown(self) -> None:
        rig = getattr(self, "rig", None)
        if rig is not None:
            note(rig.told())
            type(self).fired += rig.line.count
            rig.rest()


def machine(make: Callable[[], Rig], verbs: list[str], faults: list[str]) -> type[Machine]:
    """The machine of a family."""

    class Steps(Machine):
        @rule(name=sampled_from([*verbs, *OTHER]), lot=integers(0, LOTS - 1))
        def call(self, name: str, lot: int) -> None:
            self.rig.call(name, lot)

        @rule(name=sampled_from(faults), lot=integers(0, LOTS - 1))
        def strike(self, name: str, lot: int) -> None:
            self.rig.strike(name, lot)

        @rule()
        def rest(self) -> None:
            self.rig.rest()

        @invariant()
        def sound(self) -> None:
            if hasattr(self, "rig"):
                self.rig.sound()

    Steps.make = staticmethod(make)
    return Steps


def walk(rig: Rig, seed: int, exchanges: int, often: float = 0.02) -> None:
    """Steps by chance, until there are so many exchanges or calls; `often` is the share of steps that are faults."""
    random = Random(seed)
    verbs, faults = [*rig.verbs, *OTHER], [*rig.faults]
    step = verbs[0], 0
    while rig.line.exchange < exchanges and rig.calls.total() < exchanges:
        if random.random() < often:
            fault = random.choice(faults)
            rig.strike(fault, random.randrange(LOTS))
            step = rig.suits.get(fault, step[0]), random.randrange(LOTS)
        elif random.random() < 0.001:
            rig.rest()
        else:
            if (
                random.random() < 0.5
            ):  # else the same of the same device again: what is old looks most alike then
                cheap = [name for name in verbs if rig.costs.get(name, 0) < LONG or random.random() < 0.1]
                step = random.choice(cheap), random.randrange(LOTS)
            rig.call(*step)
        rig.sound()
    with suppress(MotorbusError):
        rig.rest()
