"""Row L12 in virtual time: an adapter is pulled at any byte of any transaction, and comes back.

Whoever waits is told at once. Nothing of what was asked for before is sent when it is there again, and the first answer
then is right.
"""

from __future__ import annotations

import gc
import os
import threading
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest

from motorbus.core.operation import CanFrame, Data, Effect, Exchange, Operation, Pause
from motorbus.errors import LinkLost, MotorbusError
from motorbus.link.base import Delivery, Side
from tests.conftest import Figures
from tests.faults.scenes import KINDS, Kind, Scene, Wire

SOON = 0.25
"""s in which a loss is told to whoever waits."""
AWAY = 0.7
"""s for which the adapter is away."""


class Traffic(Wire):
    """A perfect line that knows when each byte, or frame, was on it."""

    def __init__(self, byte_time: float) -> None:
        super().__init__()
        self.moments: list[float] = []
        self._byte_time = byte_time

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if isinstance(data, CanFrame):
            self.moments += [at - self._byte_time, at + self._byte_time]
        else:
            self.moments += [at - (len(data) - spot - 0.5) * self._byte_time for spot in range(len(data) + 1)]
        return super().carry(sender, data, at)


def scene(kind: Kind) -> tuple[Scene, Traffic]:
    """A bus on which bytes take their time, and what passes on it."""
    there = Scene(kind.family, pace=True)
    there.wire = there.link.line = traffic = Traffic(10 / there.link.rate)
    kind.prepare(there)
    traffic.moments.clear()
    return there, traffic


def moments(kind: Kind) -> list[float]:
    """When a byte of this transaction is on the wire, or has just been; s since it began."""
    there, traffic = scene(kind)
    begun = there.link.now()
    there.bus.run(kind.act(there))
    return sorted({round(at - begun, 7) for at in traffic.moments})


def spread(found: list[float], most: int) -> list[float]:
    """So many of them, the first ones all."""
    head, tail = found[: most // 2], found[most // 2 :]
    step = max(1, len(tail) * 2 // most)
    return head + tail[::step]


def waited(seconds: float) -> Operation[None]:
    yield from Pause(seconds)


def moved_by(bus: Any) -> list[Exchange[Any]]:
    """From now on, the orders that leave on this bus."""
    orders: list[Exchange[Any]] = []
    admit = bus.turns.admit

    def admitted(exchange: Exchange[Any]) -> None:
        admit(exchange)
        orders.append(exchange)

    bus.turns.admit = admitted
    return orders


class Pulled(NamedTuple):
    """An adapter that was pulled: how much later (s) whoever waited was told, 0 when nobody did, how much later than
    its return it was opened anew, and how many orders were given again then."""

    told: float
    reopened: float
    replayed: int


def pulled(kind: Kind, after: float) -> Pulled | None:
    """Pull the adapter so long (s) after the transaction began; None when that was behind its end."""
    there, traffic = scene(kind)
    gone = there.link.now() + after
    there.link.unplug(gone, AWAY)
    anew: list[float] = []
    there.bus.turns.anew = (*there.bus.turns.anew, lambda: anew.append(there.link.now()))
    failed = failure(lambda: there.bus.run(kind.act(there)))
    if failed is None and there.bus.turns.gone is None and there.link.now() < gone:
        return None
    told = there.link.now() - gone if failed is not None else 0.0
    assert told <= SOON, f"told {told} s after it"
    assert failed is None or told_of_it(failed), repr(failed)
    orders, sent = moved_by(there.bus), len(traffic.sent)
    with pytest.raises(LinkLost):  # it is away still
        there.bus.run(there.asked())
    assert len(traffic.sent) == sent
    there.bus.run(waited(AWAY + 0.5))
    assert len(traffic.sent) == sent, "something was sent when it was there again"
    assert there.bus.turns.gone is None, "it was not opened anew while somebody waited"
    there.stir()
    assert there.true(there.bus.run(there.asked()))
    replayed = [one for one in orders if one.effect in (Effect.MOTION, Effect.TORQUE)]
    assert replayed == []
    return Pulled(told, round(anew[0] - gone - AWAY, 9), len(replayed))


def failure(act: Callable[[], object]) -> MotorbusError | None:
    """What it raises."""
    try:
        act()
    except MotorbusError as error:
        return error
    return None


def told_of_it(error: BaseException | None) -> bool:
    """Whether it says that the port is gone, or that nobody knows what came of it for that reason."""
    while error is not None:
        if isinstance(error, LinkLost):
            return True
        error = error.__cause__ or error.__context__
    return False


@pytest.mark.parametrize("name", KINDS)
def test_l12_an_adapter_that_is_pulled_at_any_byte(
    name: str, rounds: Callable[[int], int], figures: Figures
) -> None:
    kind = KINDS[name]
    every = moments(kind)
    chosen = spread(every, 12) if rounds(20_000) < 20_000 else spread(every, 4_000)
    assert chosen, "something was on the wire"
    fired = [one for after in chosen if (one := pulled(kind, after)) is not None]
    assert len(fired) >= len(chosen) - 2, "as good as every one was before the end"
    figures(
        f"L12 pulled at any byte, {name}",
        family=kind.family,
        pulled=len(fired),
        replayed=sum(one.replayed for one in fired),
        longest_told_s=max(one.told for one in fired),
        longest_reopened_s=max(one.reopened for one in fired),
    )


@pytest.mark.parametrize("name", ["feetech read", "kst read", "stepper read"])
def test_l12_an_adapter_that_is_pulled_at_every_byte_of_a_read(name: str) -> None:
    every = moments(KINDS[name])
    assert len(every) >= 4
    assert sum(pulled(KINDS[name], after) is not None for after in every) >= len(every) - 2


def counts() -> tuple[int, int]:
    """Descriptors and threads of this process."""
    gc.collect()
    return len(os.listdir("/proc/self/fd")), threading.active_count()


def cycles(count: int) -> Iterator[int]:
    """Pull the adapter so often; gives the number of right answers after it."""
    there = Scene("feetech")
    for _ in range(count):
        there.link.unplug(there.link.now() + 1e-5, 0.01)
        with pytest.raises(LinkLost):
            there.bus.run(waited(1.0))
        there.bus.run(waited(0.05))
        there.stir()
        yield there.true(there.bus.run(there.asked()))
    assert there.bus.turns.losses == count


def test_l12_ten_thousand_times_leave_nothing_behind(rounds: Callable[[int], int], figures: Figures) -> None:
    count = 10_000 if rounds(20_000) == 20_000 else 200
    before = counts()
    right = sum(cycles(count))
    assert right == count
    leaked = sum(counts()) - sum(before)
    assert counts() == before
    figures("L12 pulled and put back, in memory", family="feetech", cycles=count, right=right, leaked=leaked)
