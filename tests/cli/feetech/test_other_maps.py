"""Common commands with a servo of every map: read, written, moved and limp; a stranger is read and limp."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

import motorbus
from motorbus.families.feetech.registers import TABLES
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Ran, Run
from tests.cli.feetech.models import MODELS

Say = Callable[..., Ran]
RATES = {"smbl": 115_200, "smcl": 115_200}
"""bit/s at which servos of a map ship, where that is not 1000000."""


@pytest.fixture(params=TABLES)
def other(request: pytest.FixtureRequest) -> Iterator[tuple[str, Simulation]]:
    """Two simulated servos of this map, and its name."""
    name = str(request.param)
    with motorbus.simulate("feetech", ids="1-2", model=MODELS[name]) as simulation:
        yield name, simulation


@pytest.fixture
def say(other: tuple[str, Simulation], run: Run) -> Say:
    """A command in words, BUS standing for the bus, at the rate of these servos."""
    name, simulation = other
    address = f"{simulation.url},baud={RATES.get(name, 1_000_000)}"

    def said(command: str) -> Ran:
        return run(*command.replace("BUS", address).split())

    return said


def test_info_says_which_map_it_has_and_that_it_is_writable(other: tuple[str, Simulation], say: Say) -> None:
    told = say("info BUS#1 --json").document
    assert (told["table"], told["register_map"], told["writable"]) == (other[0], other[0], True)
    assert say("info BUS#1").code == 0
    assert say("info BUS#1 --registers").code == 0


def test_it_is_scanned_read_and_watched(say: Say) -> None:
    assert len(say("scan BUS --json").document["devices"]) == 2
    assert say("read BUS#1 present_voltage id").code == 0
    assert say("read BUS#1").code == 0
    assert say("monitor BUS#1 --count 1").code == 0


def test_it_is_written_and_moved(other: tuple[str, Simulation], say: Say) -> None:
    _, simulation = other
    assert say("write BUS#1 led_mask=1 --yes").code == 0
    assert simulation[1].memory["led_mask"] == 1
    assert say("torque on BUS#1").code == 0
    assert simulation[1].memory["torque_enable"] == 1
    assert say("move BUS#1=2.0 --yes").code == 0
    assert say("move BUS#1=2.5 BUS#2=3.0 --yes").code == 0
    assert say("stop BUS#1").code == 0


def test_it_is_let_go_and_stopped(other: tuple[str, Simulation], say: Say) -> None:
    _, simulation = other
    for command in ("torque off BUS#1", "estop BUS#1"):
        simulation[1].memory["torque_enable"] = 1
        assert say(command).code == 0
        assert simulation[1].memory["torque_enable"] == 0


def test_hls_is_read_in_its_own_units(run: Run) -> None:
    with motorbus.simulate("feetech", ids="1", model="hls3925") as simulation:
        simulation[1].memory["goal_velocity"] = 100
        (told,) = run("read", f"{simulation.url}#1", "goal_velocity", "--json").document["registers"]
        assert (told["raw"], told["value"]) == (100, pytest.approx(7.66990))
        ran = run("read", f"{simulation.url}#1", "goal_time")
        assert ran.code == 2
        assert "table hls has no register" in ran.err


# --- a servo of an unknown map -------------------------------------------------------------------------

REFUSED = (
    "write BUS#1 led_mask=1 --yes",
    "write BUS#1 led_mask=1 --dry-run",
    "write BUS#1 goal_position=500 --expert --yes",
    "move BUS#1=0.5 --yes",
    "move BUS#1=0.5 BUS#2=3.0 --yes",
    "torque on BUS#1",
    "stop BUS#1",
    "feetech reset BUS#1 --yes",
)


@pytest.fixture
def stranger() -> Iterator[Simulation]:
    """Servo 1 has a firmware that is not described, servo 2 a usual one."""
    with motorbus.simulate("feetech", ids="1-2", firmware="9.9+3.10") as simulation:
        yield simulation


@pytest.mark.parametrize("command", REFUSED)
def test_a_stranger_is_not_written_and_nothing_changes(command: str, run: Run, stranger: Simulation) -> None:
    before = bytes(stranger[1].memory.live), bytes(stranger[2].memory.live[40:56])
    ran = run(*command.replace("BUS", stranger.url).split())
    assert ran.code == 7, ran.err
    assert "register map is unknown" in ran.err
    assert (bytes(stranger[1].memory.live), bytes(stranger[2].memory.live[40:56])) == before


def test_a_stranger_is_told_read_and_let_go(run: Run, stranger: Simulation) -> None:
    told = run("info", f"{stranger.url}#1", "--json").document
    assert (told["table"], told["register_map"], told["writable"]) == ("", "unknown", False)
    assert run("read", f"{stranger.url}#1", "present_voltage", "id").code == 0
    stranger[1].memory["torque_enable"] = 1
    assert run("torque", "off", f"{stranger.url}#1").code == 0
    assert stranger[1].memory["torque_enable"] == 0
