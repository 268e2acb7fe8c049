"""Every cell of the coverage page is true: names exist, commands parse, simulators answer, frames are explained."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from typing import Any

import pytest

import motorbus
from motorbus import families
from motorbus.cli import build, parse
from motorbus.core.family import Explanation, Family
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import RequestError
from motorbus.families.feetech import wire
from motorbus.families.stepper.wire import COMMANDS as COMMANDS_OF_THE_STEPPER
from motorbus.simulation.named import Simulation
from scripts import coverage
from scripts.coverage import Command, Coverage, Object, Unsent
from scripts.proof import Device, Order, by_order, named
from tests.conformance.subjects import vectors

ROOT = coverage.ROOT
TOLD = {name: coverage.load(name) for name in coverage.known()}
COMMANDS = [
    pytest.param(told, one, id=f"{name}-{one.name}") for name, told in TOLD.items() for one in told.commands
]
NEVER = [(told, one) for told in TOLD.values() for one in told.unsent]
UNSENT = [pytest.param(told, one, id=one.name) for told, one in NEVER]
SWITCHED = [pytest.param(told, one, id=one.name) for told, one in NEVER if one.switch]
MAPS = sorted({(name, map_) for name, told in TOLD.items() for one in told.objects for map_ in one.maps})
CLAIMS: list[tuple[str, Command | Object]] = []
JUDGES: set[str] = set()
for _name, _told in TOLD.items():
    CLAIMS += [(_name, command) for command in _told.commands]
    CLAIMS += [(_name, row) for row in _told.objects]
    JUDGES |= {no.test for no in _told.unsent}
TESTS = sorted({test for _, one in CLAIMS for test in coverage.tests_of(one)} | JUDGES)
NAMES = sorted({(name, api) for name, one in CLAIMS for api in one.api})
LINES = sorted({(name, line) for name, one in CLAIMS for line in one.cli})
PATIENCE = 1.0
"""s in which a device must have answered."""


def test_every_family_is_on_the_page() -> None:
    assert coverage.known() == [name for name in families.names() if name != "template"]


def test_the_page_is_the_one_that_would_be_made() -> None:
    assert coverage.PAGE.read_text(encoding="utf-8") == coverage.page(), "python -m scripts.coverage makes it"


def test_the_page_has_no_empty_cell() -> None:
    rows = [line for line in coverage.page().splitlines() if line.startswith("|")]
    assert len(rows) > 50
    assert [row for row in rows if re.search(r"\|\s*\|", row)] == []


def test_an_empty_cell_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    told = {"name": "SING", "manual": "9", "vectors": ["x"], "api": [], "cli": ["sing"], "test": "t"}
    one = coverage._command(told)
    monkeypatch.setattr(coverage, "_command", lambda _: one)
    with pytest.raises(ValueError, match="a cell of SING is empty"):
        coverage.load("feetech")


def test_an_empty_reason_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    one = TOLD["feetech"].unsent[0]._replace(because="")
    monkeypatch.setattr(coverage, "_unsent", lambda _: one)
    with pytest.raises(ValueError, match=re.escape(f"a cell of {one.name} is empty")):
        coverage.load("feetech")


def test_a_row_that_nothing_reaches_is_refused() -> None:
    row = families.load("feetech").tables["sts"]["id"]
    told = {"device": "Servo", "tests": {"read": "t"}}
    unreachable = motorbus.core.entry.changed(row, access=motorbus.core.entry.Access.WRITE)
    with pytest.raises(ValueError, match="can be neither read nor written"):
        coverage._object([unreachable], ("sts",), told)


def test_every_name_exists_in_python() -> None:
    for family, name in NAMES:
        place = "motorbus" if name.startswith("motorbus.") else f"motorbus.families.{family}"
        found: Any = import_module(place)
        for part in name.removeprefix("motorbus.").split("."):
            found = getattr(found, part)
        assert callable(found) or hasattr(found, "function"), name


def test_all_words_are_a_command() -> None:
    app = build()
    for family, line in LINES:
        spoken = line.replace("BUS", f"{family}:sim").replace("ID", "1").replace("VALUE", "1")
        words = shlex.split(spoken.replace("RATE", "500k"))
        command, _, _ = parse(app, words)
        assert f"{command.__module__}.".startswith(f"motorbus.cli.{words[0].replace('-', '_')}."), line


@cache
def functions_of(file: str) -> set[str]:
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}


def test_every_test_is_there() -> None:
    named = [test.partition("::") for test in TESTS]
    assert [f"{file}::{name}" for file, _, name in named if name not in functions_of(file)] == []


def frame(name: str, vector: str) -> Data:
    (found,) = (one.data for one in vectors(name) if one.id == vector)
    return found


def flat(data: Data) -> bytes:
    return data.flat() if isinstance(data, CanFrame) else data


def heard(simulator: Any, frames: Iterable[Data], at: float) -> list[Data]:
    """Everything that is answered within `PATIENCE`."""
    for one in frames:
        simulator.receive(one, at)
    return [data for _, data in simulator.advance(at + PATIENCE)]


def fresh(told: Coverage, map_: str = "") -> Simulation:
    settings: dict[str, Any] = dict(told.maps[map_ or next(iter(told.maps))])
    return motorbus.simulate(told.family.name, ids=told.ids, **settings)


def memory(simulator: Any, name: str) -> list[int]:
    return [node.memory[name] for node in simulator.nodes.values()]


def usual(told: Coverage, one: Command) -> list[int]:
    """What a device as shipped has where this command shall change something."""
    with fresh(told, one.map) as simulation:
        return memory(simulation.simulator, one.changes) if one.changes else []


@pytest.mark.parametrize(("told", "one"), COMMANDS)
def test_the_simulated_device_answers_or_obeys(told: Coverage, one: Command) -> None:
    name = told.family.name
    for vector in one.vectors:
        with fresh(told, one.map) as simulation:
            simulator = simulation.simulator
            heard(simulator, [frame(name, before) for before in one.before], 0.0)
            held = memory(simulator, one.changes) if one.changes and not one.restarts else usual(told, one)
            answers = heard(simulator, [frame(name, vector)], 10.0)
            assert bool(answers) == one.answers, vector
            if one.restarts:
                for node in list(simulator.nodes.values()):
                    node.power_cycle()
            assert not one.changes or memory(simulator, one.changes) != held, vector
            assert [
                bad.fault for data in answers for bad in told.family.explain(flat(data)) if bad.fault
            ] == []


@pytest.mark.parametrize(("told", "one"), COMMANDS)
def test_the_frame_is_explained(told: Coverage, one: Command) -> None:
    for vector in one.vectors:
        (explained,) = told.family.explain(flat(frame(told.family.name, vector)))
        assert explained.fault == ""
        assert explained.parts


@pytest.mark.parametrize(("told", "one"), UNSENT)
def test_what_is_never_sent_is_refused_explained_and_not_answered(told: Coverage, one: Unsent) -> None:
    name = told.family.name
    encode = getattr(import_module(f"motorbus.families.{name}.wire"), one.encoder)
    with pytest.raises(RequestError, match="never sent"):
        encode(*one.arguments)
    for vector in one.vectors:
        data = frame(name, vector)
        assert set(one.arguments) <= set(flat(data)), "the frame is of this instruction"
        (explained,) = told.family.explain(flat(data))
        assert (explained.fault, bool(explained.parts)) == ("", True)
        for map_ in told.maps:
            with fresh(told, map_) as simulation:
                assert heard(simulation.simulator, [data], 1.0) == []


@pytest.mark.parametrize(("told", "one"), SWITCHED)
def test_what_is_never_sent_is_answered_where_a_switch_says_so(told: Coverage, one: Unsent) -> None:
    for vector in one.vectors:
        switch: dict[str, Any] = {one.switch: one.answers}
        with motorbus.simulate(told.family.name, ids=told.ids, **switch) as simulation:
            assert heard(simulation.simulator, [frame(told.family.name, vector)], 1.0)


def test_every_feetech_instruction_is_on_the_page() -> None:
    """The seven of the manual and every extension that anybody has published: sent, or said to be never sent."""
    told = TOLD["feetech"]
    sent = {flat(frame("feetech", vector))[4] for one in told.commands for vector in one.vectors}
    unsent = {flat(frame("feetech", vector))[4] for one in told.unsent for vector in one.vectors}
    assert sent == {code for code, rule in wire.RULES.items() if rule.sent}
    assert unsent == {code for code, rule in wire.RULES.items() if not rule.sent}
    assert sent | unsent == {1, 2, 3, 4, 5, 6, 8, 9, 0x0A, 0x0B, 0x0D, 0x82, 0x83}


def test_every_register_of_every_feetech_map_is_on_the_page() -> None:
    told = TOLD["feetech"]
    assert set(told.maps) == set(told.family.tables)
    for name, table in told.family.tables.items():
        assert {one.row.name for one in told.objects if name in one.maps} == set(table)


def test_every_stepper_command_is_on_the_page_and_nothing_is_left_for_later() -> None:
    told = TOLD["stepper"]
    numbers = [one.manual.removeprefix("item ") for one in told.commands]
    assert sorted(numbers) == sorted(command.number for command in COMMANDS_OF_THE_STEPPER.values())
    assert len(numbers) == 27
    for one in told.commands:
        own = f"stepper {_words_of(one)} BUS"
        assert one.api
        assert any(line.startswith(own) for line in one.cli), own
        assert not one.later


def _words_of(one: Command) -> str:
    (found,) = (
        name for name, command in COMMANDS_OF_THE_STEPPER.items() if f"item {command.number}" == one.manual
    )
    return found.replace("_", "-")


@pytest.mark.parametrize(("name", "map_"), MAPS)
def test_every_row_is_answered_or_obeyed_and_named(name: str, map_: str) -> None:
    told = TOLD[name]
    for one in told.objects:
        if map_ in one.maps:
            seen = coverage.proof(told, one, map_)
            assert seen.simulator == "answers" or seen.simulator.startswith("obeys: `"), one.row.name
            assert seen.decoder == "names it", one.row.name


def test_what_is_not_answered_is_not_said_to_be() -> None:
    kst = TOLD["kst"]
    found = {one.row.name: coverage.proven(kst, one).simulator for one in kst.objects}
    assert [name for name, said in found.items() if said != "answers"] == ["store"]
    assert found["store"] == "obeys: `node_id` after a power cycle"


SOME = [("feetech", "goal_position"), ("feetech", "id"), ("feetech", "moving")]
SOME += [
    ("kst", name) for name in ("store", "bit_rate_code", "mid_point", "report_interval", "node_id", "status")
]


def of(family: str, name: str) -> Object:
    (found,) = (one for one in TOLD[family].objects if one.row.name == name)
    return found


@pytest.mark.parametrize(("family", "name"), SOME)
def test_a_device_that_is_deaf_to_a_row_has_no_proof(
    family: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The negative: were a row not there, the page could not be made."""
    made = Device.made

    def deaf(device: Device) -> Simulation:
        simulation = made(device)
        receive = simulation.simulator.receive

        def some(data: Data, at: float) -> None:
            if not named(device.family, [data], name):
                receive(data, at)

        monkeypatch.setattr(simulation.simulator, "receive", some)
        return simulation

    assert coverage.proven(TOLD[family], of(family, name)).simulator
    monkeypatch.setattr(Device, "made", deaf)
    with pytest.raises(ValueError, match=f"the simulator knows nothing of {name} of the map"):
        coverage.proven(TOLD[family], of(family, name))


@pytest.mark.parametrize(("family", "name"), SOME)
def test_a_decoder_that_does_not_name_a_row_is_no_proof(
    family: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    explain = type(TOLD[family].family).explain

    def vague(self: Family, data: bytes) -> list[Explanation]:
        return [
            one._replace(
                parts=tuple(p._replace(meaning=re.sub(rf"\b{name}\b", "?", p.meaning)) for p in one.parts)
            )
            for one in explain(self, data)
        ]

    monkeypatch.setattr(type(TOLD[family].family), "explain", vague)
    with pytest.raises(ValueError, match=f"the decoder knows nothing of {name} of the map"):
        coverage.proven(TOLD[family], of(family, name))


def test_a_save_that_keeps_nothing_is_no_proof() -> None:
    """An order that nobody answers is judged by what it changes, and by nothing else."""
    kst = TOLD["kst"]
    device = Device(kst.family, kst.ids, kst.maps["kst"])
    frames = coverage.vectors("kst")
    row = of("kst", "store").row
    save, before = frames["save"], frames["node-id-1"]
    good = Order((save,), (before,), "node_id", restarts=True)
    assert by_order(device, row, good).simulator == "obeys: `node_id` after a power cycle"
    for bad in (
        good._replace(before=()),
        good._replace(changes=""),
        good._replace(frames=(save.replace("625#", "626#"),)),
    ):
        assert by_order(device, row, bad).simulator == ""
    assert by_order(device, row, good._replace(frames=(before,))) == ("answers", "")


def test_a_command_that_is_not_listed_is_no_way() -> None:
    with pytest.raises(ValueError, match="there is no command 'sing'"):
        coverage.proof(TOLD["kst"], of("kst", "store")._replace(command="sing"), "kst")
