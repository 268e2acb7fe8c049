"""Bytes explained: each of them, from the shell or from a pipe, and why bad ones are bad."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import can
import pytest

from motorbus.recorder.can_log import parse_word
from tests.cli.conftest import Run

READ = "FF FF 01 04 02 38 02 BE"
ANSWER = "FF FF 01 04 00 18 05 DD"


def test_every_byte_of_a_good_frame_is_told(run: Run) -> None:
    ran = run("decode", "--family", "feetech", *READ.split())
    assert ran.code == 0
    assert "present_position" in ran.out
    for byte in READ.split():
        assert byte in ran.out
    document = run("decode", "--family", "feetech", "--json", *READ.split()).document
    (frame,) = document["frames"]
    assert frame["valid"]
    assert " ".join(part["data"] for part in frame["parts"]) == READ
    assert frame["parts"][0]["start"] == 0


@pytest.mark.parametrize(
    "text",
    [READ.lower(), READ.replace(" ", ""), READ.replace(" ", ","), "0xFF,0xFF,0x01,0x04,0x02,0x38,0x02,0xBE"],
)
def test_bytes_may_be_written_in_many_ways(text: str, run: Run) -> None:
    assert run("decode", "--family", "feetech", "--json", text).document["frames"][0]["data"] == READ


def test_bytes_may_come_from_a_pipe(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(f"{READ}\n{ANSWER}\n"))
    document = run("decode", "--family", "feetech", "--json").document
    assert [frame["data"] for frame in document["frames"]] == [READ, ANSWER]
    assert "1304" in str(document["frames"][1]["parts"]), "the answer is read by the question before it"


@pytest.mark.parametrize("bad", ["FF FF 01 04 00 18 05 DE", "11 22 33", "FF FF 01 04 02"])
def test_a_bad_frame_ends_with_1_and_says_why(bad: str, run: Run) -> None:
    ran = run("decode", "--family", "feetech", *bad.split())
    assert ran.code == 1
    assert "BAD: " in ran.out
    document = run("decode", "--family", "feetech", "--json", *bad.split()).document
    assert not document["frames"][0]["valid"]
    assert document["frames"][0]["fault"]


@pytest.mark.parametrize(
    "words", [["--family", "nobody", "FF"], ["--family", "feetech", "FG"], ["--family", "feetech", "F"]]
)
def test_what_is_no_question_ends_with_2(words: list[str], run: Run) -> None:
    assert run("decode", *words).code == 2


def test_nothing_to_decode_ends_with_2(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    assert run("decode", "--family", "feetech").code == 2


GOAL, TAKEN = "625#2203600084030000", "5A5#6003600000000000"


def test_can_frames_are_written_as_candump_writes_them(run: Run) -> None:
    ran = run("decode", "--family", "kst", GOAL, TAKEN)
    assert ran.code == 0, ran.err
    assert GOAL in ran.out
    assert "90°" in ran.out
    document = run("decode", "--family", "kst", "--json", GOAL, TAKEN).document
    assert [one["frame"] for one in document["frames"]] == [GOAL, TAKEN]
    assert document["frames"][0]["data"] == "00 00 06 25 08 22 03 60 00 84 03 00 00"
    assert run("decode", "--family", "kst", "00000625#4000300000000000").code == 0
    assert run("decode", "--family", "kst", "--json", "0000062508 2203600084030000").document == {
        **document,
        "frames": document["frames"][:1],
    }


@pytest.mark.parametrize("bad", ["625##1AABB", "625#R", "625#22", "123#00"])
def test_a_can_frame_that_is_none_of_theirs_is_bad(bad: str, run: Run) -> None:
    ran = run("decode", "--family", "kst", bad)
    assert ran.code == 1
    assert "BAD: " in ran.out
    assert ("not classic CAN" in ran.out) == ("##" in bad)


@pytest.mark.parametrize("words", [["kst", "625#2"], ["kst", "625#001122334455667788"], ["feetech", GOAL]])
def test_what_is_no_can_frame_here_ends_with_2(words: list[str], run: Run) -> None:
    assert run("decode", "--family", *words).code == 2


LOG = f"(1436509052.249713) can0 {GOAL} T\n(1436509052.250000) can0 {TAKEN} R\n"


def test_candump_on_a_pipe_is_explained_line_by_line(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(LOG))
    ran = run("decode", "--family", "kst", "--json")
    assert ran.code == 0, ran.err
    assert [one["schema"] for one in ran.records] == ["motorbus.decode.frame/1"] * 2
    assert [(one["frame"], one["direction"]) for one in ran.records] == [(GOAL, "tx"), (TAKEN, "rx")]
    assert (ran.records[0]["time"], ran.records[0]["relative"]) == (1436509052.249713, False)


@pytest.mark.parametrize(("suffix", "relative"), [(".log", False), (".blf", False), (".asc", True)])
def test_recordings_are_read(suffix: str, relative: bool, run: Run, tmp_path: Path) -> None:
    file = tmp_path / f"trace{suffix}"
    with can.Logger(str(file)) as writer:
        for number, word in enumerate((GOAL, TAKEN)):
            frame = parse_word(word)
            assert frame is not None
            at = 1_700_000_000 + number / 2
            writer(can.Message(timestamp=at, arbitration_id=frame.id, is_extended_id=False, data=frame.data))
    ran = run("decode", "--family", "kst", "--file", str(file))
    assert ran.code == 0, ran.err
    assert ("+0.500000 s" in ran.out) == relative
    assert ("2023-11-14T22:13:20" in ran.out) != relative
    assert [
        one["relative"] for one in run("decode", "--family", "kst", "--file", str(file), "--json").records
    ] == [relative] * 2


def test_a_recording_that_is_empty_or_not_there_is_told(run: Run, tmp_path: Path) -> None:
    (tmp_path / "empty.log").write_text("")
    assert run("decode", "--family", "kst", "--file", str(tmp_path / "empty.log")).code == 2
    for name in ("nothing.log", "nothing.asc", "nothing.blf"):
        ran = run("decode", "--family", "kst", "--file", str(tmp_path / name))
        assert (ran.code, ran.out) == (2, "")
        assert f"{name} cannot be read: no such file or directory" in ran.err
    assert run("decode", "--family", "kst", GOAL, "--file", str(tmp_path / "empty.log")).code == 2
    assert run("decode", "--family", "feetech", "--file", str(tmp_path / "empty.log")).code == 2


@pytest.mark.parametrize(
    ("family", "name", "content", "words"),
    [
        ("feetech", "line.txt", b"no bytes at all", "not bytes in hexadecimal"),
        ("feetech", "line.bin", b"", "there are no bytes to decode"),
        (
            "feetech",
            "line.pdf",
            b"\xff",
            "a name that ends in .bin, .raw (bytes) or .hex, .txt (hexadecimal)",
        ),
        ("feetech", "trace.log", LOG.encode(), "feetech devices are on no CAN bus"),
        ("kst", "line.bin", b"\xff", "no log of CAN frames that is known here"),
    ],
)
def test_a_file_that_is_no_recording_of_such_a_bus_ends_with_2(
    family: str, name: str, content: bytes, words: str, run: Run, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    ran = run("decode", "--family", family, "--file", str(tmp_path / name))
    assert (ran.code, ran.out) == (2, "")
    assert words in ran.err


def test_a_damaged_line_is_told_with_its_number_and_the_others_are_explained(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    log = LOG[: LOG.index("\n") - 3] + "\n" + LOG + "(1436509053.0) can0 5A5#60"[:-1]
    (tmp_path / "trace.log").write_text(log)
    words = ("decode", "--family", "kst")
    ran = run(*words, "--file", str(tmp_path / "trace.log"))
    assert ran.code == 1
    assert "line 1: BAD: " in ran.out
    assert "line 4: BAD: " in ran.out
    assert ran.out.count(": good") == 2
    monkeypatch.setattr(sys, "stdin", io.StringIO(log))
    records = run(*words, "--json").records
    assert [(one["start"], one["title"], one["valid"]) for one in (records[0], records[3])] == [
        (0, "line 1", False),
        (3, "line 4", False),
    ]
    assert [one["frame"] for one in records[1:3]] == [GOAL, TAKEN]


def test_summary_counts_packets_by_kind_node_and_code(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "line.bin"
    file.write_bytes(
        bytes.fromhex(READ + READ) + bytes.fromhex(ANSWER) * 20_000 + bytes.fromhex("00" + ANSWER[:-2] + "00")
    )
    ran = run("decode", "--family", "feetech", "--summary", "--file", str(file))
    assert ran.code == 1
    assert ran.out.splitlines() == [
        "20002 packets, 9 of 160025 bytes are noise",
        "kind             node  code  packets   bytes",
        "request             1  0x02        1       8",
        "reply               1  0x00    20000  160000",
        "either              1  0x02        1       8",
        "noise: checksum                    1       8",
        "noise: framing                     1       1",
        "code: the fifth byte: the instruction of a request, the alarm bits of a reply",
    ]
    document = run("decode", "--family", "feetech", "--summary", "--direction", "rx", "--json", READ).document
    assert document["groups"] == [
        {"kind": "reply", "node": 1, "code": 2, "fault": "", "packets": 1, "bytes": 8}
    ]
