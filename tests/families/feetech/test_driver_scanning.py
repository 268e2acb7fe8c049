"""Scanning: two passes, early news, identities at the end, and the rate of the bus as it was before."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.core.family import Found
from motorbus.core.request import Priority, TimeoutClass
from motorbus.core.steps import Progress
from motorbus.errors import ChecksumError, LinkError, LinkLost, RequestError
from motorbus.families.feetech.driver import ScanWarning, Skipped, scan
from motorbus.families.feetech.driver.scanning import DRAIN
from tests.families.feetech.driver_script import PING, Line, Played, packet, play, reads, unheard, watch


def asks(id: int) -> Line:
    return Line(packet(id, PING), None)


def answers(id: int) -> Line:
    return Line(packet(id, PING), packet(id, 0))


def tells(id: int) -> Line:
    return reads(id, 0, 3, 10, 0, 9, 3)


LOOKS = (*[reads(1, 56, *range(15))] * 2, *[reads(1, 0, *range(40))] * 2)
"""Whether it is alone: the feedback and the EEPROM, each once plain and once with the line kept open."""


def test_the_silent_are_asked_once_more_and_the_found_are_identified() -> None:
    found = play(scan([1, 2, 3]), answers(1), asks(2), asks(3), asks(2), answers(3), tells(1), tells(3))
    assert [(one.node, one.rate, one.identity and one.identity.model) for one in found] == [
        (1, 1_000_000, "STS3215"),
        (3, 1_000_000, "STS3215"),
    ]


def test_news_come_early_and_progress_counts_up_to_the_end() -> None:
    played = watch(scan([1, 2]), asks(1), answers(2), asks(1), tells(2))
    assert [event for event in played.events if isinstance(event, Found)] == [Found(2, 1_000_000, None)]
    progress = [event for event in played.events if isinstance(event, Progress)]
    assert [(event.done, event.total) for event in progress] == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert played.events.index(Found(2, 1_000_000, None)) == 1


def test_every_id_is_asked_when_none_is_named() -> None:
    played = watch(scan(), *[asks(id) for id in (*range(254), *range(254))])
    assert len(played.sent) == 508
    assert (played.alone, played.rates) == (0, [])


def test_a_scan_writes_nothing_and_yields_to_everything() -> None:
    played = watch(scan([1]), answers(1), tells(1))
    assert {request.effect.name for request in played.requests} == {"NONE"}
    assert (played.requests[0].reply_within, played.requests[0].priority) == (
        TimeoutClass.SCAN,
        Priority.CONFIGURATION,
    )


def test_noise_is_no_answer() -> None:
    """It is asked again, and at length; nothing comes, so nobody is there."""
    damaged = Line(packet(1, PING), ChecksumError("c"))
    silence = [unheard(line) for looked in (*LOOKS, *LOOKS) for line in (looked, reads(1, 5, 1))]
    assert play(scan([1]), damaged, asks(1), unheard(tells(1)), *silence) == []


def test_answers_that_stay_garbled_are_two_servos_with_one_id() -> None:
    damaged = Line(packet(1, PING), ChecksumError("c"))
    garbled = [
        Line(line.sent, ChecksumError("c"))
        for looked in (*LOOKS, *LOOKS)
        for line in (looked, reads(1, 5, 1))
    ]
    played = Played([damaged, damaged, Line(tells(1).sent, ChecksumError("c")), *garbled])
    assert played.run(scan([1])) == [Found(1, 1_000_000, None)]
    (seen,) = [event for event in played.events if isinstance(event, ScanWarning)]
    assert (seen.node, seen.rate, seen.garbled, seen.suspected) == (1, 1_000_000, 8, True)


def test_whoever_is_found_may_be_asked_whether_it_is_alone() -> None:
    """Two that answer in the same moment say the same to a PING, and to a longer question they do not."""
    with motorbus.simulate("feetech", ids=(1, 1, 2)) as simulation:
        simulation.simulator.servos[1].raw_position = 700  # type: ignore[attr-defined]
        events: list[object] = []
        with motorbus.open(simulation.url) as bus:
            found = bus.run(bus.driver.scan((1, 2, 3)), report=events.append)
    assert [(one.node, one.identity is not None) for one in found] == [(1, True), (2, True)]
    assert [event.node for event in events if isinstance(event, ScanWarning)] == [1]


def test_a_rate_that_the_link_lacks_is_skipped_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("feetech", ids="1") as simulation, motorbus.open(simulation.url) as bus:
        tune = bus.link.tune

        def unable(rate: int, listen_only: bool = False) -> None:
            if rate == 76_800:
                raise LinkError("this adapter has no 76800 bit/s")
            tune(rate, listen_only)

        monkeypatch.setattr(bus.link, "tune", unable)
        events: list[object] = []
        found = bus.run(scan([1], [76_800, 1_000_000]), report=events.append)
        assert [one.rate for one in found] == [1_000_000]
        assert Skipped(76_800, "this adapter has no 76800 bit/s") in events


def test_every_id_at_every_rate() -> None:
    """The twelve codes, and the first one that answers is told before the last one is asked."""
    with motorbus.simulate("feetech", ids="0+253") as simulation, motorbus.open(simulation.url) as bus:
        simulation[253].memory["baud_rate"] = 7
        events: list[object] = []
        found = bus.run(bus.driver.scan((), bus.family.link.rates), report=events.append)
    assert [(one.node, one.rate) for one in found] == [(0, 1_000_000), (253, 38_400)]
    early = events.index(Found(0, 1_000_000, None))
    assert early < 5 < len(events) / 100
    (total,) = {event.total for event in events if isinstance(event, Progress)}
    assert total == 254 * 2 * 12


def test_what_was_buffered_is_let_pass_at_each_rate() -> None:
    played = watch(scan([1], [500_000, 115_200]), asks(1), asks(1), asks(1), asks(1))
    assert played.now >= 100 + 2 * DRAIN


def test_who_answers_and_does_not_tell_what_it_is_is_found_all_the_same() -> None:
    assert play(scan([1]), answers(1), unheard(tells(1))) == [Found(1, 1_000_000, None)]


def test_several_rates_are_tried_alone_and_the_rate_is_set_back() -> None:
    played = Played([asks(1), asks(1), answers(1), tells(1)], rate=250_000)
    found = played.run(scan([1], [500_000, 115_200]))
    assert [(one.node, one.rate) for one in found] == [(1, 115_200)]
    assert (played.rates, played.alone) == ([500_000, 115_200, 250_000], 1)


@pytest.mark.parametrize("step", range(4))
def test_an_interruption_sets_the_rate_back(step: int) -> None:
    played = Played([asks(1), asks(1), answers(1), tells(1)], interrupt_at=step, rate=250_000)
    with pytest.raises(KeyboardInterrupt):
        played.run(scan([1], [500_000, 115_200]))
    assert played.rates[-1] == 250_000


def test_a_lost_link_ends_the_scan() -> None:
    with pytest.raises(LinkLost):
        play(scan([1, 2]), Line(packet(1, PING), LinkLost("gone")))


def test_everyone_is_no_id_to_scan() -> None:
    with pytest.raises(RequestError):
        play(scan([254]))
