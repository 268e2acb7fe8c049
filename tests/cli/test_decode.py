"""Bytes explained: each of them, from the shell or from a pipe, and why bad ones are bad."""

from __future__ import annotations

import io
import sys

import pytest

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
