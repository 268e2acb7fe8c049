"""Recorded frames are read as they were written: every form of candump, and the files of other programs."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import can
import pytest

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError, RequestError
from motorbus.recorder.can_log import (
    LONGEST,
    is_log,
    lines_of,
    looks_like_can,
    parse_line,
    parse_word,
    read_lines,
    read_log,
)

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


def test_lines_without_a_frame_are_passed_over_and_bad_ones_are_told_in_their_place() -> None:
    assert [one.frame for one in read_lines(["", "# a comment", "5A5#"])] == [FRAMES[2]]
    good, bad, short, last = read_lines(["5A5#", "5A5", "", "can0 625 [8] 22", "5A5#"])
    assert [(one.frame, one.fault, one.line) for one in (good, last)] == [(FRAMES[2], "", 0)] * 2
    assert (bad.frame, bad.line, bad.text) == (None, 2, "5A5")
    assert "is no CAN frame" in bad.fault
    assert (short.frame, short.line) == (None, 4)
    assert "8 bytes are announced and 1 stand there" in short.fault


@pytest.mark.parametrize(
    "line",
    [
        "(1.0) can0 5A5#600360000000",
        "(99999999999999) can0 5A5#",
        "(1.2.3) can0 5A5 [0]",
        f"can0 5A5 [{'9' * 5000}] 00",
        "(" + "9" * 400 + ") can0 5A5#",
        "\0" * 4096,
        "\ufffd\x1b[31m",
    ],
    ids=range(7),
)
def test_no_line_stops_what_comes_behind_it(line: str) -> None:
    *told, last = read_lines([line, "5A5#"])
    assert last.frame == FRAMES[2]
    assert len(told) == 1
    assert told[0].line == (0 if "#6003" in line else 1)
    assert told[0].fault.isprintable()


def test_what_has_no_lines_is_refused_and_not_read_to_its_end(tmp_path: Path) -> None:
    class Endless(io.TextIOBase):
        """Zeros for ever, as of a device."""

        taken = 0

        def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]
            assert size is not None
            assert 0 < size <= LONGEST, "all of it was asked for"
            self.taken += size
            return "\0" * size

    endless = Endless()
    with pytest.raises(RequestError, match=f"line 1 is longer than {LONGEST} characters"):
        list(read_lines(lines_of(endless)))  # type: ignore[arg-type]
    assert endless.taken == LONGEST
    for name in ("trace", "trace.log", "trace.asc", "trace.trc"):
        (tmp_path / name).write_bytes(b"\n" + b"\0" * 3 * LONGEST)
        with pytest.raises(RequestError, match="line 2 is longer"):
            list(read_log(tmp_path / name))


def test_a_byte_order_mark_is_no_part_of_a_log(tmp_path: Path) -> None:
    for name in ("trace.txt", "trace.log"):
        (tmp_path / name).write_text("5A5#\n", encoding="utf-8-sig")
        assert [one.frame for one in read_log(tmp_path / name)] == [FRAMES[2]]


ASC = """date Mon Jan 1 00:00:00.000 2024
base hex  timestamps absolute
internal events logged
   0.001000 1  625             Rx   d 8 22 03 60 00 93 FF 00 00
   0.002000 1  625             Rx   d 8 22 XX 60 00 93 FF 00 00
   0.003000 1  625             Rx   d 8 22 03
   0.004000 1  5A5             Rx   d x
   0.005000 1  5A5             Rx   d 0
   0.006000 1  625             Rx   d 8 22 0"""
TRC = """;$FILEVERSION=1.1
;$STARTTIME=45000.5
     1)         1.0  Rx         0625  8  22 03 60 00 93 FF 00 00
     2)         2.0  Rx         0625  8  22 XX 60 00 93 FF 00 00
     3)         3.0  Rx         05A5  0
     4)         4.0  Rx         05A5  Q"""


def test_python_can_reads_on_behind_a_damaged_line(tmp_path: Path) -> None:
    (tmp_path / "trace.asc").write_text(ASC)
    found = list(read_log(tmp_path / "trace.asc"))
    assert [one.frame for one in found] == [FRAMES[0], None, None, None, FRAMES[2], None]
    assert [one.line for one in found] == [0, 5, 6, 7, 0, 9]
    assert [one.at for one in found if not one.line] == [0.001, 0.005]
    assert [bool(one.fault) for one in found] == [bool(one.line) for one in found]
    (tmp_path / "trace.trc").write_text(TRC)
    found = list(read_log(tmp_path / "trace.trc"))
    assert [one.frame for one in found] == [FRAMES[0], None, FRAMES[2], None]
    assert [one.line for one in found] == [0, 4, 0, 6]
    assert [one.at for one in found if not one.line] == pytest.approx([1678881600.001, 1678881600.003])


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize(
    "line",
    [
        "   0.002000 1  625             R~   d 8 22 03 60 00 93 FF 00 00",
        "   0.002000 1  6~5             Rx   d 8 22 03 60 00 93 FF 00 00",
        "   0.0020?0 1  625             Rx   d 8 22 03 60 00 93 FF 00 00",
        "   0.002000 1  625             R",
        "   0.002000 1  62",
        "   0.002000 1",
        "   0.002000",
    ],
)
def test_what_python_can_passes_over_in_asc_and_looks_like_a_frame_is_told(
    line: str, place: int, tmp_path: Path
) -> None:
    *head, frame = ASC.splitlines()[:4]
    rows = [frame, frame]
    rows.insert(place, line)
    (tmp_path / "trace.asc").write_text("\n".join([*head, *rows]))
    found = list(read_log(tmp_path / "trace.asc"))
    assert [one.line for one in found] == [4 + place if at == place else 0 for at in range(3)]
    assert [one.frame for one in found if not one.line] == [FRAMES[0]] * 2


@pytest.mark.parametrize(
    "line",
    [
        "     2)         2.0  R~  0625  8  22 03",
        "     2)         2.0  R~  0625  3  22 EC 02",
        "     2)         2.0  1  R~  0625  -  2  ER 03",
        "     2)   2.0",
        "     2)",
    ],
)
def test_what_python_can_passes_over_in_trc_and_looks_like_a_frame_is_told(line: str, tmp_path: Path) -> None:
    *head, frame = TRC.splitlines()[:3]
    (tmp_path / "trace.trc").write_text("\n".join([*head, frame, line, frame]))
    assert [one.line for one in read_log(tmp_path / "trace.trc")] == [0, 4, 0]


def test_in_a_trc_without_numbers_a_line_begins_with_its_time(tmp_path: Path) -> None:
    head = (
        ";$FILEVERSION=2.1",
        ";$STARTTIME=43008.920986006946",
        ";$COLUMNS=O,T,I,d,L,D",
    )
    frame = "      1.000 DT     0625 Rx 2  22 03"
    damaged = ("      2.000 DZ     0625 Rx 2  22 03", "      3.000 DT     0625 R", "      4.000")
    (tmp_path / "trace.trc").write_text("\n".join([*head, frame, *damaged, "      5.000 EC", frame]))
    assert [one.line for one in read_log(tmp_path / "trace.trc")] == [0, 5, 6, 7, 0]


def test_lines_about_other_things_are_not_told(tmp_path: Path) -> None:
    about = (
        "// a comment",
        "   0.000000 Start of measurement",
        "   0.015991 CAN 1 Status:chip status error active",
        "   1.003000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%",
        "   0.016000 1  3FEE26x J1939TP FEE3p 6 0 0 - Rx d 2 0A FF",
        "   0.017000 L1 23              Rx     3 4A 01 02",
        "End TriggerBlock",
    )
    (tmp_path / "trace.asc").write_text("\n".join([*ASC.splitlines()[:4], *about]))
    assert [one.frame for one in read_log(tmp_path / "trace.asc")] == [FRAMES[0]]
    status = (
        "     2)         2.0  Warng      FFFFFFFF  4  00 00 00 08 BUSHEAVY",
        "     3)         3.0  1  Error  0123  4  00 00 00 08",
        "     4          4.0  ST 1      -    Rx -  4    00 00 00 00",
        "     5          5.0  EV",
        ";   a comment",
    )
    (tmp_path / "trace.trc").write_text("\n".join([*TRC.splitlines()[:3], *status]))
    assert [one.frame for one in read_log(tmp_path / "trace.trc")] == [FRAMES[0]]


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
    with pytest.raises(RequestError, match="no log of CAN frames") as caught:
        list(read_log(tmp_path / "trace.pcapng"))
    for suffix in (".log", ".txt", ".candump", ".asc", ".blf", ".trc"):
        assert suffix in caught.value.expected


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
