"""What devices offer a machine: every capability as the contract has it, and trains, which whole robots are led by."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from math import inf, isfinite, nan
from typing import Any

import pytest

from motorbus.core.family import Family, Health, Identity, PositionStream, State
from motorbus.core.request import Effect, Request
from motorbus.core.steps import Runnable, catch, gather
from motorbus.errors import LimitExceeded, NoReply, RequestError
from tests.support.world import IDS, Steps, World, abilities, kept, sent, world

DOCUMENTED: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    **dict.fromkeys(
        ("state", "position", "health", "enable_torque", "disable_torque", "stop", "limits"),
        (("device",), ()),
    ),
    "move": (("device", "to"), ("wait",)),
    "jog": (("device", "velocity", "seconds"), ()),
    "home": (("device",), ("deadline",)),
    "run": (("device", "number"), ("timeout",)),
    "cap_torque": (("device", "fraction"), ()),
    "stream": (("devices",), ("rate",)),
    "set_velocity": (("device", "velocity"), ()),
    "max_velocity": (("device",), ()),
    "plan_move": (("device", "angle"), ("velocity", "acceleration")),
}
"""By capability: what it is called with in order, and what by name."""
TOLD = ("position", "velocity", "load", "current", "voltage", "temperature")
NODE, OTHER, LAST = IDS
WAY = 0.3  # rad; some servos turn 44° to either side and no more


# --- each capability ----------------------------------------------------------------------------------------


def test_capabilities_are_those_of_the_contract_and_are_called_as_it_says(subject: Family) -> None:
    able = abilities(subject)
    for name in able.names:
        function = getattr(able, name)
        order, named = DOCUMENTED[name]
        inspect.signature(function).bind(*order, **dict.fromkeys(named))


def test_without_a_known_register_map_there_is_no_axis(subject: Family) -> None:
    assert not subject.open().axis(Identity(1, "no such model", "", "")).names


def test_a_model_that_is_led_tells_its_position_and_its_limits_and_can_be_stopped(leader: Family) -> None:
    assert {"position", "state", "limits", "move", "stop"} <= abilities(leader).names


def test_what_it_tells_is_a_number_and_telling_writes_nothing(subject: Family) -> None:
    able = abilities(subject)
    with world(subject) as there:
        before = there.settings()
        if "position" in able:
            assert isfinite(ran(there, able.position(there.device(there.ids[0]))))
        if "state" in able:
            assert isinstance(ran(there, able.state(there.device(there.ids[0]))), State)
        assert there.settings() == before


def test_health_is_one_exchange_of_a_known_device_writes_nothing_and_agrees_with_what_it_tells(
    leader: Family,
) -> None:
    able = abilities(leader)
    assert "health" in able  # whoever is led is watched
    with world(leader) as there:
        before = there.settings()
        device = there.device(NODE)
        ran(there, able.health(device))
        wanted = able.health(device)
        assert isinstance(wanted, Request)
        found, state = ran(there, wanted), ran(there, able.state(device))
        assert isinstance(found, Health)
        assert found.torque in ((True, False) if "enable_torque" in able else (None,))
        assert found.state.at <= state.at
        for name in (*TOLD, "moving"):
            told = getattr(found.state, name)
            assert told is None or told == pytest.approx(getattr(state, name), abs=1e-6)
        assert there.settings() == before


def test_health_tells_whether_the_torque_is_on_and_that_it_went_with_the_supply(leader: Family) -> None:
    able = abilities(leader)
    if "enable_torque" not in able:
        assert "disable_torque" not in able
        return
    with world(leader) as there:
        device = there.device(NODE)
        assert ran(there, able.health(device)).torque is False
        ran(there, able.enable_torque(device), Effect.MOTION)
        assert ran(there, able.health(device)).torque is True
        there.simulator.nodes[NODE].power_cycle()
        assert ran(there, able.health(device)).torque is False


def test_limits_are_read_from_a_device_that_is_not_known_and_contain_where_it_stands(leader: Family) -> None:
    able = abilities(leader)
    with world(leader) as there:
        before = there.settings()
        device = there.device(NODE)
        low, high = ran(there, able.limits(device))
        assert low < ran(there, able.position(device)) < high
        assert there.settings() == before
        with pytest.raises(LimitExceeded):
            device.move(high + 0.1)


def test_a_cap_is_taken_lasts_until_power_off_and_keeps_nothing(subject: Family) -> None:
    able = abilities(subject)
    with world(subject) as there:
        if "cap_torque" in able:
            before = there.settings()
            ran(there, able.cap_torque(there.device(NODE), 0.4), Effect.MOTION)
            assert there.settings() != before
            there.simulator.nodes[NODE].power_cycle()
            assert there.settings() == before


# --- trains -------------------------------------------------------------------------------------------------


def ran(there: World, operation: Runnable[Any], worst: Effect = Effect.NONE) -> Any:
    """The value of the operation, of which nothing had a greater effect than this."""
    steps = Steps(there.bus)
    value = steps.run(operation)
    assert max((request.effect for request in steps.requests), default=Effect.NONE) <= worst
    return value


def coupled(there: World) -> PositionStream:
    """All devices as a train; so far nothing was written."""
    before = there.settings()
    devices = [there.device(node) for node in there.ids]
    train: PositionStream = ran(there, abilities(there.family).stream(devices, rate=there.family.link.rate))
    assert there.settings() == before
    return train


def heard(there: World, train: PositionStream) -> dict[int, float]:
    """All positions that it brings; a node that is silent is missing, or all that its exchange asked for."""
    values: dict[int, float] = {}
    for found in there.bus.run(visited(train.positions)):
        if not isinstance(found, Exception):
            values |= found.values
            assert set(found.missing).isdisjoint(found.values)
            assert found.at <= there.link.now()
        else:
            assert isinstance(found, NoReply)
    return values


async def visited(requests: Any) -> list[Any]:
    return list(await gather(*[catch(one) for one in requests]))


def led(there: World, train: PositionStream, to: Mapping[int, float]) -> None:
    there.bus.run(together(train.goals(to)))


async def together(requests: Any) -> None:
    await gather(*list(requests))


def stands(there: World) -> dict[int, int]:
    """Where the simulated devices are, in counts."""
    return {node: there.memory(node)["present_position"] for node in there.ids}


def test_a_train_knows_its_nodes_and_brings_the_position_of_each_again_and_again(leader: Family) -> None:
    with world(leader) as there:
        train = coupled(there)
        assert train.nodes == there.ids
        for _ in range(3):
            told = {node: there.device(node).position() for node in there.ids}
            assert heard(there, train) == pytest.approx(told)
        assert {one.effect for one in train.positions} == {Effect.NONE}


def test_it_is_known_by_then_and_positions_and_goals_ask_nothing_more(leader: Family) -> None:
    with world(leader) as there:
        train = coupled(there)
        with sent(there.bus) as frames:
            here = heard(there, train)
        assert len(frames) == len(train.positions)
        there.bus.run(train.start({}))
        goals = train.goals(here)
        with sent(there.bus) as frames:
            there.bus.run(together(goals))
        assert len(frames) == len(goals)
        assert all(isinstance(one, Request) and one.effect is Effect.MOTION for one in goals)


def test_beginning_moves_nothing_wherever_the_devices_went_before(leader: Family) -> None:
    with world(leader) as there:
        for node in there.ids:
            device = there.device(node)
            switched(there, node, "enable_torque")
            device.move(device.position() + WAY)
            switched(there, node, "disable_torque")
        train = coupled(there)
        before = stands(there)
        there.bus.run(train.start(dict.fromkeys(there.ids, 2.0)))
        there.link.advance(1.0)
        assert all(abs(here - before[node]) <= 1 for node, here in stands(there).items())


def test_beginning_stops_who_is_on_his_way(leader: Family) -> None:
    with world(leader) as there:
        train = coupled(there)
        device = there.device(NODE)
        switched(there, NODE, "enable_torque")
        goal = device.position() + WAY
        device.move(goal, wait=False)
        there.link.advance(0.01)
        there.bus.run(train.start({}))
        there.link.advance(1.0)
        assert device.position() < goal - WAY / 4


def test_goals_are_gone_to_by_those_who_get_one(leader: Family) -> None:
    with world(leader) as there:
        train = coupled(there)
        there.bus.run(train.start(dict.fromkeys(there.ids, 3.0)))
        begun = heard(there, train)
        led(there, train, {node: here + WAY for node, here in begun.items()})
        there.link.advance(2.0)
        assert heard(there, train) == pytest.approx({n: here + WAY for n, here in begun.items()}, abs=0.02)
        led(there, train, {LAST: begun[LAST]})
        there.link.advance(2.0)
        wanted = {NODE: begun[NODE] + WAY, OTHER: begun[OTHER] + WAY, LAST: begun[LAST]}
        assert heard(there, train) == pytest.approx(wanted, abs=0.02)


def test_who_is_led_stays_close_behind_goals_that_come_in_small_steps(leader: Family) -> None:
    with world(leader) as there:
        train = coupled(there)
        there.bus.run(train.start({}))
        begun = heard(there, train)
        for step in range(60):
            led(there, train, {node: here + step * 0.005 for node, here in begun.items()})
            there.link.advance(0.01)
        behind = {node: begun[node] + 59 * 0.005 - here for node, here in heard(there, train).items()}
        assert all(abs(lag) < 0.05 for lag in behind.values()), behind


@pytest.mark.parametrize("way", [0.05, -0.05])
def test_goals_outside_the_limits_are_refused_for_all_and_nothing_moves(leader: Family, way: float) -> None:
    able = abilities(leader)
    with world(leader) as there:
        train = coupled(there)
        there.bus.run(train.start({}))
        there.link.advance(0.5)
        here, before = heard(there, train), stands(there)
        bounds = ran(there, able.limits(there.device(NODE)))
        beyond = bounds[way > 0] + way
        with sent(there.bus) as frames, pytest.raises(LimitExceeded) as caught:
            led(there, train, here | {NODE: beyond})
        assert caught.value.node == NODE
        assert len(frames) < len(there.ids)  # where each has a frame of its own, the others may have theirs
        there.link.advance(0.5)
        assert stands(there)[NODE] == before[NODE]


@pytest.mark.parametrize("goal", [nan, inf, -inf, 1e12, -1e300])
def test_goals_that_are_no_position_are_refused_before_an_exchange_is_made(
    leader: Family, goal: float
) -> None:
    with world(leader) as there:
        train = coupled(there)
        with pytest.raises(LimitExceeded) as caught:
            train.goals({NODE: goal})
        assert caught.value.node == NODE


def test_goals_for_somebody_else_are_refused(leader: Family) -> None:
    with world(leader) as there:
        train = coupled(there)
        with pytest.raises(RequestError, match="60"):
            train.goals({60: 0.0})


def test_every_goal_names_its_node_and_the_limits_that_the_gate_judges_it_by(leader: Family) -> None:
    with world(leader) as there:
        train = coupled(there)
        for goal in train.goals(heard(there, train)):
            assert goal.setpoints
            assert all(one.low is not None and one.high is not None for one in goal.setpoints)
            assert {one.node for one in goal.setpoints} <= set(train.nodes)


def test_goals_made_before_a_setting_was_written_do_not_leave(keeping_leader: Family) -> None:
    with world(keeping_leader) as there:
        device = there.device(NODE)
        devices = [device, *(there.device(node) for node in there.ids[1:])]
        train = there.bus.run(abilities(keeping_leader).stream(devices, rate=keeping_leader.link.rate))
        there.bus.run(train.start({}))
        goals = train.goals(heard(there, train))
        row = next(row for row in kept(there.table(NODE)) if not row.choices)
        held = row.to_raw(device.read(row.name)[row.name])
        device.write(
            **{row.name: row.to_value(held - 1 if held > row.low else held + 1)}
        )  # what is so is not written
        mine = [one for one in goals if NODE in {goal.node for goal in one.setpoints}]
        with sent(there.bus) as frames:
            for one in mine:
                with pytest.raises(RequestError):
                    there.bus.run(one)
        assert mine
        assert frames == []


@pytest.mark.parametrize("dead", IDS)
def test_a_dead_node_is_missing_and_costs_nobody_else_his_position(leader: Family, dead: int) -> None:
    with world(leader) as there:
        train = coupled(there)
        there.bus.run(train.start({}))
        there.simulator.nodes[dead].unplug()
        assert heard(there, train).keys() == set(there.ids) - {dead}
        led_others(there, train, dead)


def led_others(there: World, train: PositionStream, dead: int) -> None:
    """Who is there follows a goal although one is dead."""
    alive = heard(there, train)
    to = {node: here + 0.02 for node, here in alive.items()}
    there.bus.run(visited(train.goals(to | {dead: 0.1})))
    there.link.advance(0.5)
    assert heard(there, train) == pytest.approx(to, abs=0.01)


def test_beginning_visits_everyone_and_then_says_who_is_dead(leader: Family) -> None:
    with world(leader) as there:
        train = coupled(there)
        there.simulator.nodes[NODE].unplug()
        with pytest.raises(NoReply) as caught:
            there.bus.run(train.start({}))
        assert caught.value.node == NODE
        led_others(there, train, NODE)


def test_a_train_with_a_dead_node_is_not_made(leader: Family) -> None:
    with world(leader) as there:
        there.simulator.nodes[OTHER].unplug()
        with pytest.raises(NoReply) as caught:
            coupled(there)
        assert caught.value.node == OTHER


def test_who_is_known_is_coupled_again_without_being_asked(leader: Family) -> None:
    able = abilities(leader)
    with world(leader) as there:
        devices = [there.device(node) for node in there.ids]
        make: Callable[[], Runnable[PositionStream]] = lambda: able.stream(devices, rate=leader.link.rate)  # noqa: E731
        there.bus.run(make())
        with sent(there.bus) as frames:
            there.bus.run(make())
        assert frames == []


def switched(there: World, node: int, name: str) -> None:
    """The torque, where there is a switch for it."""
    able = abilities(there.family)
    if name in able:
        there.bus.run(getattr(able, name)(there.device(node)))
