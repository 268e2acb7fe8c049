"""Programs from files of any kind, and what is said of those that are none."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from motorbus.cli.stepper.files import CONCERNED, loaded, reading
from motorbus.errors import RequestError
from motorbus.families.stepper import Behaviour, Program
from motorbus.families.stepper.program.backups import Backup
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE
from tests.protocol.stepper.vectors import DUMP_B


def test_a_program_or_a_dump_by_its_suffix(tmp_path: Path) -> None:
    assert loaded(Path(EXAMPLE)).name == "Pick and place"
    for name, data in (("b.bin", DUMP_B), ("b.hex", DUMP_B.hex(" ").encode()), ("b", DUMP_B[6:])):
        path = tmp_path / name
        path.write_bytes(data)
        assert loaded(path).dump() == DUMP_B
        assert loaded(path).name == "b"


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.bin", DUMP_B[:100], "100 bytes, 226 are due"),
        ("a.bin", DUMP_B[:36] + b"\x09" + DUMP_B[37:], "step 1, output: 9"),
        ("a.bin", bytes(1 << 21), "2097152 bytes"),
        ("a.toml", b"\xff\xfe", "is no text"),
        ("a.TOML", b"format = 9", "format: 9 is not known"),
    ],
)
def test_what_is_none_is_refused_with_its_name(tmp_path: Path, name: str, data: bytes, says: str) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(RequestError, match=says) as caught:
        loaded(path)
    assert name in caught.value.summary


@pytest.mark.parametrize("command", ["check FILE", "estimate FILE", "diff FILE BUS", "write FILE BUS --yes"])
def test_a_backup_is_called_one_and_its_command_is_named(command: str, run: Run, tmp_path: Path) -> None:
    path = tmp_path / "controller.toml"
    path.write_text(Backup(dumps={2: DUMP_B}).text(), encoding="utf-8")
    ran = run("stepper", *command.replace("FILE", str(path)).replace("BUS", "stepper:/dev/not-there").split())
    assert (ran.code, ran.err.count("is a backup of a controller")) == (2, 1)
    assert f"`motorbus stepper restore {path} BUS --dry-run`" in ran.err
    assert "there is no field" not in ran.err


def test_readings_are_switches_by_their_names() -> None:
    assert reading({"seg-loop": "extra", "ramp_tick_ms": "10"}, "check").ramp_tick_ms == 10
    with pytest.raises(RequestError, match="estimate: there is no --turnaround"):
        reading({"turnaround": "1"}, "estimate")  # of the line, and not of a run


@pytest.mark.parametrize(
    ("command", "flag", "says", "hides"),
    [
        ("check", "unatended", "perhaps --unattended; one of --highest, --longest,", "--zero-distance"),
        ("order", "colour", "one of --dump-order; or a switch: --seg-loop, --proj-loop", "--ramp"),
        (
            "estimate",
            "seg_lop",
            "perhaps --seg-loop or --proj-loop; one of --dump-order; or a switch: --ramp,",
            "--output-zero",
        ),
    ],
)
def test_a_flag_that_there_is_not_is_told_with_those_there_are(
    command: str, flag: str, says: str, hides: str
) -> None:
    with pytest.raises(RequestError, match=f"^{command}: there is no --{flag.replace('_', '-')}\n") as caught:
        reading({flag: "1"}, command)
    assert caught.value.expected.startswith(says)
    assert hides not in caught.value.expected


def test_the_switches_that_concern_a_command_are_switches() -> None:
    for names in CONCERNED.values():
        assert {*names} <= {one.name for one in fields(Behaviour)}


def test_a_dump_with_the_highest_byte_first_is_read_as_such(tmp_path: Path) -> None:
    program = Program.load(EXAMPLE)
    path = tmp_path / "big.bin"
    path.write_bytes(program.dump("big"))
    assert loaded(path, "big").project == program.project
    assert loaded(path).project != program.project
    with pytest.raises(RequestError, match="dump_order='middle' is not possible"):
        loaded(path, "middle")


@pytest.mark.parametrize("command", ["check", "estimate", "order", "show"])
def test_every_command_takes_the_order_of_a_dump(run: Run, tmp_path: Path, command: str) -> None:
    text, big, little = (tmp_path / name for name in ("same.toml", "same.bin", "same.img"))
    program = Program.from_dump(DUMP_B, name="same")
    text.write_text(program.text(), encoding="utf-8")
    big.write_bytes(program.dump("big"))
    little.write_bytes(program.dump())
    told = [
        run("stepper", command, str(path), *words).out.replace(str(path), "FILE")
        for path, words in ((text, ()), (big, ("--dump-order", "big")), (little, ()))
    ]
    assert [" ".join(one.split()) for one in told] == [" ".join(told[0].split())] * 3
    assert told[0]
