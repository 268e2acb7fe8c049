"""Calls by chance on a machine of two families, and what must become of each.

A `Caller` draws them from a seeded source: verbs of axes and of devices, writes by name, writes of groups, broadcasts,
orders that were kept and are run again; goals near and far, turns away, NaN, infinite, huge, no numbers at all. What
leads axes is in `courses`, and what else may be the matter in `matters`. Before each it is reckoned by hand whether the
goal is surely allowed (it must reach the wire), surely not (it must be refused), or too close to say (it must not be
wrong).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from math import inf, isfinite, nan, pi, radians
from random import Random
from typing import Any, NamedTuple

from motorbus.core.steps import catch, gather
from motorbus.errors import MotorbusError
from motorbus.families.feetech import ServoGroup, sync_write
from motorbus.families.kst import broadcast_write, settings_of
from motorbus.session.robot import Robot
from motorbus.simulation.named import Simulation
from tests.safety.decoders import COUNT, TENTH, FeetechWitness, KstWitness, Witness

AXES: dict[str, dict[str, Any]] = {
    "a1": {"low": "-60 deg", "high": "60 deg", "max_step": "15 deg"},
    "a2": {"low": "-30 deg", "high": "90 deg", "max_step": "20 deg", "sign": -1},
    "c1": {"low": "-40 deg", "high": "40 deg", "max_step": "12 deg"},
    "c2": {"low": "-20 deg", "high": "40 deg", "max_step": "10 deg", "sign": -1},
}
SLACK = 0.0031
"""rad by which a decoded target may be beyond: half a count of the coarsest servo, see `guard.ROUNDED`."""
SURELY = 0.02
"""rad from every bound from which on nobody can be in doubt."""
STAYS = 0.004
"""rad of a goal from where a device is, up to which that is an order to stay: two counts, or two tenths of a degree."""
FRESH = 0.5
"""s; an older reading is not used, and the bus looks again."""
Spot = tuple[str, int]
"""A device: its bus and its node."""
TURN = radians(90)
"""rad/s that an axis of these may turn."""
UNIT = 0.08
"""rad/s by which a decoded speed may be beyond: a unit of 0.732 RPM."""
WHEEL = 3
"""The servo of the bus `arm` that turns without an end; it is no part of `BOUNDS`."""
ODD = (
    nan,
    inf,
    -inf,
    1e308,
    -1e308,
    10**400,
    True,
    None,
    "1.0",
    2 * pi,
    -2 * pi,
    200 * pi,
    32768,
    -32768,
    65535,
)


class Bound(NamedTuple):
    """Of one device: its axis, its limits and its greatest step (rad of the device)."""

    axis: str
    low: float
    high: float
    step: float


def _bound(name: str, zero: float) -> Bound:
    row = AXES[name]
    ends = [zero + row.get("sign", 1) * radians(float(row[key].split()[0])) for key in ("low", "high")]
    return Bound(name, min(ends), max(ends), radians(float(row["max_step"].split()[0])))


BOUNDS: dict[Spot, Bound] = {
    ("arm", 1): _bound("a1", pi),
    ("arm", 2): _bound("a2", pi),
    ("can", 0x25): _bound("c1", 0.0),
    ("can", 0x26): _bound("c2", 0.0),
}


class Call(NamedTuple):
    """One call: what it is, and the places (rad of the device) by device to which it must lead when all are allowed.

    `each`: each goal is an order of its own, and `do` gives what came of each. `led`: small goals lead there, so only
    the limits count, and nobody moves when one of them is refused. `barred` are those to whom no goal and no torque
    may go meanwhile, `attended` says that wheels may turn, and `once` that it means nothing a second time.
    """

    what: str
    do: Callable[[], object]
    wants: Mapping[Spot, object]
    each: bool = False
    led: bool = False
    barred: Collection[Spot] = ()
    attended: bool = False
    once: bool = False


class Tally:
    """How many calls had to pass and did, had to be refused and were (by what they are), and were too close to say;
    and how much of what was on the wires was judged."""

    def __init__(self) -> None:
        self.passed: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        self.close = self.targets = self.speeds = 0

    def __str__(self) -> str:
        return (
            f"{self.passed.total()} passed, {self.refused.total()} refused, {self.close} too close to say or no order; "
            f"{self.targets} targets and {self.speeds} speeds on the wires"
        )


class Caller:
    """Draws calls, makes them, and judges what reached the wires."""

    def __init__(self, robot: Robot, sims: Mapping[str, Simulation], seed: int) -> None:
        self.robot = robot
        self.sims = sims
        self.chance = Random(seed)
        self.tally = Tally()
        self.kept: list[Call] = []
        self.wires: dict[str, Witness] = {"arm": FeetechWitness(), "can": KstWitness(0x25, 0x26)}

    # -- where devices are ---------------------------------------------------------------------------------------------

    def device(self, spot: Spot) -> Any:
        """The verbs of a device, as a program has them that knows nothing of axes."""
        return self.robot[BOUNDS[spot].axis].device

    def here(self, spot: Spot) -> float:
        """Where a device was heard to be last, or is when that was a while ago and the bus will look again (rad)."""
        wire = self.wires[spot[0]]
        return wire.heard[spot[1]] if self.age(spot) < FRESH else self.really(spot)

    def really(self, spot: Spot) -> float:
        """Where it is, whoever was told."""
        node: Any = self.sims[spot[0]][spot[1]]
        return float(node.raw_position) * (COUNT if spot[0] == "arm" else TENTH)

    def age(self, spot: Spot) -> float:
        """s since it was heard."""
        return self.robot.buses[spot[0]].link.now() - self.wires[spot[0]].heard_at[spot[1]]

    def goal(self, spot: Spot) -> object:
        """Somewhere: near, far, at a limit, turns away, or nowhere."""
        bound, here, chance = BOUNDS[spot], self.here(spot), self.chance
        kind = chance.randrange(10)
        if kind == 0:
            return chance.choice(ODD)
        if kind == 1:
            return here + chance.choice((-1, 1)) * chance.choice((2 * pi, 4 * pi, pi))
        if kind == 2:
            return chance.choice((bound.low, bound.high)) + chance.uniform(-0.01, 0.01)
        if kind == 3:
            return chance.uniform(-7, 7)
        if kind == 4:
            return here + chance.choice((-1, 1)) * (bound.step + chance.uniform(-0.01, 0.01))
        return min(max(here + chance.uniform(-1.1, 1.1) * bound.step, bound.low - 0.05), bound.high + 0.05)

    def verdict(self, spot: Spot, goal: object) -> bool | None:
        """Whether this goal must reach the device at once; None where that is too close to say."""
        inside, bound = self.within(spot, goal), BOUNDS[spot]
        if inside is not True or not isinstance(goal, int | float):
            return inside
        if abs(self.age(spot) - FRESH) < 0.02:
            return None
        beyond = abs(goal - self.here(spot)) - bound.step
        return None if abs(beyond) < SURELY else beyond < 0

    def within(self, spot: Spot, goal: object) -> bool | None:
        """Whether this is a place within the limits of the device; None where that is too close to say."""
        if isinstance(goal, bool) or not isinstance(goal, int | float):
            return False
        if abs(goal) > 1e300 or not isfinite(goal):
            return False
        bound = BOUNDS[spot]
        beyond = max(bound.low - goal, goal - bound.high)
        return None if abs(beyond) < SURELY else beyond < 0

    # -- the calls -----------------------------------------------------------------------------------------------------

    def draw(self) -> Call:
        """The next call."""
        return self.chance.choice(self.kinds())()

    def kinds(self) -> list[Callable[[], Call]]:
        """What there is to draw from, as often as it is to be drawn."""
        return [
            *[self.move] * 20, *[self.write] * 20, *[self.group] * 12, *[self.broadcast] * 4, *[self.two] * 12,
            *[self.again] * 10, *[self.rest] * 8, *[self.wait] * 10, *[self.reg_write] * 3,
        ]  # fmt: skip

    def spot(self, bus: str = "") -> Spot:
        """A device, of this bus if one is named."""
        return self.chance.choice([one for one in BOUNDS if bus in ("", one[0])])

    def move(self) -> Call:
        """A device by its own verb."""
        spot = self.spot()
        goal, device = self.goal(spot), self.device(spot)
        options = {"velocity": 1.5} if spot[0] == "arm" else {}
        return Call("move", lambda: device.move(goal, wait=False, **options), {spot: goal})

    def write(self) -> Call:
        """A register by its name."""
        spot = self.spot()
        goal, device = self.goal(spot), self.device(spot)
        return Call("write", lambda: device.write(goal_position=goal), {spot: goal})

    def reg_write(self) -> Call:
        """Handed over, and carried out by an ACTION."""
        spot = self.spot("arm")
        goal, device = self.goal(spot), self.device(spot)

        def both() -> None:
            device.reg_write(goal_position=goal)
            device.action()

        return Call("reg_write", both, {spot: goal})

    def group(self) -> Call:
        """Both servos in one packet, by either of the two ways there are."""
        goals = {spot: self.goal(spot) for spot in BOUNDS if spot[0] == "arm"}
        bus: Any = self.robot.buses["arm"]
        one, two = (self.device(spot) for spot in goals)
        first, second = goals.values()
        if self.chance.random() < 0.5:
            values = {one: {"goal_position": first}, two: {"goal_position": second}}
            return Call("sync_write", lambda: bus.run(sync_write(values)), goals)  # type: ignore[arg-type]
        return Call(
            "ServoGroup.write",
            lambda: bus.run(ServoGroup([one, two]).write("goal_position")([first, second])),
            goals,
        )

    def broadcast(self) -> Call:
        """Everyone on the CAN bus, of whom only one may be named."""
        goal = self.goal(self.spot("can"))
        named = [0x25] if self.chance.random() < 0.5 else [0x25, 0x26]
        bus: Any = self.robot.buses["can"]
        wants = dict.fromkeys((spot for spot in BOUNDS if spot[0] == "can"), goal)

        def send() -> object:
            return bus.run(broadcast_write("goal_position", goal, settings_of(bus), nodes=named))  # type: ignore[arg-type]

        return Call("broadcast", send, wants)

    def two(self) -> Call:
        """Two callers at the same time on one bus, each with one device of it."""
        name = self.chance.choice(("arm", "can"))
        wants = {spot: self.goal(spot) for spot in BOUNDS if spot[0] == name}
        bus: Any = self.robot.buses[name]

        return Call("two", lambda: bus.run(self._both(wants)), wants, each=True)

    async def _both(self, wants: dict[Spot, object]) -> object:
        return await gather(*[catch(self._write(spot, goal)) for spot, goal in wants.items()])

    async def _write(self, spot: Spot, goal: object) -> object:
        device = self.device(spot)
        return await type(device).write.function(device, goal_position=goal)

    def again(self) -> Call:
        """A call that was made before: its goal may be a lie by now."""
        if not self.kept:
            return self.move()
        return self.chance.choice(self.kept)

    def rest(self) -> Call:
        """Stop, hold, torque on or off: always allowed."""
        name = self.chance.choice([bound.axis for bound in BOUNDS.values()])
        axis = self.robot[name]
        verb = self.chance.choice(("stop", "hold", "enable_torque", "disable_torque"))
        return Call(verb, getattr(axis, verb, axis.stop), {})

    def wait(self) -> Call:
        """Let time pass, and sometimes look where something is."""
        seconds = self.chance.choice((0.001, 0.1, 0.3, 0.49, 0.51, 1.0, 3.0))

        def passes() -> None:
            for bus in self.robot.buses.values():
                bus.link.advance(seconds)  # type: ignore[attr-defined]
            if self.chance.random() < 0.5:
                self.robot.positions()

        return Call("wait", passes, {})

    # -- what became of them -------------------------------------------------------------------------------------------

    def make(self, call: Call) -> None:
        """Make a call and judge it."""
        self.freshen()
        verdicts = self.verdicts(call)
        for wire in self.wires.values():
            wire.forget()
        refused: Exception | None = None
        told: Any = None
        try:
            told = call.do()
        except (MotorbusError, TypeError) as error:
            refused = error
        self._judge_wires(call)
        if call.each:
            for (spot, goal), verdict, one in zip(call.wants.items(), verdicts, told, strict=True):
                failure = one if isinstance(one, MotorbusError) else None
                self._judge_call(call._replace(wants={spot: goal}), [verdict], failure)
        else:
            self._judge_call(call, verdicts, refused)
        if not (call.led or call.once) and self.chance.random() < 0.1:
            self.kept = [*self.kept[-20:], call]

    def verdicts(self, call: Call) -> list[bool | None]:
        """Whether each goal must reach its device, as things stand."""
        of = self.within if call.led else self.verdict
        return [of(spot, goal) for spot, goal in call.wants.items()]

    def freshen(self) -> None:
        """As often as not somebody has just looked where all are; else the bus has to look by itself."""
        if self.chance.random() < 0.5:
            self.robot.positions()

    def ordered(self, spot: Spot) -> list[float]:
        """Where the wire has ordered a device to go in this call (rad)."""
        return [one.to for one in self.wires[spot[0]].targets if one.node == spot[1]]

    def led_away(self, spot: Spot) -> bool:
        """Whether it was ordered to go anywhere in this call, and not only to stay where it is."""
        targets = (one for one in self.wires[spot[0]].targets if one.node == spot[1])
        return any(one.heard is None or abs(one.to - one.heard) > STAYS for one in targets)

    def _judge_wires(self, call: Call) -> None:
        for spot, bound in BOUNDS.items():
            for target in self.wires[spot[0]].targets:
                if target.node == spot[1]:
                    self.tally.targets += 1
                    assert target.heard is not None, (call.what, target)
                    assert bound.low - SLACK <= target.to <= bound.high + SLACK, (call.what, target, bound)
                    assert abs(target.to - target.heard) <= bound.step + SLACK, (call.what, target, bound)
        for speed in self.wires["arm"].speeds:
            self.tally.speeds += 1
            assert abs(speed.to) <= TURN + UNIT, (call.what, speed)
            assert speed.node != WHEEL or call.attended or not speed.to, (call.what, speed)
        for bus, node in call.barred:
            assert not self.led_away((bus, node)), (call.what, bus, node, self.wires[bus].targets)
            assert node not in self.wires[bus].powered, (call.what, bus, node)

    def _judge_call(self, call: Call, verdicts: list[bool | None], refused: Exception | None) -> None:
        if not verdicts or (None in verdicts and not call.barred):
            self.tally.close += 1
        elif all(verdicts) and not call.barred:
            assert refused is None, (call.what, call.wants, refused)
            for spot, goal in call.wants.items():
                assert isinstance(goal, int | float)
                ordered = self.ordered(spot)
                assert any(abs(one - goal) <= SLACK for one in ordered), (call.what, goal, ordered[-3:])
            self.tally.passed[call.what] += 1
        else:
            assert refused is not None, (call.what, call.wants)
            if call.led:
                assert not [spot for spot in call.wants if self.ordered(spot)], (call.what, call.wants)
            self.tally.refused[call.what] += 1


def drawn(caller: Caller, count: int) -> Iterator[Call]:
    """So many calls."""
    return (caller.draw() for _ in range(count))
