"""What `FAMILY` itself promises: names, figures of the wire, probes, a stop, and which way its rooms import."""

from __future__ import annotations

import asyncio
import inspect
import sys
from functools import cache
from typing import Any

import grimp
import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.family import BusDriver, Family
from motorbus.core.request import ANY, Data, Effect, Expected, Priority, Request, Response, TimeoutClass
from motorbus.core.steps import gather
from motorbus.errors import MotorbusError, RequestError
from tests.support.subjects import FAMILIES, PACKAGES, line_of, possible
from tests.support.world import IDS, World, sent, world

ROOMS = ("driver", "simulator")
# A family has no clock, no threads and no I/O; and nothing foreign, for it is loaded below floor 3.
FORBIDDEN = {
    "_thread",
    "asyncio",
    "concurrent",
    "datetime",
    "multiprocessing",
    "os",
    "pathlib",
    "sched",
}
FORBIDDEN |= {"select", "selectors", "signal", "socket", "ssl", "subprocess", "tempfile", "threading", "time"}


def public(thing: object) -> set[str]:
    return {name for name in dir(thing) if not name.startswith("_")}


def test_a_driver_has_the_members_of_the_contract(family: Family) -> None:
    driver = family.open()
    members = public(BusDriver) | set(BusDriver.__annotations__)
    assert {name for name in members if not hasattr(driver, name)} == set()
    assert driver.family is family


def test_a_family_is_called_what_it_is_found_by(family: Family) -> None:
    assert FAMILIES[family.name] is family


def test_a_family_keeps_no_state(family: Family) -> None:
    for name in public(family):
        getattr(family, name)  # what is worked out when first asked for is no state
    before = repr(vars(family))
    with world(family) as there:
        there.device(IDS[0]).identify()
        there.bus.run(family.open().scan(there.ids))
        there.bus.estop()
    assert repr(vars(family)) == before


def test_what_a_link_needs_is_said(family: Family) -> None:
    needs = family.link
    assert needs.kind in {"bytes", "frames"}
    assert needs.rate in needs.rates
    assert len(set(needs.rates)) == len(needs.rates)
    assert {option.name for option in family.simulator_options() if not option.help} == set()
    assert {
        option.name for option in family.simulator_options() if not isinstance(option.default, option.kind)
    } == set()


def test_the_only_device_of_a_line_is_the_one_that_there_can_be(family: Family) -> None:
    only = family.link.only
    assert (only is not None) == (line_of(family).devices == 1)
    if only is not None:
        assert family.devices.blocking(None, only).node == only
        with pytest.raises(RequestError):
            family.devices.blocking(None, only + 1)


# --- figures of the wire ------------------------------------------------------------------------------------


def request_of(family: Family, length: int) -> Data:
    return CanFrame(1, bytes(length)) if family.link.kind == "frames" else bytes(length)


def test_air_time_grows_with_length_and_falls_with_rate(family: Family) -> None:
    rate = family.link.rate

    def takes(request: int, *replies: int) -> float:
        dues = tuple(Expected(1, 1, length) for length in replies)
        return family.open().air_time(Request(request_of(family, request), dues), rate)

    assert 0 < takes(1) < takes(4) < takes(8) < takes(8, 1) < takes(8, 4) < takes(8, 8) < takes(8, 8, 1)
    some: Request[Any] = Request(request_of(family, 8), (Expected(1, 1, 8),))
    assert family.open().air_time(some, rate) > family.open().air_time(some, 2 * rate)
    assert family.open().air_time(Request(request_of(family, 8), ANY), rate) > 0


def test_thinking_takes_some_time_and_storing_no_less(family: Family) -> None:
    times = {
        kind: family.open().turnaround(
            Request(request_of(family, 8), (Expected(1, 1, 8),), reply_within=kind)
        )
        for kind in TimeoutClass
    }
    assert 0 < times[TimeoutClass.REPLY] <= times[TimeoutClass.STORE]
    assert times[TimeoutClass.SCAN] > 0


def test_the_quiet_time_is_no_shorter_than_a_reply(family: Family) -> None:
    probe = family.open().probe(IDS[0], 0)
    for rate in family.link.rates:
        assert family.open().quiet_time(rate) > family.open().air_time(probe, rate) / 2


def test_lanes_and_window_agree_and_as_many_fly_as_the_window_allows(subject: Family) -> None:
    assert subject.open().window >= 1
    with world(subject) as there:
        for node in there.ids:
            assert there.device(node).ping() is True
        watched = there.bus.trace.subscribe()
        there.bus.run(probes(subject))
        flying = most = 0
        for record in watched:
            flying += 1 if record.direction == "tx" else -1
            most = max(most, flying)
    assert most == min(subject.open().window, len({lane_of(subject, node) for node in there.ids}))


def lane_of(family: Family, node: int) -> int:
    return family.open().probe(node, 0).lane


async def probes(family: Family) -> list[bool]:
    return list(await gather(*[family.open().probe(node, 0) for node in possible(family, IDS)]))


# --- probes, echo, stop -------------------------------------------------------------------------------------


def test_an_echo_test_is_answered_by_another_length_than_its_own(family: Family) -> None:
    test = family.open().echo_test()
    if test is None:
        assert family.link.kind == "frames"  # only a CAN controller never hears itself
        return
    assert test.effect is Effect.NONE
    assert test.expected is ANY or {due.length for due in test.expected} & {len(test.wire)} == set()


def test_probes_differ_from_each_other_and_from_their_echo(family: Family) -> None:
    seen = set()
    for attempt in range(64):
        probe = family.open().probe(IDS[0], attempt)
        assert probe.expected is not ANY
        (due,) = probe.expected
        assert (due.node, probe.lane) == (IDS[0], lane_of(family, IDS[0]))
        assert (probe.effect, probe.repeatable) == (Effect.NONE, True)
        if isinstance(probe.wire, bytes):
            assert due.length != len(probe.wire)
        seen.add((due.key, due.length))
    assert len(seen) >= line_of(family).probes


def test_probes_are_answered_truthfully(subject: Family) -> None:
    with world(subject) as there:
        for node in there.ids:
            answers = {there.bus.run(subject.open().probe(node, attempt)) for attempt in range(64)}
            assert answers == {True}


def test_a_probe_knows_a_wrong_answer(subject: Family) -> None:
    with world(subject) as there:
        probe = subject.open().probe(IDS[0], 0)
        assert probe.decode is not None
        plain: Request[Response] = Request(probe.wire, probe.expected, lane=probe.lane)
        answer = there.bus.run(plain)
        assert probe.decode(answer) is True
        wrong = [answer.replies[0]._replace(data=damaged) for damaged in one_bit_off(answer.replies[0].data)]
        verdicts = [verdict(probe, answer._replace(replies=(reply,))) for reply in wrong]
        assert False in verdicts


def one_bit_off(data: bytes) -> list[bytes]:
    return [bytes(b ^ (1 << bit if i == place else 0) for i, b in enumerate(data))
            for place in range(len(data)) for bit in range(8)]  # fmt: skip


def verdict(probe: Request[bool], answer: Response) -> bool | None:
    """What the probe makes of an answer; None when it calls it an error, as a refusal."""
    assert probe.decode is not None
    try:
        return probe.decode(answer)
    except MotorbusError:
        return None


@pytest.mark.parametrize("nodes", [(), (1,), IDS])
def test_a_stop_says_what_it_promises(family: Family, nodes: tuple[int, ...]) -> None:
    nodes = possible(family, nodes)
    stop = family.open().stop(dict.fromkeys(nodes))
    assert stop.promise.strip()
    assert {exchange.priority for exchange in stop.requests} <= {Priority.STOP}
    dues = [due.node for one in stop.requests if one.expected is not ANY for due in one.expected]
    assert set(dues) == set(nodes)
    assert {dues.count(node) for node in nodes} <= ({1} if line_of(family).devices != 1 else {1, 2})
    for exchange in stop.requests:
        if exchange.expected is not ANY and exchange.expected:
            assert exchange.lane == lane_of(family, exchange.expected[0].node)


def test_capabilities_belong_to_an_identity(subject: Family) -> None:
    with world(subject) as there:
        identity = there.bus.run(subject.open().identify(IDS[0]))
    capabilities = subject.open().axis(identity)
    assert all(callable(getattr(capabilities, name)) for name in capabilities.names)


def test_both_faces_have_the_same_verbs(family: Family) -> None:
    blocking, awaiting = family.devices
    assert public(blocking) == public(awaiting)
    verbs = {"ping", "identify", "read", "node", "alarm", *(["write"] if line_of(family).writes else [])}
    assert verbs <= public(blocking(World(family).bus, 1))
    assert line_of(family).writes is hasattr(blocking, "write")
    undocumented = [name for name in public(blocking) if not inspect.getdoc(getattr(blocking, name))]
    assert undocumented == []


# --- a device on a bus of another family


@pytest.mark.parametrize("other", list(FAMILIES))
def test_a_device_of_another_family_is_refused(family: Family, other: str) -> None:
    devices = FAMILIES[other].devices

    async def make(bus: object) -> None:
        devices.awaiting(bus, 1)

    with world(family) as there, sent(there.bus) as frames:
        if other == family.name:
            devices.blocking(there.bus, 1)
            asyncio.run(make(there.async_bus()))
            return
        for refused in (lambda: devices.blocking(there.bus, 1), lambda: asyncio.run(make(there.async_bus()))):
            with pytest.raises(
                RequestError, match=rf"bus of {family.name} devices, and this .* {other}(\n|$)"
            ) as caught:
                refused()
            assert "\n" not in caught.value.summary
            assert f"motorbus.{family.name}" in caught.value.advice
    assert frames == []


# --- which way the rooms import -----------------------------------------------------------------------------


@cache
def graph(package: str) -> grimp.ImportGraph:
    tops = {package.split(".")[0], "motorbus"}
    return grimp.build_graph(*tops, include_external_packages=True, cache_dir=None)


def rooms(package: str) -> set[str]:
    return {f"{package}.{room}" for room in ROOMS}


def test_a_family_has_a_driver_and_a_simulator(family: Family) -> None:
    package = PACKAGES[family.name]
    assert rooms(package) <= graph(package).modules


def test_driver_and_simulator_never_reach_each_other(family: Family) -> None:
    package = PACKAGES[family.name]
    driver, simulator = f"{package}.driver", f"{package}.simulator"
    for start, end in ((driver, simulator), (simulator, driver)):
        assert graph(package).find_shortest_chains(start, end, as_packages=True) == set()


def test_a_family_imports_core_and_errors_only(family: Family) -> None:
    package = PACKAGES[family.name]
    inside = graph(package)
    members = inside.find_descendants(package) | {package}
    members -= {f"{package}.cli"}  # the shell commands of the family; only `motorbus.cli` imports them
    imported = {
        name for member in members for name in inside.find_modules_directly_imported_by(member)
    } - members
    ours = {name for name in imported if name.split(".")[0] == "motorbus" and not is_core(name)}
    foreign = {name.split(".")[0] for name in imported} - sys.stdlib_module_names - {"motorbus", "msgspec"}
    assert (ours, foreign, {name.split(".")[0] for name in imported} & FORBIDDEN) == (set(), set(), set())


def is_core(name: str) -> bool:
    return name == "motorbus.errors" or name == "motorbus.core" or name.startswith("motorbus.core.")
