"""One verb for all: everyone is visited, everyone is told of, and the exit code tells how it went."""

from __future__ import annotations

import pytest

from motorbus.cli.each import each
from motorbus.cli.exits import Exit, Partial
from motorbus.cli.output import Output
from motorbus.errors import NoReply, RequestError
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Bench


def test_all_do_as_asked(arm: Simulation, capsys: pytest.CaptureFixture[str]) -> None:
    assert each("say hello", "ping", (f"{arm.url}#1+2",), {}, Output()) is Exit.OK
    assert capsys.readouterr().out.count("say hello") == 2


def test_some_do(arm: Simulation, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(Partial, match="node 9"):
        each("look", "position", (f"{arm.url}#9+1",), {}, Output())
    shown = capsys.readouterr().out
    assert "node 9" in shown
    assert "look" in shown


def test_none_does(arm: Simulation) -> None:
    with pytest.raises(NoReply):
        each("look", "position", (f"{arm.url}#8+9",), {}, Output())


def test_a_verb_they_lack(arm: Simulation) -> None:
    with pytest.raises(RequestError, match="no tail wagging"):
        each("wag", "tail_wagging", (f"{arm.url}#1",), {}, Output())


def test_a_dry_run_sends_nothing_to_anybody(arm: Simulation, capsys: pytest.CaptureFixture[str]) -> None:
    before = [arm[node].status() for node in (1, 2)]
    assert each("on", "enable_torque", (f"{arm.url}#1+2",), {}, Output(), dry_run=True) is Exit.OK
    shown = capsys.readouterr().out
    assert [shown.count(f"WRITE to servo {node}") for node in (1, 2)] == [1, 1]  # goal and switch in one
    assert [arm[node].status() for node in (1, 2)] == before


def test_a_dry_run_tells_who_is_silent(arm: Simulation) -> None:
    with pytest.raises(Partial, match="node 9"):
        each("on", "enable_torque", (f"{arm.url}#1+9",), {}, Output(), dry_run=True)


def test_a_bus_that_cannot_be_opened_keeps_no_other_waiting(
    arm: Simulation, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(Partial, match="no-such-port"):
        each("say hello", "ping", ("feetech:/dev/no-such-port#1+2", f"{arm.url}#1"), {}, Output())
    shown = capsys.readouterr().out
    assert (shown.count("no-such-port#"), shown.count("say hello")) == (2, 1)
    with pytest.raises(Partial, match="no-such-port"):
        each("say hello", "ping", ("feetech:/dev/no-such-port", f"{arm.url}#1"), {}, Output())


def test_who_was_named_by_an_axis_is_told_of_by_that_name(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    assert each("say hello", "ping", ("a2", "arm#3"), {}, Output()) is Exit.OK
    told = capsys.readouterr().out
    assert "a2 (feetech:sim:" in told
    assert "a3" not in told
