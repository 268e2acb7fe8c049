"""Staged faults and healthy machines: the first finding, and only reads on the wire."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Effect
from motorbus.core.steps import INTENT, JournalEntry
from motorbus.doctor import examine
from motorbus.doctor.codes import CODES
from motorbus.doctor.findings import Report
from motorbus.families.stepper.protocol import decode_request
from motorbus.journal import BusJournal
from motorbus.simulation import Simulation
from tests.doctor.scenarios import SCENARIOS, Scenario

READS = (0x01, 0x02, 0x82)  # PING, READ, SYNC READ of a FEETECH servo
UPLOAD = 0x40  # SDO


def only_reads(data: bytes | CanFrame, family: str) -> bool:
    """Whether what a host sent is a read, by the bytes."""
    if isinstance(data, CanFrame):
        return data.id >> 7 == 0x600 >> 7 and data.data[0] == UPLOAD
    if family == "feetech":
        return data[4] in READS and len(data) == data[3] + 4
    found = decode_request(data)
    return found is not None and found[0].effect is Effect.NONE


@contextmanager
def simulated(scenario: Scenario) -> Iterator[tuple[Simulation, list[Any]]]:
    """The simulated bus of a scenario, and what hosts send to it."""
    options = dict(scenario.options)
    sent: list[Any] = []
    with motorbus.simulate(scenario.family, ids=scenario.ids, **options) as sim:
        receive = sim.simulator.receive

        def sniff(data: Any, at: float) -> None:
            sent.append(data)
            receive(data, at)

        sim.simulator.receive = sniff  # type: ignore[method-assign]
        yield sim, sent


def carry_out(sim: Simulation, stage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The orders of a stage: a device or `all`, a word, arguments."""
    for order in filter(None, (part.strip() for part in stage.split(";"))):
        who, word, *words = order.split()
        nodes = list(sim.simulator.nodes.values()) if who == "all" else [sim[int(who, 0)]]
        for node in nodes:
            _order(sim, node, int(who, 0) if who != "all" else 0, word, words, monkeypatch)


def _order(
    sim: Simulation, node: Any, id: int, word: str, words: list[str], patch: pytest.MonkeyPatch
) -> None:
    match word:
        case "unplug":
            node.unplug()
        case "supply":
            node.voltage = float(words[0])
        case "heat":
            node.temperature = float(words[0])
        case "alarm":
            node.alarm = int(words[0])
        case "load":
            node.load_shaft(float(words[0]) / 100)
        case "position":
            node.raw_position = int(words[0])
        case "write":
            node.memory[words[0]] = int(words[1])
            node.move()
        case "value":
            node.values[words[0]] = int(words[1], 0)
        case "project":
            node.put(1, replace(node.store.project(1), **{words[0]: int(words[1])}))
        case "loose":
            turns = iter(range(1_000_000))
            patch.setattr(
                type(node), "plugged", property(lambda one: one is not node or next(turns) % 5 != 0)
            )
        case "mute":
            _report_only(node)
        case "unfinished":
            journal = BusJournal(sim.url)
            journal(JournalEntry("set_id", INTENT, {"node": id, "what": "the id of a servo"}))
            patch.setattr("motorbus.doctor.machine.unfinished", lambda bus: journal.unfinished())
        case _:
            raise ValueError(word)


def _report_only(node: Any) -> None:
    """It sends reports and answers nothing."""
    node.started = True
    node._set_reporting(0.0)
    node.receive = lambda *_: None


def examined(scenario: Scenario, sim: Simulation, folder: Path) -> Report:
    address = sim.url.partition(",")[0] + scenario.bus if scenario.bus else sim.url
    if scenario.family == "kst" and "bit_rate" in scenario.options:
        address = sim.url.partition(",")[0]
    if not scenario.machine:
        ids = f"#{scenario.expect.replace(',', '+')}" if scenario.expect else ""
        return examine.examine_bus(address + ids, {}, scenario.rate)
    file = folder / "machine.toml"
    file.write_text(f'format = 1\n[bus.arm]\naddress = "{address}"\n{scenario.machine}')
    return examine.examine_machine(str(file), {}, scenario.rate)


@pytest.fixture(autouse=True)
def _calibrations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_LEROBOT_CALIBRATION", str(tmp_path / "calibration"))


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda one: one.title)
def test_the_first_finding_names_the_fault(
    scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in scenario.saved.items():
        file = tmp_path / "calibration" / f"{name}.json"
        file.parent.mkdir(parents=True)
        file.write_text(text)
    with simulated(scenario) as (sim, sent):
        carry_out(sim, scenario.stage, monkeypatch)
        report = examined(scenario, sim, tmp_path)
        assert report.findings, "nothing found"
        first = report.findings[0]
        assert first.code == scenario.code, [
            f"{one.code} {one.where} {one.evidence}" for one in report.findings
        ]
        assert scenario.where in first.where
        assert all(one.evidence and one.cause and one.action for one in report.findings)
        assert all(only_reads(data, scenario.family) for data in sent)


def test_the_codes() -> None:
    assert all(one.code in CODES for one in SCENARIOS)
