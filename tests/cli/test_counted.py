"""A recording counted: with numpy and without it the same, and never a frame left out."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from motorbus.cli import counted
from tests.cli.conftest import Run

READ = "FF FF 01 04 02 38 02 BE"
ANSWER = "FF FF 01 04 00 18 05 DD"
OTHER = "FF FF 02 02 20 DB"
GOAL, TAKEN = "625#2203600084030000", "5A5#6003600000000000"


@pytest.fixture(params=["at once", "piece by piece"])
def recorded(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A recording of a line, taken apart with numpy and without it."""
    if request.param == "piece by piece":
        monkeypatch.setattr(counted, "can_decode", lambda: False)
        monkeypatch.setattr(counted, "decode", None)
        monkeypatch.setattr(counted, "_PIECE", 5)
    file = tmp_path / "line.bin"
    file.write_bytes(bytes.fromhex(READ + ANSWER * 2 + "00 11" + OTHER + READ[:-2] + "00"))
    return file


def test_what_is_in_it(recorded: Path, run: Run) -> None:
    ran = run("decode", "--family", "feetech", "--file", str(recorded), "--summary", "--json")
    assert ran.code == 1
    document = ran.document
    assert document["schema"] == "motorbus.decode.summary/1"
    assert (document["packets"], document["bytes"], document["noise_bytes"]) == (4, 40, 10)
    assert document["code"] == "the fifth byte: the instruction of a request, the alarm bits of a reply"
    told = [tuple(group.values()) for group in document["groups"]]
    assert told == [
        ("request", 1, 2, "", 1, 8),
        ("reply", 1, 0, "", 2, 16),
        ("reply", 2, 0x20, "", 1, 6),
        ("noise", None, None, "checksum", 1, 8),
        ("noise", None, None, "framing", 1, 2),
    ]


def test_people_see_a_table(recorded: Path, run: Run) -> None:
    lines = run("decode", "--family", "feetech", "--file", str(recorded), "--summary").out.splitlines()
    assert lines[0] == "4 packets, 10 of 40 bytes are noise"
    assert [line.split() for line in lines[1:-1]] == [
        ["kind", "node", "code", "packets", "bytes"],
        ["request", "1", "0x02", "1", "8"],
        ["reply", "1", "0x00", "2", "16"],
        ["reply", "2", "0x20", "1", "6"],
        ["noise:", "checksum", "1", "8"],
        ["noise:", "framing", "1", "2"],
    ]
    assert lines[-1] == "code: the fifth byte: the instruction of a request, the alarm bits of a reply"


def test_a_direction_decides_what_a_packet_is(run: Run) -> None:
    words = ("decode", "--family", "feetech", READ, "--summary", "--json")
    for direction, kind in (("rx", "reply"), ("tx", "request")):
        (group,) = run(*words, "--direction", direction).document["groups"]
        assert group["kind"] == kind
    assert run(*words[:-2], "--direction", "rx").code == 2
    assert run(*words, "--direction", "up").code == 2


@pytest.mark.parametrize("how", ["at once", "piece by piece"])
def test_frames_are_counted_wherever_they_come_from(
    how: str, run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(counted, "can_decode", lambda: how == "at once")
    log = f"(1.0) can0 {GOAL} T\n(1.5) can0 {TAKEN} R\n(1.6) can0 625##1AABB\n"
    (tmp_path / "trace.log").write_text(log)
    documents = [
        run("decode", "--family", "kst", "--summary", "--json", "--file", str(tmp_path / "trace.log"))
    ]
    monkeypatch.setattr(sys, "stdin", io.StringIO(log))
    documents.append(run("decode", "--family", "kst", "--summary", "--json"))
    documents.append(run("decode", "--family", "kst", "--summary", "--json", GOAL, TAKEN, "625##1AABB"))
    for ran in documents:
        assert ran.code == 1, ran.err
        assert [
            (one["kind"], one["node"], one["code"], one["packets"]) for one in ran.document["groups"]
        ] == [
            ("request", 0x25, 0x22_6003_00, 1),
            ("reply", 0x25, 0x60_6003_00, 1),
            ("noise", None, None, 1),
        ]
    assert run("decode", "--family", "kst", "--summary", GOAL, TAKEN).code == 0


def test_notices_are_counted_too(run: Run) -> None:
    ran = run("decode", "--family", "stepper", "--summary", "EE DD FF AA 5E 00 00 00")
    assert ran.code == 0
    assert "0x5E00" in ran.out


def test_nothing_to_count_ends_with_2(run: Run, tmp_path: Path) -> None:
    for name, family in (("empty.bin", "feetech"), ("empty.log", "kst")):
        (tmp_path / name).write_bytes(b"")
        ran = run("decode", "--family", family, "--summary", "--file", str(tmp_path / name))
        assert (ran.code, ran.out) == (2, "")
        assert "there is nothing to count" in ran.err


@pytest.mark.parametrize("how", ["at once", "piece by piece"])
def test_damaged_lines_of_a_log_are_counted_and_the_others_too(
    how: str, run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(counted, "can_decode", lambda: how == "at once")
    log = f"(1.0) can0 {GOAL}\n(1.1) can0 {GOAL[:-1]}\n(1.2) can0 {TAKEN}\n(1.3) can"
    (tmp_path / "trace.log").write_text(log)
    words = ("decode", "--family", "kst", "--summary")
    ran = run(*words, "--file", str(tmp_path / "trace.log"))
    assert ran.code == 1
    assert ran.out.startswith("2 packets, 0 of 26 bytes are noise, damaged lines: 2\n")
    assert f"the first damaged line, 2: {GOAL[:-1]!r} is no CAN frame" in ran.out
    monkeypatch.setattr(sys, "stdin", io.StringIO(log))
    ran = run(*words, "--json")
    assert (ran.code, ran.document["packets"], ran.document["damaged_lines"]) == (1, 2, 2)
    (tmp_path / "trace.log").write_text("(1.3) can")
    ran = run(*words, "--file", str(tmp_path / "trace.log"), "--json")
    assert (ran.code, ran.document["groups"], ran.document["damaged_lines"]) == (1, [], 1)
    assert run(*words, GOAL[:-1]).code == 2, "what is typed is a question"
    assert run(*words, GOAL, "--json").document["damaged_lines"] == 0
