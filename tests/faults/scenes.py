"""What is done to one bus of each family: every kind of transaction, and whether what came of it is true.

A scene is a simulated bus with the real bus on it. Its kinds are operations that can be carried out blocking and
async; each says afterwards whether the device did it. What a scene reads to see whether its bus is right is another
value every time, so an answer to an older question is a wrong one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeAlias

from motorbus import families
from motorbus.bus.aio import AsyncBus
from motorbus.bus.pump import Bus
from motorbus.core.operation import Data, Runnable, Together
from motorbus.families.feetech import sync_read
from motorbus.families.stepper import Program
from motorbus.families.stepper.execution import Phase
from motorbus.families.stepper.table import Project, Step, with_steps
from motorbus.link.base import Delivery, Line, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from tests.support.world import said

IDS = {"feetech": (1, 2, 3), "kst": (0x21, 0x22, 0x23), "stepper": (1,)}
MADE: dict[str, dict[str, Any]] = {
    "feetech": {},
    "kst": {"profile": "kst-ext"},
    "stepper": {"home_switch": "wired", "home_at": -30},
}
"""How the devices are simulated."""
STORED = with_steps(
    Project(number=1, microsteps=8, step_angle=180, turn_distance=400),
    (Step(distance=20, direction=1, start_frequency=60, acceleration=40, speed=90, delay=30),),
)
NEW = with_steps(STORED, (Step(distance=30, start_frequency=60, acceleration=40, speed=90, delay=30),))
COUNTS = {"feetech": 4096, "kst": 3600}
"""Raw positions in a turn."""


class Wire(PerfectLine):
    """A perfect line that keeps what the host has sent."""

    def __init__(self) -> None:
        self.sent: list[Data] = []

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.heard(data)
        return super().carry(sender, data, at)

    def heard(self, data: Data) -> None:
        """The host has sent this."""
        self.sent.append(data)


class Scene:
    """A simulated bus of one family with the real bus on it; `face` says which of the two."""

    def __init__(
        self,
        family: str,
        *,
        line: Line | None = None,
        face: type[Bus] | type[AsyncBus] = Bus,
        link: type[MemoryLink] = MemoryLink,
        **more: Any,
    ) -> None:
        self.name = family
        self.ids = IDS[family]
        found = families.load(family)
        options = MADE[family]
        settings = {one.name for one in found.link.settings}
        self.family = found.configured(**{key: value for key, value in options.items() if key in settings})
        made: Any = found.simulator(self.ids, **options)
        self.simulator = made
        if family == "stepper":
            made.nodes[1].put(1, STORED)
        self.wire = Wire()
        self.link = link(self.simulator, rate=found.link.rate, line=line or self.wire, **more)
        self.events: list[object] = []
        self.bus: Any = face(self.link, self.family, interlock=Gate(), report=self.events.append)
        self.run: Callable[[Any], Any] = self.bus.run  # on an event loop whoever has one sets another
        self.devices: list[Any] = [self.family.devices.blocking(self.bus, node) for node in self.ids]
        self.count = 0

    def said(self, verb: str, *arguments: object, device: int = 0, **named: object) -> Runnable[Any]:
        """The operation behind a verb of a device, not yet begun."""
        return said(self.devices[device], verb, *arguments, **named)

    def node(self, device: int = 0) -> Any:
        """The simulated device."""
        return self.simulator.nodes[self.ids[device]]

    def stir(self, device: int = 0) -> None:
        """Make what `asked` reads another value than it has had lately."""
        self.count += 1
        if self.name == "stepper":
            self.node().set_input(2, self.count % 3 == 0)
        else:
            self.node(device).raw_position = 11 + self.count * 131 % 700

    def asked(self, device: int = 0) -> Runnable[Any]:
        """Read what `stir` changes."""
        return self.said("read_input", 2) if self.name == "stepper" else self.said("position", device=device)

    def true(self, value: Any, device: int = 0) -> bool:
        """Whether what was read is so now, but for what it has moved since."""
        if self.name == "stepper":
            return bool(value) == (self.count % 3 == 0)
        row = self.devices[device].table["present_position"]
        turn = COUNTS[self.name]
        apart = (row.to_raw(value) - self.node(device).raw_position + turn // 2) % turn - turn // 2
        return abs(int(apart)) <= 20

    def settle(self) -> None:
        """Let everything that is under way come to its end."""
        self.link.advance(1.0)

    def moving(self) -> bool:
        """Whether anything turns."""
        if self.name == "stepper":
            return self.node().state.phase is not Phase.IDLE
        return any(bool(node.status()["moving"]) for node in self.simulator.nodes.values())


Act: TypeAlias = "Callable[[Scene], Runnable[Any]]"


def nothing(there: Scene) -> None:
    """What need not be prepared."""


class Kind(NamedTuple):
    """A kind of transaction: how it is prepared, what it is, and whether the device has done it by now."""

    family: str
    act: Act
    done: Callable[[Scene, Any], bool]
    prepare: Callable[[Scene], None] = nothing


def raw(name: str, wanted: int) -> Callable[[Scene, Any], bool]:
    """Whether the device holds this in a row."""
    return lambda there, value: bool(there.node().memory[name] == wanted)


def all_true(there: Scene, values: Iterable[Any]) -> bool:
    """Whether each device is where it was said to be."""
    return all(there.true(value, device) for device, value in enumerate(values))


def positions(there: Scene) -> Runnable[Any]:
    """Everyone's, together."""
    return iter(Together([there.asked(device) for device in range(len(there.ids))]))


def torque(there: Scene) -> None:
    """Everyone holds."""
    for device in range(len(there.devices)):
        there.run(there.said("enable_torque", device=device))


def at(place: float) -> Callable[[Scene, Any], bool]:
    """Whether the device is there (rad) and stands."""
    return lambda there, _: abs(there.devices[0].position() - place) < 0.05 and not there.moving()


def middle(there: Scene, _: Any) -> bool:
    """Whether it tells the middle of its turn as where it is."""
    return abs(int(there.node().raw_position) - 2048) <= 2


def stands(there: Scene, _: Any) -> bool:
    """Whether nothing turns, or only as long as it takes to come to rest."""
    there.settle()
    return not there.moving()


def off(there: Scene) -> None:
    """A long movement that is not waited for."""
    if there.name == "feetech":
        there.run(there.said("enable_torque"))
        there.run(there.said("move", 6.0, velocity=0.5, wait=False))
    elif there.name == "kst":
        there.run(there.said("move", 1.5, wait=False))
    else:
        there.run(there.said("start_project", 1))


KINDS: dict[str, Kind] = {
    "feetech read": Kind("feetech", Scene.asked, Scene.true),
    "feetech write": Kind(
        "feetech", lambda there: there.said("write", acceleration=8.0), lambda there, _: acceleration(there)
    ),
    "feetech guarded write": Kind(
        "feetech", lambda there: there.said("write", max_temperature=61), raw("max_temperature", 61)
    ),
    "feetech sync read": Kind(
        "feetech",
        lambda there: sync_read(["present_position"], there.devices),
        lambda there, told: all_true(there, [told.values[node]["present_position"] for node in there.ids]),
    ),
    "feetech torque": Kind("feetech", lambda there: there.said("enable_torque"), raw("torque_enable", 1)),
    "feetech stop": Kind("feetech", lambda there: there.said("stop"), stands, off),
    "feetech home": Kind("feetech", lambda there: there.said("calibrate"), middle),
    "feetech run": Kind("feetech", lambda there: there.said("move", 3.3), at(3.3), torque),
    "kst read": Kind("kst", Scene.asked, Scene.true),
    "kst write": Kind(
        "kst",
        lambda there: there.said("set_reversed", True),
        lambda there, _: bool(there.devices[0].reversed()),
    ),
    "kst guarded write": Kind(
        "kst", lambda there: there.said("set_travel_limits", -0.8, 0.9), raw("positive_limit", 516)
    ),
    "kst read together": Kind("kst", positions, all_true),
    "kst stop": Kind("kst", lambda there: there.said("stop"), stands, off),
    "kst home": Kind("kst", lambda there: there.said("set_mid_point"), at(0.0)),
    "kst run": Kind("kst", lambda there: there.said("move", 0.2), at(0.2)),
    "stepper read": Kind("stepper", Scene.asked, Scene.true, Scene.stir),
    "stepper write": Kind(
        "stepper",
        lambda there: there.said("set_output", 1, 1),
        lambda there, _: bool(there.node().outputs[0]),
    ),
    "stepper guarded write": Kind(
        "stepper",
        lambda there: there.said("write_project", Program(project=NEW)),
        lambda there, _: bool(there.node().store.project(1).step(1).distance == 30),
    ),
    "stepper dump": Kind(
        "stepper",
        lambda there: there.said("read_project", 1),
        lambda there, told: bool(told.project.step(1).distance == 20),
    ),
    "stepper stop": Kind("stepper", lambda there: there.said("stop"), stands, off),
    "stepper home": Kind("stepper", lambda there: there.said("home", deadline=5.0), stands),
    "stepper run": Kind("stepper", lambda there: there.said("run", 1), stands),
}
"""Each kind of transaction of each family: read, write, guarded write, sync read, stop, home and run."""


def acceleration(there: Scene) -> bool:
    """Whether the device holds the acceleration that it was told."""
    row = there.devices[0].table["acceleration"]
    return abs(float(row.to_value(there.node().memory["acceleration"])) - 8.0) < 1.0
