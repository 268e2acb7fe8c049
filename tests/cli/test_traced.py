"""What -vv shows is whole, and whoever does not take it holds nobody up."""

from __future__ import annotations

import logging
from threading import Event

import pytest

import motorbus
from motorbus.cli import traced as module
from motorbus.cli.traced import LOG, traced
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_all_that_was_sent_and_delivered_is_told(run: Run, arm: Simulation) -> None:
    ran = run("ping", f"{arm.url}#1", "-vv")
    assert "tx FF FF 01 02 01 FB" in ran.err
    assert "rx FF FF 01 02 00 FC" in ran.err


def test_how_a_machine_is_left_is_told_too(run: Run, bench: object) -> None:
    ran = run("hold", "a1", "-vv")
    assert ran.code == 0, ran.err
    assert ran.err.count("\ntx ") + ran.err.count(" tx ") > 3, ran.err


def test_without_it_nobody_listens(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus, traced(bus):
        assert bus.trace.subscriptions == ()


def test_a_terminal_that_is_held_keeps_no_stop_from_leaving(
    arm: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    held, asked = Event(), Event()

    class Held(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            asked.set()
            held.wait(60)

    handler = Held()
    monkeypatch.setattr(module, "PATIENCE", 0.01)
    LOG.addHandler(handler)
    monkeypatch.setattr(LOG, "level", logging.DEBUG)
    LOG.manager._clear_cache()  # type: ignore[attr-defined]  # levels are remembered
    try:
        with motorbus.open(arm.url) as bus, traced(bus):
            for node in (1, 2, 3):
                motorbus.feetech.Servo(bus, node).enable_torque()
            assert asked.wait(60)
            assert bus.estop().acknowledged == (1, 2, 3)
            assert [arm[node].memory["torque_enable"] for node in (1, 2, 3)] == [0, 0, 0]
    finally:
        held.set()
        LOG.removeHandler(handler)
        LOG.manager._clear_cache()  # type: ignore[attr-defined]
