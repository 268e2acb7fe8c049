"""Recorded frames are read as they were written: every form of candump, and the files of other programs."""

from __future__ import annotations

import sys
from pathlib import Path

import can
import pytest

from motorbus.core.operation import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError, RequestError
from motorbus.link.can_log import is_log, looks_like_can, parse_line, parse_word, read_lines, read_log

DATA = bytes.fromhex("2203600093FF0000")
FRAMES = [CanFrame(0x625, DATA), CanFrame(0x625, DATA, extended=True), CanFrame(0x5A5, b"")]


@pytest.mark.parametrize(
    ("word", "frame"),
    [
        ("625#2203600093FF0000", FRAMES[0]),
        ("625#22.03.60.00.93.ff.00.00", FRAMES[0]),
        ("00000625#2203600093FF0000", FRAMES[1]),
        ("5A5#", FRAMES[2]),
        ("625#R", CanFrame(0x625 | REMOTE_FLAG, b"")),
        ("00000625#R8", CanFrame(0x625 | REMOTE_FLAG, b"", extended=True)),
        ("20000080#0000000000000000", CanFrame(0x80 | ERROR_FLAG, bytes(8))),
        ("625##1AABB", None),
    ],
)
def test_a_word_is_a_frame(word: str, frame: CanFrame | None) -> None:
    assert parse_word(word) == frame


@pytest.mark.parametrize(
    "word",
    [
        "625",
        "625#220",
        "6255#22",
        "800#22",
        "FFFFFFFF#22",
        "625#000000000000000000",
        "625#R9",
        "625#XY",
        "#22",
    ],
)
def test_what_is_no_frame_says_why(word: str) -> None:
    with pytest.raises(RequestError, match="is no CAN frame"):
        parse_word(word)


@pytest.mark.parametrize(
    ("line", "at", "direction"),
    [
        ("(1436509052.249713) can0 625#2203600093FF0000", 1436509052.249713, ""),
        ("(1436509052.249713) can0 625#2203600093FF0000 R", 1436509052.249713, "rx"),
        ("(0000000000.500000) can0 625#2203600093FF0000 T", 0.5, "tx"),
        ("  can0  625   [8]  22 03 60 00 93 FF 00 00", None, ""),
        (" (1436509052.249713)  can0  TX - -  625   [8]  22 03 60 00 93 FF 00 00", 1436509052.249713, "tx"),
        ("  can0  625   [8]  22 03 60 00 93 FF 00 00   '\".`.....'", None, ""),
        ("625#2203600093FF0000", None, ""),
    ],
)
def test_a_line_of_candump(line: str, at: float | None, direction: str) -> None:
    found = parse_line(line)
    assert found is not None
    assert (found.frame, found.at, found.direction) == (FRAMES[0], at, direction)
    assert found.relative == (at == 0.5)
    assert looks_like_can(line)


def test_a_remote_frame_on_the_screen() -> None:
    found = parse_line("  can0  00000625   [0]  remote request")
    assert found is not None
    assert found.frame == CanFrame(0x625 | REMOTE_FLAG, b"", extended=True)


@pytest.mark.parametrize("line", ["  can0  123  [12]  00 11 22 33 44 55 66 77 88 99 AA BB", "123##1AABB"])
def test_can_fd_is_told_as_such(line: str) -> None:
    found = parse_line(line)
    assert found is not None
    assert found.frame is None
    assert "not classic CAN" in found.fault


def test_lines_without_a_frame_are_passed_over_and_bad_ones_are_numbered() -> None:
    assert [one.frame for one in read_lines(["", "# a comment", "5A5#"])] == [FRAMES[2]]
    with pytest.raises(RequestError, match="line 2: .*is no CAN frame"):
        list(read_lines(["5A5#", "5A5"]))
    with pytest.raises(RequestError, match="8 bytes are announced and 1 stand there"):
        list(read_lines(["can0 625 [8] 22"]))


def test_bytes_in_hexadecimal_are_no_can_text() -> None:
    assert not looks_like_can("FF FF 01 04 02 38 02 BE")
    assert not looks_like_can("")


def written(file: Path, start: float) -> Path:
    """What python-can's own writer makes of the frames."""
    with can.Logger(str(file)) as writer:
        for number, frame in enumerate(FRAMES):
            writer(
                can.Message(
                    timestamp=start + number / 100,
                    arbitration_id=frame.id,
                    is_extended_id=frame.extended,
                    data=frame.data,
                    is_rx=bool(number),
                )
            )
    return file


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".trc"])
def test_the_files_of_python_can_are_read(suffix: str, tmp_path: Path) -> None:
    found = list(read_log(written(tmp_path / f"trace{suffix}", 1_700_000_000.0)))
    assert [one.frame for one in found] == FRAMES
    assert [one.direction for one in found] == ["tx", "rx", "rx"]
    times = [one.at or 0.0 for one in found]
    assert [time - times[0] for time in times] == pytest.approx([0, 0.01, 0.02], abs=1e-4)
    assert {one.relative for one in found} == {suffix == ".asc"}


def test_errors_remotes_and_can_fd_of_a_file_are_told(tmp_path: Path) -> None:
    with can.Logger(str(tmp_path / "trace.blf")) as writer:
        writer(
            can.Message(
                timestamp=1.0, arbitration_id=0x625, is_extended_id=False, is_remote_frame=True, dlc=8
            )
        )
        writer(can.Message(timestamp=1.1, is_error_frame=True, is_extended_id=False))
        writer(
            can.Message(timestamp=1.2, arbitration_id=0x625, is_extended_id=False, is_fd=True, data=bytes(12))
        )
    remote, error, fast = read_log(tmp_path / "trace.blf")
    assert remote.frame == CanFrame(0x625 | REMOTE_FLAG, b"")
    assert error.frame is not None
    assert error.frame.id & ERROR_FLAG
    assert fast.frame is None


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="no log of CAN frames"):
        list(read_log(tmp_path / "trace.pcapng"))


def test_a_file_that_is_not_there_is_told_by_the_system(tmp_path: Path) -> None:
    for name in ("trace.log", "trace.blf"):
        with pytest.raises(FileNotFoundError):
            list(read_log(tmp_path / name))


def test_a_file_that_only_has_the_name_is_refused(tmp_path: Path) -> None:
    (tmp_path / "trace.blf").write_bytes(b"not what it says")
    with pytest.raises(RequestError, match="cannot be read"):
        list(read_log(tmp_path / "trace.blf"))


def test_without_python_can_the_line_that_installs_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "can", None)
    with pytest.raises(LinkError, match=r'pip install "motorbus\[can\]"'):
        list(read_log(tmp_path / "trace.asc"))
    (tmp_path / "trace.log").write_text("(1.0) can0 5A5#\n")
    assert len(list(read_log(tmp_path / "trace.log"))) == 1


@pytest.mark.parametrize(
    ("name", "only"),
    [("a.log", True), ("a.ASC", True), ("a.blf", True), ("a.trc", True), ("a.candump", True), ("a.txt", False),
     ("a", False), ("a.bin", False)],
)  # fmt: skip
def test_a_name_may_say_that_it_can_be_nothing_else(name: str, only: bool, tmp_path: Path) -> None:
    assert is_log(tmp_path / name) == only
