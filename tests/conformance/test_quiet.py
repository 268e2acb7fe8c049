"""Looking changes nothing: opening, scanning, identifying and reading write no motion, no torque and no EEPROM."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Any

import pytest

from motorbus.core.family import Family, Found
from motorbus.core.request import Effect, Request
from motorbus.core.steps import Progress, Runnable
from motorbus.errors import NoReply
from tests.support.subjects import possible
from tests.support.world import IDS, Cut, Steps, World, has, said, sent, world

NODE = IDS[0]
LOOKS = ("ping", "identify", "read", "telemetry", "position")


def looks(there: World) -> dict[str, Runnable[Any]]:
    """Everything that only looks, not yet begun."""
    device = there.device(NODE)
    found: dict[str, Runnable[Any]] = {verb: said(device, verb) for verb in LOOKS if has(there.family, verb)}
    found |= {"scan": there.family.open().scan(there.ids), "scan of all": there.family.open().scan()}
    found |= {
        "identify by family": there.family.open().identify(NODE),
        "probe": there.family.open().probe(NODE, 0),
    }
    test = there.family.open().echo_test()
    return found | ({"echo test": test} if test is not None else {})


def test_looking_has_no_effect_and_is_marked_repeatable(subject: Family) -> None:
    with world(subject) as there:
        before = there.settings()
        for name, operation in looks(there).items():
            steps = Steps(there.bus)
            steps.run(operation)
            assert {request.effect for request in steps.requests} == {Effect.NONE}, name
            assert [one for one in steps.requests if not one.repeatable and not is_group(one)] == [], name
            assert [request.setpoints for request in steps.requests if request.setpoints] == []
        assert there.settings() == before


def is_group(request: Request[Any]) -> bool:
    return not isinstance(request.expected, tuple) or len(request.expected) != 1


def test_identify_says_what_is_there(subject: Family) -> None:
    with world(subject) as there:
        for node in there.ids:
            identity = there.bus.run(subject.open().identify(node))
            assert identity.node == node
            assert identity.model
            assert identity.firmware
            assert identity.table in subject.registers
            assert there.device(node).identify() == identity


def test_ping_says_who_is_there(subject: Family) -> None:
    with world(subject) as there:
        for gone in there.ids:
            there.simulator.nodes[gone].unplug()
            assert [there.device(node).ping() for node in there.ids] == [node != gone for node in there.ids]
            with pytest.raises(NoReply) as raised:
                there.bus.run(subject.open().identify(gone))
            assert raised.value.node == gone
            there.simulator.nodes[gone].plug()
            assert there.device(gone).ping() is True


@pytest.mark.parametrize("ids", [IDS, (2, 5, 9), (7,)], ids=str)
@pytest.mark.parametrize("asked", [(), tuple(range(1, 12))], ids=["all", "some"])
def test_a_scan_finds_exactly_who_is_there(
    subject: Family, ids: tuple[int, ...], asked: tuple[int, ...]
) -> None:
    with world(subject, ids=possible(subject, ids)) as there:
        found = there.bus.run(subject.open().scan(possible(subject, asked)))
        assert sorted(one.node for one in found) == list(there.ids)
        assert {one.rate for one in found} == {subject.link.rate}
        for one in found:
            assert one.identity == there.bus.run(subject.open().identify(one.node))
            there.simulator.nodes[one.node].unplug()
        assert there.bus.run(subject.open().scan(possible(subject, asked))) == []


def test_a_scan_tells_early(shared: Family) -> None:
    """The first that is found is reported while others have still to be asked; what is found last, before the end."""
    with world(shared, ids=(1, 2, 19)) as there, sent(there.bus) as frames:
        when: list[tuple[Found, int]] = []
        watch = there.bus.trace.subscribe(limit=1_000_000)
        left = 0

        def report(event: object) -> None:
            nonlocal left
            left += sum(record.direction == "tx" for record in watch)
            there.events.append(event)
            if isinstance(event, Found):
                when.append((event, left))

        found = there.bus.run(shared.open().scan(tuple(range(1, 20))), report)
    assert {(one.node, one.rate) for one, _ in when} == {(one.node, one.rate) for one in found}
    assert when[0][1] < when[-1][1] < len(frames)
    progress = [event for event in there.events if isinstance(event, Progress)]
    assert progress
    assert all(0 <= event.done <= event.total for event in progress)


def test_a_scan_finds_at_each_rate_who_is_there(subject: Family) -> None:
    with world(subject) as there:
        rates = subject.link.rates
        found = there.bus.run(subject.open().scan(there.ids, rates))
        assert {(one.node, one.rate) for one in found} == {(node, subject.link.rate) for node in there.ids}
        assert there.device(NODE).ping() is True


def test_a_scan_leaves_the_rate_as_it_was(subject: Family) -> None:
    usual, other = subject.link.rate, subject.link.rates[-1]
    with world(subject, rate=other) as there:
        found = there.bus.run(subject.open().scan(there.ids, (usual,)))
        assert {(one.node, one.rate) for one in found} == {(node, usual) for node in there.ids}
        assert (there.bus.rate, there.link.rate) == (other, other)
        assert bool(there.bus.run(subject.open().scan(there.ids))) == (usual == other)


@pytest.mark.parametrize("before", [True, False], ids=["before", "after"])
def test_a_scan_that_is_cut_leaves_the_rate_as_it_was(subject: Family, before: bool) -> None:
    usual = subject.link.rate
    rates = tuple(dict.fromkeys((*subject.link.rates[:2], usual)))
    number = cuts = 0
    while number == 0 or cuts:
        with world(subject) as there:
            steps = Steps(there.bus, cut_at=number, before=before)
            with suppress(Cut):
                steps.run(subject.open().scan(there.ids, rates))
            assert (there.bus.rate, there.link.rate) == (usual, usual)
            number, cuts = number + 5, steps.cuts


def test_what_a_simulated_node_says_of_itself_is_plain_data(subject: Family) -> None:
    with world(subject) as there:
        for node in there.ids:
            status = there.simulator.nodes[node].status()
            assert json.loads(json.dumps(status)) == status
