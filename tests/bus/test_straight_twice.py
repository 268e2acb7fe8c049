"""Ctrl-C once more while the first one is being dealt with, on the straight way: the bus is let go all the same."""

from __future__ import annotations

import functools

import pytest

from motorbus.bus.pump import Bus
from motorbus.bus.straight import usual
from tests.bus.responder import position
from tests.bus.struck import order
from tests.bus.test_straight_ends import CALLS as STRAIGHT
from tests.bus.test_straight_ends import flown, heard_of_all, in_another_thread, unanswered
from tests.conftest import Figures, Rounds
from tests.faults.cutting import NEVER, Outcome, Twice, cut, places

CALLS = {
    **STRAIGHT,
    "usual": ((1,), lambda bus, exchange: usual(bus, exchange)),
    "burst": ((1, 2), lambda bus, exchange: bus.volley(order(), order(), exchange)),
}
LOOSE = ("loosed", "behind", "later")
"""Of these something may be in the air on purpose: whoever let it loose may still land it."""
SOON = 1.0
"""s in which the lock is free."""
LATER = 60
"""Lines after the first one at which the second may fall: by then the first one has been dealt with."""


def is_free(bus: Bus) -> bool:
    """Whether the lock can be had soon."""
    free = bus.turns.lock.acquire(timeout=SOON)
    if free:
        bus.turns.lock.release()
    return free


def cut_twice(what: str, fault: str, at: int, later: int) -> tuple[Outcome, int, list[str]]:
    """What came of it, how many answers the line has struck, and what is wrong afterwards."""
    nodes, call = CALLS[what]
    bus, simulator, line, exchange = flown(nodes)
    line.fault = fault
    line.sent.clear()
    came = cut(lambda: call(bus, exchange), at, KeyboardInterrupt, later, Twice)
    wrong = [] if isinstance(came.error, KeyboardInterrupt) else [f"it ended with {came.error!r}"]
    if bus.relay.pumper is not None:
        return came, line.struck, [*wrong, "nobody else may pump any more"]
    if not in_another_thread(lambda: is_free(bus)):
        return came, line.struck, [*wrong, "the lock is held"]
    flying = [one for one in bus.turns.flying.values() if not (one.abandoned or one.done or one.parent)]
    if any(bus.turns._queues) or (flying and what not in LOOSE):
        wrong.append("what nobody waits for may still leave")
    wrong += [f"{node} is believed" for node in unanswered(bus) if not bus.turns.trust.nodes[node].tainted]
    line.fault = line.fault if line.sent else ""
    due = bool(fault) and bool(line.sent)  # an answer meets the fault, here or in what is asked now
    for node in nodes:
        simulator.memory[node][57] = 99
    value = in_another_thread(lambda: bus.run(exchange))
    value = value if not value[1] else heard_of_all(bus, exchange)
    if value != ([(node, 0, node, 99) for node in nodes], ()):
        wrong.append(f"a wrong value: {value}")
    if bus.run(position(6)) != 6:
        wrong.append("another one is not read")
    if line.struck != due:
        wrong.append(f"the line struck {line.struck} answers, and {int(due)} was due")
    return came, line.struck, wrong


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("fault", ["", "late", "split"])
@pytest.mark.parametrize("what", CALLS)
def test_l17_a_second_interrupt_while_the_first_is_dealt_with_on_the_straight_way(
    what: str, fault: str, rounds: Rounds, figures: Figures
) -> None:
    nodes, call = CALLS[what]
    for _ in range(2):  # the first call in a process takes more lines: it fills what is kept for all buses
        bus, _, line, exchange = flown(nodes)
        line.fault = fault
        whole = cut(functools.partial(call, bus, exchange))
        assert whole.error is None
    cuts, twice, struck, wrong = 0, 0, 0, list[str]()
    most = rounds(NEVER, 12)
    for number, at in enumerate(places(whole.walked, 1, most)):
        some = sorted((1 + number * 7 % 23, 1 + number * 13 % LATER))
        for later in range(1, LATER) if most == NEVER else some:
            came, met, found = cut_twice(what, fault, at, later)
            assert came.where is not None
            cuts += 1
            twice += came.again is not None
            struck += met
            wrong += [f"{one}, cut at {came.where} and at {came.again}" for one in found]
            if came.again is None:  # by then all is over
                break
    figures(
        f"L17 interrupted twice: {what}, {fault or 'no fault'}, the straight way",
        family="feetech", cuts=cuts, twice=twice, struck=struck, wrong=len(wrong),
    )  # fmt: skip
    assert wrong == []
    assert twice >= cuts / 3 > 0  # the others were over by then
    assert (struck > 0) is bool(fault)


@pytest.mark.parametrize("what", ["usual", "burst"])
def test_l17_a_second_interrupt_at_each_line_of_what_deals_with_the_first_in_the_usual_way(what: str) -> None:
    """There it must also not leave any more: nobody waits for it."""
    nodes, call = CALLS[what]
    bus, _, _, exchange = flown(nodes)
    whole = cut(lambda: call(bus, exchange))
    twice, wrong = 0, list[str]()
    for at in places(whole.walked, 1, 24):
        for later in range(1, LATER):
            came, _, found = cut_twice(what, "", at, later)
            wrong += [f"{one}, cut at {came.where} and at {came.again}" for one in found]
            if came.again is None:  # by then all is over
                break
            twice += 1
    assert wrong == []
    assert twice > 500
