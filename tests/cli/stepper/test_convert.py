"""Each form from each other one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from motorbus.families.stepper import Program
from motorbus.families.stepper.program import schema
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE
from tests.families.stepper.vectors import DUMP_B


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
