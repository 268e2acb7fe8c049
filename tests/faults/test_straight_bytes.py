"""Rows L1 to L4, L10 and L11 on the straight way: single and double faults, answers in pieces and with noise between.

The same faults as in `test_single_faults`, `test_double_faults` and `test_splits`, toward the host. Each strikes the
answer to a flight that went straight, and that is counted.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations, pairwise
from random import Random

import pytest

from motorbus.core.operation import Data
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.simulation.faults import Fault, FaultyLine
from tests.bus.struck import Landings, packets
from tests.conftest import Figures, Rounds
from tests.faults.chance import poisson_line, share_of_pairs
from tests.faults.single import EDGES, EVERY, Tally, every_fault, number_of, suffer, tried_again
from tests.faults.straight import GROUP, KEPT, WORD, StraightRig, poised
from tests.faults.test_double_faults import LONG, SHORT, Pairs
from tests.faults.test_splits import Cut

AT_MOST = 1.0
"""s that any of them may take: three tries, their quiet times and probes."""


def suffered(
    name: str, values: Iterable[int], landings: Landings, actions: tuple[str, ...] = (), apart: int = 1
) -> Tally:
    """Every such fault of every `apart`-th byte, each on an answer to a straight flight."""
    kind, rig = KEPT[name], StraightRig()
    found = every_fault(kind.back, values, places=range(0, kind.back + 1, apart))
    faults = [fault for fault in found if not actions or fault.action in actions]

    def line_of(fault: Fault) -> FaultyLine:
        landed = len(landings.ids)
        poised(rig, kind)
        assert len(landings.ids) > landed, "what is asked on a sound line does not go straight"
        return FaultyLine([fault])

    tally = suffer(rig, kind.act, faults, line_of=line_of, at_most=AT_MOST)
    assert rig.struck == tally.faults == len(faults) > 0, "not each of them struck a straight flight"
    assert tally.succeeded == tally.faults, "what may be said again gets over any single fault"
    return tally


@pytest.mark.parametrize("name", KEPT)
def test_l1_a_changed_byte_of_an_answer_on_the_straight_way_is_no_value(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = 1 if KEPT[name].back <= 24 else 4
    suffered(name, EDGES, Landings(monkeypatch), ("corrupt",), places)


@pytest.mark.parametrize("name", KEPT)
def test_l2_a_byte_lost_or_too_many_on_the_straight_way_gives_no_value(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = 1 if KEPT[name].back <= 24 else 8
    few = EDGES if KEPT[name].back <= 8 else (0x00, 0x01, 0xFF)
    suffered(name, few, Landings(monkeypatch), ("drop", "duplicate", "insert", "delay"), places)


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", KEPT)
def test_l1_l2_every_fault_of_every_exchange_that_goes_straight(
    name: str, monkeypatch: pytest.MonkeyPatch, figures: Figures
) -> None:
    landings = Landings(monkeypatch)
    tally = suffered(name, EVERY, landings)
    assert tally.faults == number_of(KEPT[name].back)
    figures(
        f"L1 L2 single byte faults on the straight way, {name}, toward the host",
        family="feetech", promise=1, straight=len(landings.ids), **tally.told,
    )  # fmt: skip


class PairsInTrains(Pairs):
    """Of a train it strikes one packet, by lot."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if self.due and sender is Side.DEVICE:
            self.due = False
            train = packets(bytes(data))  # type: ignore[arg-type]  # never a frame
            place = self.random.randrange(len(train))
            train[place] = self._struck(train[place])
            data = b"".join(train)
        return PerfectLine.carry(self, sender, data, at)


@pytest.mark.timeout(7200)
@pytest.mark.parametrize("bits", [False, True], ids=["bytes", "bits"])
@pytest.mark.parametrize("name", ["position()", "sync_read_positions", "volley"])
def test_l3_l4_double_faults_on_the_straight_way_pass_as_often_as_arithmetic_says(
    name: str, bits: bool, rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each first answer is struck on the straight way, and the one behind it is right."""
    line, landings, seed = PairsInTrains(24, bits=bits), Landings(monkeypatch), 24
    rig, kind = StraightRig(line), KEPT[name]
    total, wrong = rounds(300_000, 300), 0
    for _ in range(total):
        line.due = True
        try:
            kind.act(rig)
        except AssertionError:
            wrong += 1
            rig.link.advance(0.05)
        assert not line.due, "it did not happen"
        kind.act(rig)
        kind.act(rig)
    expected = (
        line.expected if bits else sum(share_of_pairs(n, WORD) * line.lengths[n] for n in (SHORT, LONG))
    )
    figures(
        f"L3 L4 two {'turned bits' if bits else 'changed bytes'} in one reply on the straight way, {name}, unconfirmed",
        family="feetech", seed=seed, pairs=line.fired, straight=len(landings.ids), struck_in_the_air=rig.struck,
        expected=round(expected, 2), wrong=wrong, line=poisson_line(expected),
    )  # fmt: skip
    assert rig.struck > 0.9 * total
    assert line.fired == total
    assert expected - 4 * expected**0.5 <= wrong <= poisson_line(expected)
    assert len(landings.ids) > total


@pytest.mark.parametrize("apart", [0.0, 1e-5, 1e-3])
def test_l10_every_way_to_cut_the_answer_of_a_kept_reading_gives_its_value(
    apart: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    line, landings = Cut(), Landings(monkeypatch)
    rig, kind = StraightRig(line), KEPT["position()"]
    line.apart, number = apart, 0
    for count in range(9):
        for cuts in combinations(range(1, 9), count):
            line.pieces = ()
            kind.act(rig)  # in one piece
            line.pieces = cuts
            kind.act(rig)
            number += 1
    assert number == 2**8
    assert rig.struck > 100
    assert len(landings.ids) >= number
    assert tried_again(rig.bus) == 0


class Pieces(PerfectLine):
    """Cuts the next train at places by lot, with or without a pause; `noise`: bytes of nobody between its packets."""

    def __init__(self, seed: int, noise: bool = False) -> None:
        self.random = Random(seed)
        self.noise = noise
        self.due = False

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if not self.due or sender is Side.HOST or not isinstance(data, bytes):
            return super().carry(sender, data, at)
        self.due = False
        if self.noise:
            between = (b"\xff", b"\xff\xff", b"\x00", b"\x55\xaa")
            made = b"".join(self.random.choice(between) + packet for packet in packets(data))
            return [Delivery(at, Side.HOST, made)]
        cuts = sorted(self.random.sample(range(1, len(data)), self.random.randint(1, 5)))
        ends, moment, found = [0, *cuts, len(data)], at, []
        for begin, end in pairwise(ends):
            found.append(Delivery(moment, Side.HOST, data[begin:end]))
            moment += self.random.choice((0.0, 1e-5, 2e-4))
        return found


@pytest.mark.parametrize("noise", [False, True], ids=["L10 in pieces", "L11 noise between"])
@pytest.mark.parametrize("name", KEPT)
def test_l10_l11_answers_in_pieces_and_with_noise_between_give_their_values(
    name: str, noise: bool, rounds: Rounds, monkeypatch: pytest.MonkeyPatch
) -> None:
    line, landings = Pieces(10, noise), Landings(monkeypatch)
    rig, kind = StraightRig(line), KEPT[name]
    total = rounds(100_000, 150)
    for _ in range(total):
        kind.act(rig)
        line.due = True
        kind.act(rig)
        assert not line.due, "it did not happen"
        kind.act(rig)
    assert rig.struck > 0.9 * total
    assert len(landings.ids) > total
    assert {len(ids) for ids in landings.ids} <= {1, len(GROUP)}
    assert noise or (rig.missing, tried_again(rig.bus)) == (0, 0), "noise behind a reply makes it doubtful"
