"""What a control loop keeps of servos says and does the same on the straight way as on the usual one, gate included."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import motorbus
from motorbus import feetech
from motorbus.bus import pump, volley
from motorbus.core.operation import UNLIKE, Data, Unlike
from motorbus.errors import MotorbusError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.feedback import position
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.motion.safety.guard import Bounds, Guard
from tests.bus.struck import Landings, struck

AT = re.compile(r"at=([-+.e\d]+)")  # of which the last digit is that of another sum
IDS = (1, 2, 3, 4)
GUARDED = (1, 2)
FAULTS = ("drop", "drop last", "corrupt", "late", "apart", "split", "surplus", "alarm", "alarm last")


class Gathered(PerfectLine):
    """Brings the answers to one request together, when the last one is there, and does the next fault to them."""

    def __init__(self) -> None:
        self.sent: list[Data] = []
        self.fault = ""
        self.due = 0
        self.held = b""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.HOST:
            self.sent.append(data)
            self.due, self.held = self._answers(data), b""
            return super().carry(sender, data, at)
        self.held, self.due = self.held + data, self.due - 1
        if self.due > 0:
            return []
        whole, self.held = self.held, b""
        fault, self.fault = self.fault, ""
        return [Delivery(at + later, Side.HOST, piece) for later, piece in struck(fault, whole)]

    def _answers(self, data: bytes) -> int:
        """How many will be given to the last packet of this."""
        packets = [one for one in wire.Splitter("instruction").feed(data) if hasattr(one, "instruction")]
        last: Any = packets[-1]
        return len(last.parameters) - 2 if last.instruction == wire.Instruction.SYNC_READ else 1


class Loop:
    """Four servos, two of them guarded, and all that a loop keeps of them; `told` is what the guards were told."""

    def __init__(self, bus: Any, simulated: Any) -> None:
        self.bus, self.simulated = bus, simulated
        known = bus.turns.known
        bus.admit.watch(known.seen, bus.link.now, known.stops, known.accepts, bus.turns.tell)
        self.servos = [feetech.Servo(bus, node) for node in IDS]
        for servo in self.servos:
            servo.prepare()
            servo.enable_torque()
        self.told: list[tuple[int, bool]] = []
        for node in GUARDED:
            self._guard(node)
        bus.link.line = self.line = Gathered()
        self.positions = feetech.sync_read_positions(self.servos)
        self.states = feetech.sync_read_states(self.servos[:2])
        self.others = feetech.sync_read_positions(self.servos[2:])
        self.goals = feetech.sync_writer(self.servos[:2], "goal_position")
        self.rows = feetech.sync_writer(self.servos, "goal_position", "goal_time", "goal_velocity")

    def _guard(self, node: int) -> None:
        self.bus.admit.guards[node] = Guard(
            f"n{node}",
            Bounds(0.5, 5.5, 1.5, 6.0),
            ask=lambda: position(self.servos[node - 1]),
            ordered=lambda moves: self.told.append((node, moves)),
        )

    def _otherwise(self) -> None:
        """Somebody changes the unit of a servo, and it is prepared anew."""
        memory = self.simulated[4].memory
        memory["angular_resolution"] = 3 - memory["angular_resolution"]
        self.servos[3].prepare()

    def step(self, what: str, goal: float) -> Any:
        """One thing that a loop does, and what came of it."""
        steps: dict[str, Callable[[], Any]] = {
            "one": self.servos[0].position,
            "three": self.servos[2].position,
            "positions": lambda: self.bus.run(self.positions),
            "states": lambda: self.bus.run(self.states),
            "others": lambda: self.bus.run(self.others),
            "goals": lambda: self.bus.run(self.goals([goal, goal])),
            "rows": lambda: self.bus.run(self.rows([(goal, 0.0, 1.0)] * 4)),
            "cycle": lambda: self.bus.volley(self.goals([goal, goal]), self.positions),
            "look": lambda: self.bus.volley(self.rows([(goal, 0.0, 1.0)] * 4), self.states),
            "alone": lambda: self.bus.volley(self.goals([goal, goal]), self.others),
            "mode": lambda: self.servos[3].write(goal_time=500),
            "settings": self._otherwise,
        }
        try:
            return AT.sub(lambda at: f"at={float(at[1]):.9f}", repr(steps[what]()))
        except MotorbusError as error:
            return type(error).__name__, str(error)

    def state(self) -> Any:
        """All that can be seen of the bus and its servos."""
        known, now = self.bus.turns.known, self.bus.link.now()
        nodes = {
            node: (one.sent, one.ok, one.retries, dict(one.errors), list(one.latency))
            for node, one in self.bus.statistics.nodes.items()
        }
        trust = {
            node: (one.tainted, one.length, one.run, [*one.outstanding])
            for node, one in self.bus.turns.trust.nodes.items()
        }
        seen = {node: (round(answer.at, 9), answer.replies) for node, (_, answer) in known.seen.items()}
        fresh = {node: answer and round(answer.at, 9) for node, answer in known.fresh(now).items()}
        servos = [(round(servo.at, 9), servo.alarm) for servo in self.servos]
        return nodes, trust, seen, fresh, servos, dict(self.bus.statistics.other), self.told, round(now, 9)


Step = tuple[str, float, str, float]


def carried_out(steps: list[Step]) -> Any:
    with (
        motorbus.simulate("feetech", ids="1-4") as simulated,
        motorbus.open(simulated.url) as bus,
    ):
        loop, found = Loop(bus, simulated), []
        for what, goal, fault, rest in steps:
            loop.line.fault = fault
            found.append(loop.step(what, goal))
            bus.link.advance(rest)  # type: ignore[attr-defined]
        return found, loop.line.sent, loop.state()


def usually(steps: list[Step]) -> Any:
    """The same without the straight way."""

    def never(*_: Any) -> Unlike:
        return UNLIKE

    with pytest.MonkeyPatch.context() as patch:
        for module, name in ((pump, "fly"), (pump, "cast"), (volley, "fly")):
            patch.setattr(module, name, never)
        return carried_out(steps)


def compare(steps: list[Step]) -> Any:
    straight, usual = carried_out(steps), usually(steps)
    for one, other in zip(straight, usual, strict=True):
        assert one == other
    return straight


WHAT = ("one", "three", "positions", "states", "others", "goals", "rows", "cycle", "look", "alone")
STEPS = st.lists(
    st.tuples(
        st.sampled_from((*WHAT, *WHAT, "mode", "settings")),
        st.sampled_from((3.0, 3.1, 3.3, 5.0, 6.0)),
        st.sampled_from(("",) * 3 * len(FAULTS) + FAULTS),
        st.sampled_from(
            (0.001, 0.004, 0.03, 0.6)
        ),  # time stands still here otherwise, which no real line does
    ),
    min_size=2,
    max_size=16,
)


@settings(max_examples=40)
@given(STEPS)
def test_a_loop_over_servos_is_the_same_on_both_ways(steps: list[Step]) -> None:
    compare(steps)


@pytest.mark.parametrize("what", [*WHAT, "mode", "settings"])
def test_what_is_kept_is_the_same_again_and_again(what: str) -> None:
    found = compare([(what, 3.0 + 0.01 * number, "", 0.005) for number in range(20)])[0]
    assert not any(isinstance(one, tuple) for one in found[5:])


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("what", ["positions", "states", "cycle", "look", "one"])
def test_a_fault_is_met_the_same_way(what: str, fault: str) -> None:
    steps = [(what, 3.1, "", 0.005)] * 8
    steps[4] = (what, 3.1, fault, 0.005)
    compare(steps)


def test_groups_of_servos_go_straight(monkeypatch: pytest.MonkeyPatch) -> None:
    landings = Landings(monkeypatch)
    carried_out([(what, 3.1, "", 0.005) for what in ("cycle", "states", "others", "one")] * 10)
    assert len(landings.groups) >= 27
    assert set(landings.groups) == {IDS, (1, 2), (3, 4)}


def test_the_gate_decides_the_same() -> None:
    steps = [("cycle", goal, "", 0.01) for goal in (3.0, 3.1, 3.2, 6.0, 3.1, 0.4, 5.4, 3.1)] * 2
    found = compare(steps)[0]
    assert [one[0] for one in found if isinstance(one, tuple)] == ["LimitExceeded"] * 6
