"""Calls when something is the matter: an order that waits, a fault, a lease that nobody holds, a wheel, raw numbers,
and callers that are threads.

Each is drawn like the others and judged by what went over the wires. An order that was handed over and is carried out
later, by whomever, is judged when it begins: where the servo is by then, and what is the matter by then, counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf, isfinite, nan, pi
from typing import Any

import motorbus
from motorbus.core.request import Effect, Request
from motorbus.errors import MotorbusError
from motorbus.families.feetech import ServoGroup, action_all, protocol, sync_write
from motorbus.families.kst import broadcast_write, settings_of
from motorbus.motion.safety.lease import Lease
from motorbus.session.robot import Robot
from motorbus.simulation.named import Simulation
from tests.safety.calls import BOUNDS, SLACK, TURN, UNIT, WHEEL, Call, Spot
from tests.safety.courses import Courses
from tests.safety.decoders import COUNT, SPEED, TENTH, FeetechWitness

LONG = 60.0
"""s until a thread that hangs says so."""


class Matters(Courses):
    """Draws all there is. The bus `arm` has a third servo, which turns as a wheel."""

    def __init__(self, robot: Robot, sims: Mapping[str, Simulation], seed: int) -> None:
        super().__init__(robot, sims, seed)
        self.then: list[Callable[[], Call]] = []
        self.line = self.wires["arm"] = FeetechWitness()
        robot["a3"].device.set_mode("velocity")
        robot["a3"].enable_torque()

    def kinds(self) -> list[Callable[[], Call]]:
        more = (self.late, self.fault, self.unheld, self.held, self.wheel, self.raw)
        return [*super().kinds(), *[*more, self.late] * 3, self.wheel_later, self.bare]

    def draw(self) -> Call:
        return self.then.pop(0)() if self.then else super().draw()

    # -- an order that waits -------------------------------------------------------------------------------------------

    def late(self) -> Call:
        """Handed over now; then time passes, or it is moved; then an ACTION, by whomever."""
        spot = self.spot("arm")
        here = self.here(spot)
        way = self.chance.choice((-1, 1)) * self.chance.uniform(0.3, 0.9) * BOUNDS[spot].step
        goal, away, device = here + way, here - way, self.device(spot)
        between = [lambda: Call("write", lambda: device.write(goal_position=away), {spot: away}), self.wait]
        act, fault = (lambda: self.action(spot, goal)), (lambda: self.fault(spot))
        self.then = [
            *self.chance.sample(between, self.chance.randint(0, 2)),
            self.chance.choice((act, act, act, fault)),
        ]
        return Call("reg_write alone", lambda: device.reg_write(goal_position=goal), {spot: goal})

    def action(self, spot: Spot, goal: float) -> Call:
        """ACTION for one or for all, by the object that knows of it or by another.

        What has waited since before this goal, as where that was refused, may be refused, for it may have been stopped.
        """
        bus: Any = self.robot.buses["arm"]
        device = self.device(spot)
        every = {("arm", node): to for one in (1, 2) for node, to in self.line.place(one)}
        if abs(every.get(spot, inf) - goal) > SLACK:
            every = {}
        own = {one: to for one, to in every.items() if one == spot}
        every = every if every == own else {}
        calls: list[tuple[str, Callable[[], object], dict[Spot, float]]] = [
            ("action", device.action, own),
            ("action by another", lambda: motorbus.feetech.Servo(bus, spot[1]).action(), own),
            ("action_all", lambda: bus.run(action_all([device])), every),
        ]
        return Call(*self.chance.choice(calls), once=True)

    # -- who may not move ----------------------------------------------------------------------------------------------

    def orders(self, spot: Spot, goal: float) -> list[Callable[[], object]]:
        """Ways to order one device to a place."""
        bus: Any = self.robot.buses[spot[0]]
        device, other = self.device(spot), self.device((spot[0], sum(_pair(spot)) - spot[1]))
        name, there = BOUNDS[spot].axis, self.here((spot[0], other.node))
        to = (goal - self.robot[name].spec.zero) * self.robot[name].spec.sign
        common = [
            lambda: device.write(goal_position=goal),
            lambda: self.robot.move({name: to}),
            lambda: self.robot[name].move(to),
        ]
        if spot[0] == "can":
            return [
                *common,
                lambda: device.move(goal, wait=False),
                lambda: _broadcast(bus, goal, [other.node]),
                lambda: _broadcast(bus, goal, _pair(spot)),
            ]
        return [
            *common,
            lambda: device.move(goal, wait=False, velocity=1.0),
            lambda: device.reg_write(goal_position=goal),
            lambda: motorbus.feetech.Servo(bus, spot[1]).write(goal_position=goal),
            lambda: bus.run(sync_write({device: {"goal_position": goal}, other: {"goal_position": there}})),
            lambda: bus.run(ServoGroup([other, device]).write("goal_position")([there, goal])),
            lambda: self.robot[name].enable_torque(),
            lambda: device.enable_torque(),
        ]

    def near(self, spot: Spot) -> float:
        """A place where it may go, away from where it is."""
        bound, here = BOUNDS[spot], self.here(spot)
        way = self.chance.uniform(0.3, 0.7) * bound.step
        return here + way if here < (bound.low + bound.high) / 2 else here - way

    def fault(self, waits: Spot | None = None) -> Call:
        """One is at fault, and is ordered to where it might go, by any spelling; or what waits there is carried out."""
        spot = waits or self.spot()
        order = self.chance.choice(self.orders(spot, self.near(spot)))
        late = waits is not None and any(self.line.place(spot[1]))
        if late:
            order = self.action(spot, inf).do

        def ordered() -> None:
            bus: Any = self.robot.buses[spot[0]]
            faults = bus.interlock.faults
            faults[spot[1]] = "of this test"
            try:
                order()
            finally:
                self.device(spot).stop()
                del faults[spot[1]]

        what = "action at fault" if late else "at fault"
        return Call(what, ordered, {spot: nan}, barred=[spot], once=True)

    def unheld(self) -> Call:
        """The machine has a lease that nobody holds, or that was lost."""
        spot, lease, lost = self.spot(), Lease(0.5), self.chance.random() < 0.3
        order = self.chance.choice(self.orders(spot, self.near(spot))[:4])

        def ordered() -> None:
            if lost:
                lease.take("who fell silent", self.robot.now)
            self.robot.lease = lease
            for bus in self.robot.buses.values():
                bus.link.advance(1.0)  # type: ignore[attr-defined]
            try:
                order()
            finally:
                lease.reset(self.robot.now)
                self.robot.lease = None

        return Call("without the lease", ordered, {spot: nan}, barred=list(BOUNDS))

    def held(self) -> Call:
        """The machine has a lease, and it is held."""
        spot = self.spot()
        goal, lease = self.goal(spot), Lease(None)

        def ordered() -> None:
            lease.take("this test", self.robot.now)
            self.robot.lease = lease
            try:
                self.device(spot).write(goal_position=goal)
            finally:
                lease.release("this test", self.robot.now)
                self.robot.lease = None

        return Call("with the lease", ordered, {spot: goal})

    # -- what turns without an end -------------------------------------------------------------------------------------

    def wheel(self) -> Call:
        """A velocity, by any spelling: while somebody attends it leaves, and while nobody does only a 0."""
        bus: Any = self.robot.buses["arm"]
        device = self.robot["a3"].device
        wanted = self.chance.choice((0.0, nan, inf, 100.0, *[self.chance.uniform(-2, 2) for _ in range(6)]))
        spellings: list[Callable[[], object]] = [
            lambda: device.set_velocity(wanted),
            lambda: device.write(goal_velocity=wanted),
            lambda: bus.run(sync_write({device: {"goal_velocity": wanted}})),
            lambda: motorbus.feetech.Servo(bus, WHEEL).set_velocity(wanted),
            lambda: (device.reg_write(goal_velocity=wanted), device.action()),
        ]
        order, attends = self.chance.choice(spellings), self.chance.random() < 0.5
        fine = isfinite(wanted) and abs(wanted) < TURN - UNIT and (attends or abs(wanted) < SPEED / 2)
        surely = isfinite(wanted) and abs(abs(wanted) - TURN) < 2 * UNIT
        close = surely or (not attends and 0 < abs(wanted) < SPEED)

        def turned() -> None:
            try:
                self._attended(order, attends)
            except (MotorbusError, TypeError):
                assert close or not fine, (wanted, attends)
                raise
            ordered = [one.to for one in self.wires["arm"].speeds if one.node == WHEEL]
            assert close or fine, (wanted, attends, ordered)
            assert close or any(abs(one - wanted) <= UNIT for one in ordered), (wanted, ordered)
            self.tally.passed["wheel"] += 1

        return Call("wheel", turned, {}, attended=attends)

    def wheel_later(self) -> Call:
        """A velocity that was handed over while somebody attended, and is to begin when nobody does."""
        device, velocity = self.robot["a3"].device, self.chance.choice((-1.0, 1.0))

        def ordered() -> None:
            with self.robot.attended():
                device.reg_write(goal_velocity=velocity)
            try:
                device.action()
            except MotorbusError:
                self.tally.refused["wheel later"] += 1
            else:
                raise AssertionError("it turns, and nobody attends")
            finally:
                device.reg_write(goal_velocity=0.0)

        return Call("wheel later", ordered, {})

    def _attended(self, order: Callable[[], object], attends: bool) -> None:
        if not attends:
            order()
            return
        with self.robot.attended():
            order()
        node: Any = self.sims["arm"][WHEEL]
        assert not node.memory["goal_velocity"], "it is stopped when nobody attends any more"

    # -- raw numbers ---------------------------------------------------------------------------------------------------

    def raw(self) -> Call:
        """Any word of 16 bit, also turns away and with the sign bit, as the angle that it means."""
        spot = self.spot()
        count = COUNT if spot[0] == "arm" else TENTH
        here = round(self.here(spot) / count)
        turn = round(2 * pi / count)
        near = [here + self.chance.randint(-100, 100) for _ in range(3)]
        word = self.chance.choice(
            (*near, here + turn, here - turn, here + 2 * turn, -here, here | 0x8000, 0xFFFF)
        )
        goal, device = word * count, self.device(spot)
        return Call("raw", lambda: device.write(goal_position=goal), {spot: goal})

    def bare(self) -> Call:
        """Bytes to the goal register, of which nobody says what they mean."""
        node, goal = self.spot("arm")[1], self.chance.randrange(1 << 16)
        bus: Any = self.robot.buses["arm"]
        request = protocol.write(node, 42, goal.to_bytes(2, "little"))
        return Call(
            "bytes",
            lambda: bus.run(Request[Any](request, (), lane=node, effect=Effect.MOTION)),
            {("arm", node): nan},
            barred=[("arm", node)],
        )


def _broadcast(bus: Any, goal: Any, nodes: list[int]) -> object:
    return bus.run(broadcast_write("goal_position", goal, settings_of(bus), nodes=nodes))


def _pair(spot: Spot) -> list[int]:
    """The nodes of its bus that have bounds."""
    return [node for bus, node in BOUNDS if bus == spot[0]]
