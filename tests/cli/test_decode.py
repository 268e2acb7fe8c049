"""`motorbus decode`: bytes and logs as people have them give the frames in them, or the line that cannot be read."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from motorbus.cli.program import run

READ = "FF FF 01 04 02 38 02 BE"
STATUS = "FF FF 01 04 00 18 05 DD"
ASC = """date Fri Nov 27 10:00:00.000 am 2026
base hex  timestamps absolute
internal events logged
   0.000000 CANFD   Start of measurement
   0.000500 1  625             Tx   d 8 22 03 60 00 84 03 00 00  Length = 242258 BitCount = 125 ID = 1573
   0.024998 CAN 1 Status:chip status error active
"""


def _frames(shown: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in shown.splitlines()]


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        (f"{READ}\n{STATUS}", [READ, STATUS]),
        (f"7: {READ}\n7: {STATUS}", [READ, STATUS]),
        (f"12: {READ}\n7: {STATUS}", [READ, STATUS]),
        (" 33: FF FF 00 04 02 00 09 F0", ["FF FF 00 04 02 00 09 F0"]),
        (f"TX: {READ}\nRX: {STATUS}", [READ, STATUS]),
        ("ff:ff:01:04:02:38:02:be", [READ]),
        ("00000000: ffff 0104 0238 02be                      .....8..", [READ]),
        (f"0000000 {READ.lower()} {STATUS.lower()}\n0000020 {READ.lower()}\n0000030", [READ, STATUS, READ]),
        ("byte p[] = { 0xFF, 0xFF, 0x01, 0x04, 0x02, 0x38, 0x02, 0xBE }; // read", [READ]),
        ("[255, 255, 1, 4, 0, 24, 5, 221]", [STATUS]),
    ],
)
def test_bytes_of_a_file(
    text: str, frames: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "capture.txt"
    file.write_text(text)
    assert run(["decode", "--family", "feetech", "--file", str(file), "--json"], last=False) == 0
    found = _frames(capsys.readouterr().out)
    assert [one["data"] for one in found] == frames
    assert not any(one["fault"] for one in found)


@pytest.mark.parametrize("text", ["FF F", "FF F F", "12.5 volts", "[1, 256]", f"[{'9' * 5000}]", "0xF"])
def test_a_line_that_cannot_be_read_is_named(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "capture.txt"
    file.write_text(f"{READ}\n{text}\n")
    assert run(["decode", "--family", "feetech", "--file", str(file)], last=False) == 2
    shown = capsys.readouterr()
    assert not shown.out
    assert "line 2" in shown.err
    assert "fromhex" not in shown.err


def test_events_and_channels_of_an_asc_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "trace.asc"
    file.write_text(ASC)
    assert run(["decode", "--family", "kst", "--file", str(file), "--json"], last=False) == 0
    (found,) = _frames(capsys.readouterr().out)
    assert (found["data"], found["channel"], found["direction"]) == ("625#2203600084030000", "1", "tx")


def test_a_damaged_asc_line_is_named_without_words_of_python(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "trace.asc"
    file.write_text(ASC + "   0.030000 1  625   Tx   d 8 22 zz 60 00 84 03 00 00\n")
    assert run(["decode", "--family", "kst", "--file", str(file)], last=False) == 2
    shown = capsys.readouterr().err
    assert "line 7" in shown
    assert "invalid literal" not in shown
    assert "non-hexadecimal" not in shown


def test_summary_counts_frames(capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        run(
            ["decode", "--family", "feetech", "--summary", "--json", *READ.split(), *STATUS.split()],
            last=False,
        )
        == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert (found["packets"], found["noise_bytes"]) == (2, 0)
