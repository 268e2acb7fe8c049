"""Rows L6 to L8 and L16 on the straight way: answers late by any multiple, copies, echoes, and others who look.

As in `test_lines`, for what a control loop keeps.
"""

from __future__ import annotations

import heapq
from random import Random

import pytest

from motorbus.core.operation import Data
from motorbus.errors import MotorbusError
from motorbus.families.feetech import FAMILY, wire
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.memory import NoisyLine
from tests.bus.struck import Landings
from tests.conftest import Figures, Rounds
from tests.faults.off import are_off
from tests.faults.single import tried_again
from tests.faults.straight import GROUP, KEPT, StraightRig
from tests.faults.test_lines import Belated, Doubled

NAMES = list(KEPT)
RATE = 1_000_000
BYTE_TIME = 10 / RATE
"""s of one byte on the line of these rigs."""
MARGIN = 0.020
"""s that host and adapter may take, on top of what wire and servo take."""


def try_(name: str, rig: StraightRig) -> bool:
    """False when it failed honestly; a wrong value is an AssertionError."""
    try:
        KEPT[name].act(rig)
    except MotorbusError:
        return False
    return True


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("share", [0.3, 0.95])
def test_l6_delay_within_the_budget_is_no_fault_on_the_straight_way(
    name: str, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whose answer comes at 0.95 of it would be missed by a deadline that is but a tenth short."""
    rig, landings = StraightRig(), Landings(monkeypatch)
    KEPT[name].act(rig)
    exchange = KEPT[name].kept(rig)
    budget = FAMILY.air_time(exchange, RATE) + FAMILY.turnaround(exchange) + MARGIN
    rig.put(line := Belated(share * budget))
    for _ in range(200):
        KEPT[name].act(rig)
    assert line.fired >= 200
    assert rig.struck > 150
    assert len(landings.ids) > 200
    assert (tried_again(rig.bus), rig.missing) == (0, 0)


@pytest.mark.parametrize("by", [0.1, 0.5, 1.0, 2.0, 10.0, 50.0])
def test_l7_answers_on_the_straight_way_late_by_any_multiple_of_the_timeout(
    by: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    timeout, landings = 0.022, Landings(monkeypatch)
    line = NoisyLine(3, late=0.1, late_by=(by * timeout * 0.9, by * timeout * 1.1))
    rig = StraightRig(line)
    for _ in range(40):
        for name in NAMES:
            try_(name, rig)
    assert line.count("late") > 15
    assert rig.struck > 0
    assert len(landings.ids) > 0
    rig.put(PerfectLine())
    rig.link.advance(10.0)
    for name in NAMES:
        try_(name, rig)
        KEPT[name].act(rig)


def test_l7_a_copy_of_an_answer_is_not_taken_for_the_next_one_on_the_straight_way(
    rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A single reading takes turns with its other form, and each copy is as long as the answer before."""
    seed, landings, total = 5, Landings(monkeypatch), rounds(100_000)
    line = Doubled(seed, 0.001)
    rig = StraightRig(line)
    good = sum(try_("position()", rig) for _ in range(total))
    figures(
        "L7 answers with a copy behind, position() on the straight way",
        family="feetech", seed=seed, reads=total, copies=line.fired, straight=len(landings.ids), failed=total - good,
    )  # fmt: skip
    assert line.fired > total / 100
    assert len(landings.ids) > 0.9 * total
    assert good == total


class TooSoon(PerfectLine):
    """Every so often a train comes twice; its copy is there when the next question is being heard."""

    def __init__(self, seed: int, within: float) -> None:
        self.random = Random(seed)
        self.within = within
        self.fired = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        deliveries = super().carry(sender, data, at)
        if sender is Side.DEVICE and self.random.random() < 0.05:
            self.fired += 1
            deliveries.append(Delivery(at + self.random.uniform(1e-5, self.within), Side.HOST, data))
        return deliveries


@pytest.mark.parametrize("name", ["position()", "sync_read_positions", "sync_read_raw", "sync_read_states"])
def test_l7_what_comes_sooner_than_its_bits_can_travel_answers_an_older_question(
    name: str, rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The copy of a whole train looks just like the next one: on a line that takes its time it is too soon."""
    seed, landings, total = 6, Landings(monkeypatch), rounds(100_000)
    rig, kind = StraightRig(options={"pace": True}), KEPT[name]
    request = kind.kept(rig).request
    assert isinstance(request, bytes)
    line = TooSoon(seed, within=0.85 * (len(request) + kind.back) * BYTE_TIME)
    rig.put(line)
    good = sum(try_(name, rig) for _ in range(total))
    figures(
        f"L7 answers with a copy behind that comes too soon for the next one, {name} on the straight way",
        family="feetech", seed=seed, reads=total, copies=line.fired, straight=len(landings.ids), failed=total - good,
    )  # fmt: skip
    assert line.fired > total / 50
    assert rig.struck > total / 50
    assert len(landings.ids) > 0.5 * total
    assert good > 0.9 * total


@pytest.mark.parametrize("watched", [False, True], ids=["straight", "usual"])
@pytest.mark.parametrize("later", [300, 330, 400, 470])
def test_l7_what_comes_before_the_question_behind_an_order_can_be_answered_is_none(
    later: int, watched: bool
) -> None:
    """The question of a volley passes behind its order, and cannot be answered sooner than that."""
    rig = StraightRig(ids=GROUP, options={"pace": True})
    for _ in range(3):
        KEPT["volley"].act(rig)
    if watched:  # then it goes the usual way
        rig.bus.trace.subscribe()
    rig.stir()
    places = [rig.servos[node].raw_position for node in GROUP]
    old = [(place + 1000) % 4096 for place in places]
    length = rig.bus.turns.trust.nodes[GROUP[0]].length
    packets = (
        wire.encode_status(node, 0, (place.to_bytes(2, "little") + b"\0")[: length - 6])
        for node, place in zip(GROUP, old, strict=True)
    )
    order = rig.order([float(rig.row.to_value(place)) for place in places])
    came = rig.link.now() + later * 1e-6
    if not are_off():
        heapq.heappush(rig.link._under_way, (came, -1, Side.HOST, b"".join(packets)))
    _, told = rig.bus.volley(order, rig.positions)
    assert [rig.bus.statistics.nodes[node].errors["early"] for node in GROUP] == [1, 1, 1], "it was not heard"
    assert [rig.row.to_raw(angle) for angle in told.values.values()] == places


@pytest.mark.parametrize("name", NAMES)
def test_l8_an_echo_that_begins_suddenly_forges_no_answer_on_the_straight_way(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Switched on while exchanges go straight, off, and on again; once it is excluded they go straight again."""
    line, landings = NoisyLine(1), Landings(monkeypatch)
    rig, kind = StraightRig(line), KEPT[name]
    for _ in range(4):
        landed = len(landings.ids)
        for _ in range(12):
            try_(name, rig)
        assert len(landings.ids) > landed, "it does not go straight"
        line.echo = True
        for _ in range(8):
            try_(name, rig)
        line.echo = False
        for _ in range(8):
            try_(name, rig)
        rig.bus.turns.echo.excluded()
        rig.link.advance(1.0)
        kind.act(rig)
    assert line.count("echo") > 20


@pytest.mark.parametrize("name", NAMES)
def test_l8_a_damaged_echo_forges_nothing_on_the_straight_way_either(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    faults = ("corrupt", "lose_byte", "insert_byte", "split")
    landings, rig, fired = Landings(monkeypatch), StraightRig(), 0
    for seed in range(40):
        rig.put(PerfectLine())
        rig.bus.turns.echo.excluded()
        rig.link.advance(1.0)
        try_(name, rig)
        landed = len(landings.ids)
        KEPT[name].act(rig)
        assert len(landings.ids) > landed, "it does not go straight"
        harm = {fault: 0.3 for fault in faults if fault != "split"}
        line = NoisyLine(seed, echo=True, split=bool(seed % 2), **harm)  # type: ignore[arg-type]
        rig.put(line)
        for _ in range(4):
            try_(name, rig)
        fired += line.count("echo") > 0 and any(line.count(fault) for fault in faults)
    assert fired > 30


class Onlookers(PerfectLine):
    """While every third answer is on its way somebody else looks at the bus, as another thread may."""

    def __init__(self) -> None:
        self.rig: StraightRig | None = None
        self.answers = self.looks = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        self.answers += sender is Side.DEVICE
        if sender is Side.DEVICE and self.rig is not None and self.answers % 3 == 0:
            self.looks += self.rig.bus.turns.aloft is not None
            self.rig.bus.turns.made_good()
        return super().carry(sender, data, at)


@pytest.mark.parametrize("name", NAMES)
def test_l16_somebody_who_looks_while_an_answer_is_on_its_way_neither_loses_nor_doubles_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    line, landings = Onlookers(), Landings(monkeypatch)
    rig = StraightRig(line)
    ledger = rig.bus.statistics.of(1)
    rig.bus.turns.made_good()
    line.rig, before, total = rig, ledger.sent, 120
    for number in range(total):
        KEPT[name].act(rig)
        assert not rig.bus.turns.trust.of(1).tainted, "nobody need doubt a servo that has answered"
        rig.bus.turns.made_good()
        assert ledger.sent - before == number + 1, "an answer was lost, or counted twice"
        assert ledger.sent == ledger.ok + sum(ledger.errors.values())
    assert line.looks >= 30
    assert len(landings.ids) >= total // 2
    assert (tried_again(rig.bus), rig.missing) == (0, 0)
