"""Every command on a simulated bus of every family: it does its work, and says that nothing of it was real.

The template, which is out of tree, is found here as an installed family is: by its entry point.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus import families
from motorbus.core.can_frame import CanFrame
from motorbus.core.steps import INTENT, JournalEntry
from tests.cli.conftest import Bench, Run
from tests.support.subjects import FAMILIES, TEMPLATE, template_entry_points, vectors
from tests.support.world import moves

pytestmark = pytest.mark.usefixtures("installed")

COMMON = [
    "scan BUS",
    "ping BUS#1+2",
    "info BUS#1",
    "info BUS#1 --registers",
    "read BUS#1",
    "read BUS#1 present_position",
    "write BUS#1 LIMIT --yes",
    "write BUS#1 LIMIT --dry-run",
    "write BUS#1 goal_position=HERE",
    "move BUS#1=HERE",
    "move BUS#1+2=HERE --velocity 1.5",
    "move BUS#1=HERE --no-wait --dry-run",
    "torque on BUS#1",
    "torque on BUS --dry-run",
    "torque off BUS#1",
    "torque off BUS#1 --dry-run",
    "stop BUS#1",
    "stop BUS#1 --dry-run",
    "monitor BUS#1 --count 1",
    "monitor BUS --count 2",
    "estop BUS#1+2",
]
FEETECH = [
    "ping BUS --broadcast",
    "feetech reset BUS#1 --yes",
    "feetech reset BUS#1 --dry-run",
    "set-id BUS#1 9 --yes",
    "set-id BUS#1 9 --dry-run",
    "set-baud BUS#1 500k --yes",
    "set-baud BUS 500k --dry-run",
    "recover BUS",
    "recover BUS --yes",
    "recover BUS --dry-run",
    "recover BUS --forget --yes",
    "recover BUS --of feetech:/dev/ttyACM42 --yes",
    "calibrate BUS#1 --yes",
    "calibrate BUS#1 --to 90deg --dry-run",
    "calibrate BUS#1 --show",
    "feetech mode BUS#1",
    "feetech mode BUS#1 velocity --yes",
    "feetech mode BUS#1 step --dry-run",
    "feetech recover-overload BUS#1",
]
KST = [
    "ping BUS --broadcast",
    "estop BUS",
    "scan BUS --bitrate all",
    "move BUS#1=HERE",
    "move BUS#1=HERE --dry-run",
    "set-id BUS#1 1 --yes",
    "set-id BUS#1 9 --dry-run",
    "kst mid-point BUS#1 --yes",
    "kst mid-point BUS#1 --dry-run",
    "kst reverse BUS#1",
    "kst reverse BUS#1 on --yes",
    "kst reverse BUS#1 on --dry-run",
]
AXES = [
    "move a1=10deg",
    "move a1+=5deg c1-=2deg lift=3mm --assume lift=0mm",
    "move upper=0 --duration 3s --dry-run",
    "move lift=1mm --home --yes",
    "move lift+=1mm",
    "move lift+=1mm --dry-run",
    "pose ready",
    "pose ready --dry-run",
    "pose --save here a1 c1",
    "park a1",
    "park a1 --dry-run",
    "hold",
    "hold a1 --dry-run",
    "home lift --yes",
    "home lift --dry-run",
    "jog a1=5deg/s --seconds 1",
    "jog a1=5deg/s --seconds 1 --dry-run",
    "jog lift=2mm/s --seconds 1",
    "stop",
    "stop a1 lift --dry-run",
    "torque on a1",
    "torque on upper --dry-run",
    "torque off all",
    "estop",
    "estop all",
    "read a1",
    "info c1",
    "ping all",
    "scan can --ids 0x25",
    "monitor a1 c1 --count 1",
    "init arm=feetech:sim,ids=1-3#1-3 kst:sim#1 --force",
]
"""By the names of a machine file."""
LACKS = {"kst": ("torque ", "--velocity"), "template": ("--velocity",)}
"""What devices of a family cannot: no torque switch, no speed."""
HERE = {"feetech": "3.0", "kst": "0.2", "template": "0.2"}
"""rad; inside the limits, and near to where a simulated device stands."""
LIMIT = {"feetech": "max_temperature=65", "kst": "negative_limit=-1.5", "template": "max_position=3.0"}
"""A row in EEPROM."""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The template as `pip install` would leave it."""
    folder = tmp_path / "motorbus_template-0.1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: motorbus-template\nVersion: 0.1.0\n")
    lines = "".join(f"{point.name} = {point.value}\n" for point in template_entry_points())
    (folder / "entry_points.txt").write_text(f"[{families.GROUP}]\n{lines}")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.syspath_prepend(str(TEMPLATE))


def words(command: str, family: str, bus: str) -> list[str]:
    return command.replace("BUS", bus).replace("HERE", HERE[family]).replace("LIMIT", LIMIT[family]).split()


TURNED = {
    "feetech": {"broadcast_ping": "in_turn"},
    "kst": {"profile": "kst-ext"},
}
"""Options of the simulated devices with which every command can do its work."""


@contextmanager
def standing(family: str, command: str = "") -> Iterator[str]:
    """Two simulated devices, under torque where that can be switched, as this command wants them; their bus."""
    ids = (1, 2)
    with motorbus.simulate(family, ids=ids, **TURNED.get(family, {})) as simulation:
        with motorbus.open(simulation.url) as bus:
            for node in ids:
                device = bus.family.devices.blocking(bus, node)
                if command.startswith("feetech drive"):
                    device.set_mode("velocity")
                if hasattr(device, "enable_torque"):
                    device.enable_torque()
            if command.startswith("recover BUS --") and "--of" not in command:
                leave_unfinished(bus, bytes(simulation[1].memory.read(0, 40)))
        yield simulation.url


def leave_unfinished(bus: Any, registers: bytes) -> None:
    """The id of servo 1 was about to become 7 when the program was killed."""
    facts = {"node": 1, "new": 7, "rate": 1_000_000, "new_rate": 1_000_000, "registers": registers.hex()}
    bus.journal(JournalEntry("set_id", INTENT, {**facts, "taken": []}))


def can(family: str, command: str) -> bool:
    return not any(word in command for word in LACKS.get(family, ()))


CASES = [(family, command) for family in HERE for command in COMMON if can(family, command)]
CASES += [("feetech", command) for command in FEETECH]
CASES += [("kst", command) for command in KST]
LACKING = [(family, command) for family in HERE for command in COMMON if not can(family, command)]


def test_every_family_that_moves_has_a_place_to_go() -> None:
    assert {name for name, family in FAMILIES.items() if moves(family)} == set(HERE)


@pytest.mark.parametrize(("family", "command"), CASES[::4], ids=lambda value: str(value))
def test_it_works_and_says_that_it_is_simulated(family: str, command: str, run: Run) -> None:
    with standing(family, command) as bus:
        ran = run(*words(command, family, bus))
    assert ran.code == 0, ran.err
    assert "(simulated)" in ran.out or ran.out.startswith("simulated\n")
    assert ran.out.splitlines().count("simulated") <= 1


@pytest.mark.parametrize(("family", "command"), CASES, ids=lambda value: str(value))
def test_it_says_so_to_programs_too(family: str, command: str, run: Run) -> None:
    with standing(family, command) as bus:
        ran = run(*words(command, family, bus), "--json")
    assert ran.code == 0, ran.err
    assert [record["simulated"] for record in ran.records] == [True] * len(ran.records)
    assert ran.records


@pytest.mark.parametrize("command", AXES[::3])
def test_by_names_it_works_too_and_says_that_it_is_simulated(command: str, bench: Bench, run: Run) -> None:
    ran = run(*command.split())
    assert ran.code == 0, ran.err
    assert "(simulated)" in ran.out or ran.out.startswith("simulated\n")
    assert ran.out.splitlines().count("simulated") <= 1


@pytest.mark.parametrize("command", AXES)
def test_by_names_it_says_so_to_programs_too(command: str, bench: Bench, run: Run) -> None:
    ran = run(*command.split(), "--json")
    assert ran.code == 0, ran.err
    assert ran.records
    assert all(record["simulated"] and record["schema"].startswith("motorbus.") for record in ran.records)


@pytest.mark.parametrize(("family", "command"), LACKING, ids=lambda value: str(value))
def test_what_its_devices_cannot_is_refused_and_nothing_is_sent(family: str, command: str, run: Run) -> None:
    with standing(family) as bus:
        ran = run(*words(command, family, bus), "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert "have no torque switch" in ran.err or "has no velocity" in ran.err
    assert " tx " not in ran.err


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_frames_are_explained(family: str, run: Run) -> None:
    good = next(vector.data for vector in vectors(family) if vector.valid)
    flat = good.flat() if isinstance(good, CanFrame) else good
    ran = run("decode", "--family", family, flat.hex())
    assert (ran.code, ran.err) == (0, "")
    assert ": good" in ran.out


def test_a_frame_on_can_is_withheld_and_shown(run: Run) -> None:
    ran = run("write", "kst:sim#1", "goal_position=0.2", "--dry-run", "--json")
    (frame,) = ran.document["withheld"]
    assert frame["data"].startswith("00 00 06 01 08 22 03 60")
    assert frame["frame"].startswith("601#220360")
    assert "request to node 1" in frame["meaning"]


def test_an_option_that_a_family_lacks_is_no_order(run: Run) -> None:
    ran = run("move", "template:sim#1=0.2", "--acceleration", "5")
    assert (ran.code, ran.out) == (2, "")
    assert "has no acceleration" in ran.err


def test_a_family_without_commands_is_refused(run: Run) -> None:
    ran = run("template")
    assert (ran.code, ran.out) == (2, "")
    assert "template devices have no commands of their own" in ran.err


def test_who_was_named_confirms_the_stop_of_its_own_family(run: Run) -> None:
    (stop,) = run("estop", "template:sim,ids=1-3#1-3", "--json").document["buses"]
    assert (stop["acknowledged"], stop["silent"]) == ([1, 2, 3], [])
    assert "brakes" in stop["promise"]
