"""Rows L6 to L11: late, noisy, echoing, babbling and broken-up lines, in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import pytest

from motorbus.core.operation import Data
from motorbus.errors import MotorbusError
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.conftest import Rounds
from tests.support.noisy_line import NoisyLine
from tests.support.rigs.feetech import KINDS, Rig, read_word, sync_read


def try_(exchange: Callable[[Rig], None], rig: Rig) -> bool:
    """False when it failed honestly; a wrong value is an AssertionError."""
    try:
        exchange(rig)
    except MotorbusError:
        return False
    return True


@pytest.mark.timeout(600)
def test_l7_replies_that_are_overtaken_within_the_quiet_time_are_not_stale_either(
    rounds: Rounds,
) -> None:
    total = rounds(100_000)
    rig = Rig(NoisyLine(8, late=0.01, late_by=(0.001, 0.04), overtake=True))
    assert isinstance(rig.line, NoisyLine)
    good = sum(try_(read_word, rig) for _ in range(total))
    assert rig.line.count("late") > total / 200
    assert good > 0.99 * total


def test_l7_replies_overtaken_by_more_than_that_are_the_known_limit(rounds: Rounds) -> None:
    """Nothing in a FEETECH reply tells it from an older one of its kind: see docs/explanation/taint.md.

    The probe is a barrier only where nothing is overtaken. This measures what is left where that does not hold.
    """
    total = rounds(100_000)
    rig = Rig(NoisyLine(7, late=0.01, late_by=(0.05, 0.5), overtake=True))
    assert isinstance(rig.line, NoisyLine)
    stale = good = 0
    for _ in range(total):
        try:
            good += try_(read_word, rig)
        except AssertionError:
            stale += 1
    late = rig.line.count("late")
    print(f"\n{total} reads, {late} replies overtaken after more than the quiet time: {stale} stale values")
    assert 0 < stale <= late, "each such reply can be believed once, and never shifts the ones behind it"


class Doubled:
    """Every so often a reply comes twice, the copy a while behind; and every servo takes its time to answer."""

    def __init__(self, seed: int, delay: float) -> None:
        self.random = Random(seed)
        self.delay = delay
        self.fired = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            return [Delivery(at, Side.DEVICE, data)]
        out = [Delivery(at + self.delay, Side.HOST, data)]
        if self.random.random() < 0.02:
            self.fired += 1
            behind = self.random.uniform(0.00001, 0.9) * self.delay
            out.append(Delivery(at + self.delay + behind, Side.HOST, data))
        return out


def test_a_reply_that_comes_twice_is_believed_once(rounds: Rounds) -> None:
    """The copy reaches a host that already waits for the next answer, which looks just like it but for its length."""
    total = rounds(100_000)
    line = Doubled(5, 0.001)
    rig = Rig(line)
    good = sum(try_(read_word, rig) for _ in range(total))
    assert line.fired > total / 100
    print(
        f"\n{total} reads, {line.fired} replies with a copy behind, 0 stale values, {good / total:.3%} succeeded"
    )
    assert good == total


class Belated(PerfectLine):
    """Hands each answer over so long (s) after its question has left."""

    def __init__(self, after: float) -> None:
        self.after = after
        self.asked = 0.0
        self.fired = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.asked = at
            return super().carry(sender, data, at)
        self.fired += 1
        return super().carry(sender, data, self.asked + self.after)


def test_l6_an_answer_at_0_95_of_the_budget_is_no_fault() -> None:
    """Which is 160 µs of wire, 1.508 ms that a servo may take, and 20 ms of margin."""
    line = Belated(0.95 * (0.00016 + 0.001508 + 0.020))
    rig = Rig(line)
    for _ in range(500):
        read_word(rig)
    assert line.fired >= 500
    assert rig.bus.statistics.of(1).retries == 0


@pytest.mark.parametrize(
    "fault", ["late", "loss", "duplicate", "corrupt", "lose_byte", "insert_byte", "double_byte"]
)
@pytest.mark.parametrize("kind", KINDS)
def test_the_second_exchange_after_the_last_fault_is_right_at_its_first_try(fault: str, kind: str) -> None:
    """Whatever the fault did, the exchange after the next one neither fails nor is tried again."""
    exchange, _ = KINDS[kind]
    rig = Rig()
    fired = 0
    for seed in range(60):
        always: dict[str, Any] = {fault: 1.0}
        noisy = NoisyLine(seed, **always)
        rig.put(noisy)
        try_(exchange, rig)
        fired += len(noisy.fired)
        rig.put(PerfectLine())
        rig.link.advance(1.0)  # what is late has come
        try_(exchange, rig)
        before = sum(ledger.retries for ledger in rig.bus.statistics.nodes.values())
        exchange(rig)
        assert sum(ledger.retries for ledger in rig.bus.statistics.nodes.values()) == before
    assert fired >= 60


class Silent:
    """Carries nothing to one node."""

    def __init__(self, node: int) -> None:
        self.node = node
        self.swallowed = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.DEVICE and data[2] == self.node:
            self.swallowed += 1
            return []
        return PerfectLine().carry(sender, data, at)


def test_a_dead_servo_does_not_slow_the_others_down() -> None:
    rig = Rig()
    line = Silent(2)
    rig.put(line)
    sync_read(rig)
    sync_read(rig)
    before = rig.link.now()
    for _ in range(100):
        sync_read(rig)
    assert line.swallowed >= 100
    assert rig.link.now() - before < 100 * 0.005
