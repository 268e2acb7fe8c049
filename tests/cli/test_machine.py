"""Which machine file counts, what its names stand for in every command, and every way in which a file can be broken."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from motorbus.cli import machine
from tests.cli.conftest import Bench, Run
from tests.motion.machine.files import BROKEN, Broken

ARM = 'format = 1\n[bus.arm]\naddress = "feetech:sim,ids={}"\n[axis.shoulder]\ndevice = "arm#{}"\n'


def write(path: Path, node: int) -> Path:
    """A machine whose only axis is the device with this id, the only one on its bus."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(ARM.format(node, node), encoding="utf-8")
    return path


def found(run: Run, *words: str) -> int:
    """The id of the device that the axis of the file is."""
    node: int = run("ping", "shoulder", *words, "--json").document["devices"][0]["id"]
    return node


# -- which file --------------------------------------------------------------------------------------------------------


def test_the_flag_comes_before_the_environment_before_this_folder_before_the_users(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch, no_file_of_the_user: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    write(no_file_of_the_user / "motorbus.toml", 1)
    assert found(run) == 1
    write(tmp_path / "motorbus.toml", 2)
    assert found(run) == 2
    monkeypatch.setenv("MOTORBUS_MACHINE", str(write(tmp_path / "three.toml", 3)))
    assert found(run) == 3
    told = str(write(tmp_path / "four.toml", 4))
    assert found(run, "--machine", told) == 4
    assert found(run, f"--machine={told}") == 4
    assert run("--machine", told, "ping", "shoulder", "--json").document["devices"][0]["id"] == 4


def test_a_file_that_somebody_named_must_be_there(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "motorbus.toml", 2)
    ran = run("ping", "shoulder", "--machine", "nowhere.toml")
    assert (ran.code, ran.out) == (2, "")
    assert "nowhere.toml: it cannot be read" in ran.err
    monkeypatch.setenv("MOTORBUS_MACHINE", "gone.toml")
    ran = run("ping", "shoulder")
    assert (ran.code, "gone.toml" in ran.err, "named by MOTORBUS_MACHINE" in ran.err) == (2, True, True)


WITHOUT_IT = ("read nobody", "hold nobody", "move nobody=1", "pose nobody", "park shoulder", "stop nobody")


@pytest.mark.parametrize(
    "command", [*WITHOUT_IT, "replay wave.csv", "home nobody", "jog nobody=1 --seconds 1"]
)
def test_what_is_not_in_the_file_is_told_with_which_file_that_is_and_why(
    command: str, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch, no_file_of_the_user: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("wave.csv").write_text("time,nobody\n0,1\n1,2\n", encoding="utf-8")
    no_file_of_the_user.mkdir()
    own = write(no_file_of_the_user / "motorbus.toml", 1)

    def told(*words: str) -> str:
        ran = run(*command.split(), *words)
        assert (ran.code, ran.out) == (2, ""), ran.err
        (note,) = (line for line in ran.err.splitlines() if line.startswith("  note: the machine file is "))
        return note.partition(" is ")[2]

    assert told() == f"{own}, your own"
    write(tmp_path / "motorbus.toml", 2)
    assert told() == "./motorbus.toml, found in this folder"
    monkeypatch.setenv("MOTORBUS_MACHINE", str(write(tmp_path / "three.toml", 3)))
    assert told() == f"{tmp_path}/three.toml, named by MOTORBUS_MACHINE"
    assert told("--machine", "motorbus.toml") == "./motorbus.toml, named by --machine"


@pytest.mark.parametrize("words", [["--machine"], ["--machine="], ["--machine", "--json"]])
def test_the_flag_needs_a_file(words: list[str], run: Run) -> None:
    ran = run("ping", "shoulder", *words)
    assert (ran.code, ran.out) == (2, "")
    assert "error" in ran.err


def test_without_any_file_a_name_says_where_one_was_looked_for(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch, no_file_of_the_user: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = run("read", "shoulder")
    assert (ran.code, ran.out) == (2, "")
    assert "'shoulder' is not a bus address, and there is no machine file" in ran.err
    assert "./motorbus.toml" in ran.err
    assert str(no_file_of_the_user / "motorbus.toml") in ran.err
    assert "motorbus init" in ran.err
    assert run("hold").code == 2
    assert "there is no machine file" in run("hold").err


def test_an_address_needs_no_file(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motorbus.toml").write_text("this is no machine", encoding="utf-8")
    assert run("ping", "feetech:sim,ids=3#3").code == 0
    assert run("ping", "shoulder").code == 2


# -- names -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("arm", ["ARM"]),
        ("arm#1+3", ["ARM#1+3"]),
        ("a2", ["ARM#2"]),
        ("upper", ["ARM#1+2+3"]),
        ("all", ["ARM#1+2+3", "CAN#37", "STAGE#1"]),
        ("feetech:COM7,baud=500k#3", ["feetech:COM7,baud=500k#3"]),
    ],
)
def test_what_a_name_stands_for(text: str, meant: list[str], bench: Bench) -> None:
    urls = {name.upper(): simulation.url for name, simulation in bench.simulations.items()}

    def address(word: str) -> str:
        name, hash_, ids = word.partition("#")
        return f"{urls.get(name, name)}{hash_}{ids}"

    assert machine.addresses(text) == [address(word) for word in meant]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("amr", "did you mean arm?"),
        ("lft", "did you mean lift?"),
        ("redy", "an address needs a colon"),
        ("ready", "it is a pose: `motorbus pose ready`"),
        ("a1#2", "it is an axis: a1 alone means its device, arm#1"),
        ("amr#2", "did you mean arm?"),
        ("arm,baud=500k", "each option as a flag"),
        ("", "has no bus, axis or group"),
        ("arm#", "ids after #"),
        ("arm#x", "not a number or a range"),
    ],
)
def test_a_name_that_is_none_ends_with_one_error_and_sends_nothing(
    text: str, told: str, bench: Bench, run: Run
) -> None:
    ran = run("ping", text, "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert told in ran.err
    assert ran.err.count("error: ") == 1
    assert " tx " not in ran.err


@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("scan a1", 0),
        ("scan arm --ids 1-3", 0),
        ("info a2", 0),
        ("ping all", 0),
        ("ping arm#1+2", 0),
        ("read a3", 0),
        ("read lift", 0),
        ("write a1 torque_limit=50%", 0),
        ("write c1 goal_position=0.1 --dry-run", 0),
        ("monitor a1 c1 --count 1", 0),
        ("torque on a1 --dry-run", 0),
        ("torque off upper", 0),
        ("stop a1 lift", 0),
        ("stop all", 0),
        ("stop", 0),
        ("estop upper", 0),
        ("move arm#1=3.0", 0),
        ("jog lift=1mm/s --seconds 0.5", 0),
        ("home lift --yes", 0),
        ("hold a1", 0),
        ("calibrate a1 --show", 0),
        ("set-id a1 9 --dry-run", 0),
        ("recover arm", 0),
        ("feetech mode a1", 0),
        ("read can#37 node_id", 0),
        ("stepper io lift", 0),
        ("scan all", 2),
        ("kst reverse a1", 2),
    ],
)
def test_names_go_where_addresses_go(command: str, code: int, bench: Bench, run: Run) -> None:
    ran = run(*command.split())
    assert ran.code == code, ran.err
    assert ran.err.count("error: ") == (code == 2)


def test_a_flag_goes_before_what_the_file_says(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "motorbus.toml", 2)
    assert run("ping", "shoulder", "--ids", "3").code == 5
    ran = run("hold", "shoulder", "--baud", "fast")
    assert (ran.code, "fast" in ran.err) == (2, True)


# -- broken files ------------------------------------------------------------------------------------------------------


def judge(broken: Broken, command: list[str], file: Path, run: Run) -> None:
    """The buses in it do not exist: had one of them been opened, the exit code would be 3."""
    judge_content(broken.text.encode(), broken.says, broken.fix, command, file, run)


def judge_content(content: bytes, says: str, fix: str, command: list[str], file: Path, run: Run) -> None:
    file.write_bytes(content)
    ran = run(*command, "--machine", str(file), "--json")
    assert (ran.code, ran.out) == (2, "")
    (line,) = ran.err.splitlines()
    told = json.loads(line)
    assert told["exit"] == 2
    assert told["summary"].startswith(f"{file}: {says}")
    assert fix in f"{told['summary']} / {told['expected']} / {told['advice']}"
    assert len(told["expected"]) < 400
    assert re.fullmatch(r".{6,}; nothing was opened", told["advice"])
    assert told["advice"].count("nothing was") == 1


@pytest.mark.parametrize("broken", [pytest.param(one, id=one.says[:50]) for one in BROKEN[::6]])
@pytest.mark.parametrize("command", [["hold"], ["read", "shoulder"]], ids=["axes", "device"])
def test_a_broken_file_ends_with_2_and_one_message(
    broken: Broken, command: list[str], tmp_path: Path, run: Run
) -> None:
    judge(broken, command, tmp_path / "bench.toml", run)


ALL = ("hold", "stop", "loop-stats", "park", "pose --save here", "teach --output x.csv")


@pytest.mark.parametrize("command", ALL)
def test_a_machine_without_an_axis_is_told_so(command: str, tmp_path: Path, run: Run) -> None:
    file = tmp_path / "bench.toml"
    judge_content(b"format = 1\n", "the machine has no axis", "[axis.NAME]", command.split(), file, run)
