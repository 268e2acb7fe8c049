"""Calls that lead axes: movements, poses, trajectories, loops, followers, jogs, and the teaching of what is let go.

Each is made where the axes stand still and have torque, and the place at which it must end is reckoned by hand, from
the velocity and the acceleration that the machine file allows. What is beyond the limits must be refused before
anything moves.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan, radians, sqrt
from typing import Any

from motorbus.motion.trajectory import Trajectory
from tests.safety.calls import BOUNDS, TURN, Call, Caller, Spot

POSE = {"a1": 10, "c1": -5}
POSES = "[pose.ready]\n" + "".join(f'{name} = "{place} deg"\n' for name, place in POSE.items())
ACCELERATION = radians(360)
"""rad/s² that each of these axes may have."""
SPOTS: dict[str, Spot] = {bound.axis: spot for spot, bound in BOUNDS.items()}
STILL = 1.5
"""s after which whatever was ordered has come to its end."""


class Courses(Caller):
    """Draws these calls too."""

    def kinds(self) -> list[Callable[[], Call]]:
        led = (self.lead, self.alone, self.pose, self.replay, self.jog, self.jogging, self.loop, self.follow)
        return [*super().kinds() * 2, *led, self.teach, self.loose]

    # -- where axes are ------------------------------------------------------------------------------------------------

    def settled(self, *names: str) -> None:
        """These stand still and have torque."""
        for bus in self.robot.buses.values():
            bus.link.advance(STILL)  # type: ignore[attr-defined]
        for name in names:
            axis: Any = self.robot[name]
            if "enable_torque" in axis.able:
                axis.enable_torque()

    def of_device(self, name: str, place: float) -> float:
        """rad of the device of an axis."""
        spec = self.robot[name].spec
        return spec.zero + spec.sign * place

    def stands(self, name: str) -> float:
        """Where an axis is (rad of the axis)."""
        spec = self.robot[name].spec
        return (self.really(SPOTS[name]) - spec.zero) * spec.sign

    def some(self) -> list[str]:
        """One axis or several."""
        return self.chance.sample(sorted(SPOTS), self.chance.randint(1, 3))

    def led(self, what: str, goals: dict[str, float], do: Callable[[], object]) -> Call:
        """A call that must lead these axes there."""
        self.settled(*goals)
        wants = {SPOTS[name]: self.of_device(name, to) for name, to in goals.items()}
        return Call(what, do, wants, led=True)

    # -- the calls -----------------------------------------------------------------------------------------------------

    def lead(self) -> Call:
        """A movement of several axes."""
        goals = {name: self.chance.uniform(-0.8, 0.8) for name in self.some()}
        return self.led("robot.move", goals, lambda: self.robot.move(goals))

    def alone(self) -> Call:
        """A movement of one axis."""
        name, to = (
            self.chance.choice(sorted(SPOTS)),
            self.chance.choice((nan, inf, *[0.6, 0.3, -0.3, 0.1] * 2)),
        )
        return self.led("axis.move", {name: to}, lambda: self.robot[name].move(to))

    def pose(self) -> Call:
        """A pose of the file."""
        goals = {name: radians(place) for name, place in POSE.items()}
        return self.led("robot.pose", goals, lambda: self.robot.pose("ready"))

    def replay(self) -> Call:
        """A trajectory, within the limits or not."""
        name, far = self.chance.choice(("a1", "c1")), self.chance.uniform(-0.9, 0.9)
        parts = [step / 50 for step in range(51)]
        places = [far * (10 * part**3 - 15 * part**4 + 6 * part**5) for part in parts]
        seconds = max(
            1.25 * abs(far), sqrt(6 * abs(far) / ACCELERATION), 0.1
        )  # its peaks: 1.875/s and 5.77/s²
        made = Trajectory([seconds * part for part in parts], {name: places})
        return self.led("robot.replay", {name: far}, lambda: self.robot.replay(made, rate=50))

    def jog(self) -> Call:
        """At a velocity for a time, of which it takes some to start and to stop."""
        name, seconds = self.chance.choice(sorted(SPOTS)), self.chance.choice((0.2, 0.4, 0.6))
        velocity = self.chance.choice((-1, 1)) * self.chance.uniform(0.2, TURN)
        self.settled(name)
        ramp = min(abs(velocity) / ACCELERATION, seconds / 2)
        way = ACCELERATION * ramp * (seconds - ramp) * (1 if velocity > 0 else -1)
        axis: Any = self.robot[name]
        return self.led("axis.jog", {name: self.stands(name) + way}, lambda: axis.jog(velocity, seconds))

    def jogging(self) -> Call:
        """Two beats of a fifth of a second, if there is room for them; else it ends at the limit."""
        name, velocity = self.chance.choice(sorted(SPOTS)), self.chance.choice((-0.3, 0.3))
        self.settled(name)
        to = self.stands(name) + 2 * 0.2 * velocity

        def beats() -> None:
            with self.robot.jogging(name, velocity) as hand:
                hand.beat()
                hand.beat()

        return self.if_roomy("robot.jogging", name, to, 0.1, beats)

    def if_roomy(self, what: str, name: str, to: float, room: float, do: Callable[[], object]) -> Call:
        """A call that must lead there if so much (rad) is left behind that place, and may do as it likes if not."""
        spot, wanted = SPOTS[name], self.of_device(name, to)
        roomy = all(self.within(spot, wanted + way) for way in (-room, room))
        return self.led(what, {name: to}, do) if roomy else Call(what, do, {})

    def loop(self) -> Call:
        """Cycles with one small goal, led there by the loop or ordered at once."""
        name, way = self.chance.choice(("a1", "c1")), self.chance.choice((-0.03, 0.03))
        direct = self.chance.random() < 0.5
        self.settled(name)
        to = self.stands(name) + way

        def cycles() -> None:
            with self.robot.loop(rate=50, axes=[name], direct=direct) as loop:
                for state in loop:
                    loop.goal[name] = to
                    if state.number >= 12:
                        break

        return self.led(f"robot.loop{' direct' if direct else ''}", {name: to}, cycles)

    def follow(self) -> Call:
        """Another axis comes to where one stands that was let go."""
        leader, follower = self.chance.choice((("a1", "c1"), ("a1", "a2"), ("a2", "c2"), ("a2", "a1")))
        self.settled(follower)
        to = self.stands(leader)
        seconds = 0.4 + abs(to - self.stands(follower)) / TURN
        return self.if_roomy(
            "robot.follow",
            follower,
            to,
            0.05,
            lambda: self.robot.follow({leader: follower}, seconds=seconds, rate=50),
        )

    def teach(self) -> Call:
        """Nobody is told anything but to stay, and to let go."""

        def taught() -> None:
            self.robot.teach(["a1", "a2"], seconds=0.1)
            assert not any(self.led_away(("arm", node)) for node in (1, 2))

        return Call("robot.teach", taught, {})

    def loose(self) -> Call:
        """A few cycles with whatever goals."""
        direct = self.chance.random() < 0.5

        def cycles() -> None:
            with self.robot.loop(rate=50, axes=["a1", "c1"], direct=direct) as loop:
                for state in loop:
                    for name in ("a1", "c1"):
                        goal = self.chance.choice((nan, inf, 0.01, -0.02, 2.0, state.position[name] + 0.01))
                        loop.goal[name] = goal
                    if state.number >= 3:
                        break

        return Call("robot.loop of odd goals", cycles, {})
