"""Each form from each other one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from motorbus.families.stepper import Program
from motorbus.families.stepper.program import schema
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE
from tests.protocol.stepper.vectors import DUMP_B


def test_a_dump_becomes_a_file_and_comes_back(run: Run, tmp_path: Path) -> None:
    dump, text, again = (tmp_path / name for name in ("b.bin", "b.toml", "again.bin"))
    dump.write_bytes(DUMP_B)
    assert run("stepper", "convert", str(dump), "--output", str(text)).code == 0
    assert run("stepper", "convert", str(text), "--to", "dump", "--output", str(again)).code == 0
    assert again.read_bytes() == DUMP_B


@pytest.mark.parametrize("to", ["toml", "dump", "image", "frames"])
def test_it_is_printed_or_a_document(run: Run, to: str) -> None:
    program = Program.load(EXAMPLE)
    shown = {
        "toml": program.text(),
        "dump": program.dump().hex(" ").upper(),
        "image": program.image().hex(" ").upper(),
        "frames": "\n".join(frame.hex(" ").upper() for frame in program.frames()),
    }[to].strip()
    assert run("stepper", "convert", EXAMPLE, "--to", to).out.strip() == shown
    assert run("stepper", "convert", EXAMPLE, "--to", to, "--json").document[to] == shown


def test_frames_in_a_file_are_one_on_each_line(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "frames.txt"
    run("stepper", "convert", EXAMPLE, "--to", "frames", "--output", str(path))
    frames = [bytes.fromhex(line) for line in path.read_text(encoding="ascii").splitlines()]
    assert frames == Program.load(EXAMPLE).frames()


def test_another_form_ends_with_2(run: Run) -> None:
    ran = run("stepper", "convert", EXAMPLE, "--to", "punched-tape")
    assert (ran.code, ran.out) == (2, "")
    assert "toml, dump, image, frames" in ran.err


def test_the_schema_is_printed_as_it_is(run: Run) -> None:
    assert json.loads(run("stepper", "schema").out) == schema()
    assert run("stepper", "schema", "--json").document["schema_of_files"] == schema()


def test_what_a_form_cannot_hold_is_told(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "known.bin"
    program = Program.from_dump(DUMP_B[:18] + b"\x12\x34" + DUMP_B[20:])
    path.write_bytes(replace(program, project=program.project.with_step(9, delay=5)).dump())
    unnamed = "cannot hold what no field names: 12 at byte 18 of the dump, 34 at byte 19 of the dump"
    behind = "frames write no steps behind the last one: step 9"
    for to, told in (("toml", [unnamed]), ("frames", [unnamed, behind]), ("dump", []), ("image", [])):
        ran = run("stepper", "convert", str(path), "--to", to)
        assert ran.code == 0
        assert [line.startswith("note: ") for line in ran.err.splitlines()] == [True] * len(told)
        assert all(one in ran.err for one in told)


def test_a_cleared_project_is_no_file(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "cleared.bin"
    path.write_bytes(bytes.fromhex("FFAA3E030000") + bytes(220))
    ran = run("stepper", "convert", str(path))
    assert (ran.code, ran.out) == (2, "")
    assert "project 3 has been cleared: there is nothing for a file to say" in ran.err
