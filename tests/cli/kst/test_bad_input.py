"""Everything that can be wrong with a request to CAN servos: one clear error, its own exit code, nothing changed.

That nothing was changed is seen at the simulated servos: in what the bus hears, and in every object of a servo.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import motorbus
from motorbus.cli.simulated import Simulated
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Ran, Run

pytestmark = pytest.mark.usefixtures("state_folder")

WRITES = 0x20
"""The three top bits of a request that writes; every other frame that is no SDO request changes something, too."""


def objects(servos: Simulation) -> dict[str, int]:
    return {name: servos[37].memory[name] for name in servos.family.registers["kst"]}


def listening(servos: Simulation, monkeypatch: pytest.MonkeyPatch) -> list[CanFrame]:
    """From here on, every frame that the simulated bus hears."""
    heard: list[CanFrame] = []
    receive = servos.simulator.receive

    def overheard(data: Data, at: float) -> None:
        assert isinstance(data, CanFrame)
        heard.append(data)
        receive(data, at)

    monkeypatch.setattr(servos.simulator, "receive", overheard)
    return heard


def changing(heard: list[CanFrame]) -> list[str]:
    reads = [one for one in heard if 0x600 <= one.id < 0x680 and one.data[0] & 0xE0 != WRITES]
    return [str(one) for one in heard if one not in reads]


def told_once(ran: Ran, code: int) -> None:
    assert (ran.code, ran.out) == (code, "")
    assert ran.err.startswith("error: ")
    assert ran.err.count("error: ") == 1


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("kst node-id BUS#37 0 --yes", 2),
        ("kst node-id BUS#37 128 --yes", 2),
        ("kst provision BUS#37 --new-id 128 --yes", 2),
        ("kst provision BUS#37 --new-id 38 --yes", 2),
        ("kst bit-rate BUS#37 8 --yes", 2),
        ("kst position BUS#128 1", 2),
        ("kst position BUS#0 1", 2),
        ("kst position BUS#37 200deg --yes", 8),
        ("kst position BUS#37 nan", 2),
        ("kst reverse BUS#37 on --yes", 2),
        ("move BUS#37=200deg", 8),
        ("move BUS#37=200deg --yes", 8),
        ("move BUS#37+38=200deg --yes", 8),
        ("move BUS#37=nan", 2),
        ("move BUS#128=1", 2),
        ("move BUS#37=1 --velocity 1", 2),
        ("read BUS#37 present_positon", 2),
        ("read BUS#37 store", 2),
        ("read BUS#37 status", 2),
        ("read BUS#128", 2),
        ("read BUS#9", 5),
        ("write BUS#37 present_position=1", 2),
        ("write BUS#37 firmware_version=1", 2),
        ("write BUS#37 node_id=38 --yes", 2),
        ("write BUS#37 node_id=38", 2),
        ("kst mid-point BUS#37", 2),
        ("kst limits BUS#37 -1 1", 2),
        ("kst provision BUS#37 --new-id 38", 2),
        ("kst position BUS#37 --dry-run", 2),
        ("kst node-id BUS#37 --dry-run", 2),
        ("kst bit-rate BUS#37 --dry-run", 2),
        ("kst limits BUS#37 --dry-run", 2),
        ("kst reverse BUS#37 --dry-run", 2),
        ("kst status BUS#37 --dry-run", 2),
        ("kst version BUS#37 --dry-run", 2),
        ("estop BUS#37 --dry-run", 2),
        ("scan BUS --listen --bitrate all", 2),
        ("monitor BUS#37 --listen", 2),
        ("write BUS#37 store=1 --yes", 2),
        ("write BUS#37 goal_position=200deg --yes", 8),
        ("write BUS#37 goal_position=nan", 2),
        ("write BUS#37 goal_position=901raw --expert", 8),
        ("write BUS#37 negative_limit=-1 --yes", 2),
        ("torque off BUS", 2),
        ("torque on BUS#37", 2),
        ("ping BUS#128", 2),
        ("scan BUS --ids 0-3", 2),
        ("scan BUS --baud all", 2),
        ("scan BUS --bitrate fast", 2),
        ("monitor BUS#37 --profile acme", 2),
        ("read BUS#37 --id-format wide", 2),
    ],
)
def test_a_request_that_is_impossible_changes_nothing(
    words: str, code: int, run: Run, servos: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = servos[37].status(), objects(servos)
    heard = listening(servos, monkeypatch)
    told_once(run(*words.replace("BUS", servos.url).split()), code)
    assert (servos[37].status(), objects(servos)) == before
    assert changing(heard) == []


def test_what_is_possible_is_heard(run: Run, servos: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    heard = listening(servos, monkeypatch)
    assert run("write", f"{servos.url}#37", "goal_position=0.5").code == 0
    assert changing(heard) == ["625#220360001E010000"]


def test_a_servo_that_refuses_is_told_with_its_own_words(run: Run) -> None:
    with motorbus.simulate("kst", ids="37", profile="kst") as simulation:
        ran = run("read", simulation.url.replace("profile=kst", "profile=kst-ext") + "#37", "status")
    assert ran.code == 7
    assert "does not exist" in ran.err


@pytest.mark.parametrize("delay", ["0", "0.0005"])
def test_two_servos_with_one_id_are_noticed_by_a_scan(delay: str, run: Run) -> None:
    with motorbus.simulate("kst", ids="37", duplicate="37", duplicate_delay=delay) as simulation:
        simulation[1002].raw_position = 5
        ran = run("scan", simulation.url, "--json")
        read = run("read", f"{simulation.url}#37", "present_position")
    assert ran.code == 0
    assert delay == "0" or "two servos with one id" in " ".join(ran.document["notes"])
    assert delay != "0" or read.code in (1, 5)


@pytest.mark.parametrize(
    ("bus", "code"),
    [
        ("kst:can://slcan/dev/no-such-port", 3),
        ("kst:can://socketcand/127.0.0.1:1/can0", 3),
        ("kst:can://nobody/0", 2),
        ("kst:can://slcan", 2),
        ("kst:/dev/ttyACM0", 2),
        ("kst:sim,bitrate=fast", 2),
        ("kst:sim,profile=acme", 2),
    ],
)
def test_a_bus_that_cannot_be_opened(bus: str, code: int, run: Run) -> None:
    told_once(run("scan", bus), code)


def test_a_wrong_bit_rate_is_silence_with_advice(on_slcan: Simulated, run: Run) -> None:
    ran = run("read", f"{on_slcan.bus},bitrate=250000#37")
    assert ran.code == 5
    assert "--bitrate all" in run("ping", f"{on_slcan.bus}#9").err


def test_all_rates_are_tried_but_those_that_the_adapter_lacks(on_slcan: Simulated, run: Run) -> None:
    ran = run("scan", on_slcan.bus, "--ids", "37-38", "--bitrate", "all", "--json")
    assert ran.code == 0, ran.err
    assert [(one["id"], one["bitrate"]) for one in ran.document["devices"]] == [(37, 500_000), (38, 500_000)]
    assert "nothing was sent at 800000 bit/s" in ran.err


def test_an_adapter_that_is_unplugged_meanwhile(tmp_path: Path) -> None:
    with Simulated("kst", ids="37", link=tmp_path / "can") as simulated:
        words = ["monitor", f"{simulated.bus},reconnect=no#37", "--rate", "1000", "--json"]
        with subprocess.Popen(
            [sys.executable, "-m", "motorbus", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as watching:
            assert watching.stdout is not None
            assert watching.stderr is not None
            assert watching.stdout.readline()
            simulated.end()
            watching.stdout.read()
            told = watching.stderr.read()
            assert watching.wait(timeout=30) == 3, told
    assert '"LinkLost"' in told
