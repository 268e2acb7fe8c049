"""The data sheet is printed, or written to a file, for each profile."""

from __future__ import annotations

from pathlib import Path

from motorbus.families.kst.eds import eds
from motorbus.families.kst.profiles import PROFILES
from tests.cli.conftest import Run


def test_it_is_printed_as_it_is(run: Run) -> None:
    assert run("kst", "eds").out.split() == eds(PROFILES["kst"]).split()


def test_it_is_written_to_a_file(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "servo.eds"
    ran = run(
        "kst",
        "eds",
        "--profile",
        "xqpower",
        "--with-mandatory",
        "--node",
        "0x10",
        "--output",
        str(file),
        "--json",
    )
    assert ran.code == 0, ran.err
    assert ran.document == {"schema": "motorbus.kst.eds/1", "profile": "xqpower", "file": str(file)}
    told = file.read_text(encoding="ascii")
    assert told == eds(PROFILES["xqpower"], node_id=16, with_mandatory=True, file_name="servo.eds")
    assert b"\r\n" in file.read_bytes()


def test_what_there_is_no_sheet_for_ends_with_2(run: Run) -> None:
    assert run("kst", "eds", "--profile", "acme").code == 2
    assert run("kst", "eds", "--node", "128").code == 2


def test_a_place_that_is_not_there_is_told(run: Run, tmp_path: Path) -> None:
    ran = run("kst", "eds", "--output", str(tmp_path / "none" / "servo.eds"))
    assert (ran.code, ran.out) == (2, "")
    assert "servo.eds cannot be written: no such file or directory" in ran.err
