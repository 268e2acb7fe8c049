"""CAN logs: candump text, and the files that python-can writes."""

from __future__ import annotations

import sys
from pathlib import Path

import can
import pytest

from motorbus.core.can_frame import ERROR_FLAG, REMOTE_FLAG, CanFrame
from motorbus.errors import LinkError, RequestError
from motorbus.recorder.can_log import parse_line, read_lines, read_log

DATA = bytes.fromhex("2203600093FF0000")
FRAMES = [CanFrame(0x625, DATA), CanFrame(0x625, DATA, extended=True), CanFrame(0x5A5, b"")]
REMOTE = CanFrame(0x625 | REMOTE_FLAG, b"")
AT = 1436509052.249713


@pytest.mark.parametrize(
    ("line", "frame", "at", "direction"),
    [
        ("625#2203600093FF0000", FRAMES[0], None, ""),
        ("625#22.03.60.00.93.ff.00.00", FRAMES[0], None, ""),
        ("00000625#2203600093FF0000", FRAMES[1], None, ""),
        ("5A5#", FRAMES[2], None, ""),
        ("625#R", REMOTE, None, ""),
        ("00000625#R8", REMOTE._replace(extended=True), None, ""),
        ("20000080#0000000000000000", CanFrame(0x80 | ERROR_FLAG, bytes(8)), None, ""),
        ("(1436509052.249713) can0 625#2203600093FF0000", FRAMES[0], AT, ""),
        ("(1436509052.249713) can0 625#2203600093FF0000 R", FRAMES[0], AT, "rx"),
        ("(0000000000.500000) can0 625#2203600093FF0000 T", FRAMES[0], 0.5, "tx"),
        ("  can0  625   [8]  22 03 60 00 93 FF 00 00", FRAMES[0], None, ""),
        (" (1436509052.249713)  can0  TX - -  625   [8]  22 03 60 00 93 FF 00 00", FRAMES[0], AT, "tx"),
        ("  can0  625   [8]  22 03 60 00 93 FF 00 00   '\".`.....'", FRAMES[0], None, ""),
        ("  can0  00000625   [0]  remote request", REMOTE._replace(extended=True), None, ""),
    ],
)
def test_line_of_candump_is_parsed(line: str, frame: CanFrame, at: float | None, direction: str) -> None:
    found = parse_line(line)
    assert found is not None
    assert (found.frame, found.at, found.direction) == (frame, at, direction)


@pytest.mark.parametrize(
    "line",
    [
        "625",
        "625#220",
        "6255#22",
        "800#22",
        "FFFFFFFF#22",
        "625#000000000000000000",
        "625#R9",
        "625#XY",
        "625##1AABB",
        "can0 625 [8] 22",
        "can0  5A5  [08]  60 03 60 00 00 00 00 00",
        "  can0  123  [12]  00 11 22 33 44 55 66 77 88 99 AA BB",
        "(99999999999999) can0 5A5#",
        "(1.2.3) can0 5A5 [0]",
        f"can0 5A5 [{'9' * 5000}] 00",
        "\0" * 4096,
        "\ufffd\x1b[31m",
    ],
    ids=range(17),
)
def test_damaged_line_is_named_and_the_next_one_is_read(line: str) -> None:
    bad, last = read_lines([line, "", "# a comment", "5A5#"])
    assert (bad.frame, bad.line, last.frame, last.line) == (None, 1, FRAMES[2], 0)
    assert "is not a CAN frame" in bad.fault
    assert bad.fault.isprintable()


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".trc"])
def test_file_that_python_can_writes_is_read(suffix: str, tmp_path: Path) -> None:
    with can.Logger(str(tmp_path / f"trace{suffix}")) as writer:
        for number, frame in enumerate(FRAMES):
            writer(
                can.Message(
                    timestamp=1_700_000_000.0 + number / 100,
                    arbitration_id=frame.id,
                    is_extended_id=frame.extended,
                    data=frame.data,
                    is_rx=bool(number),
                )
            )
    found = list(read_log(tmp_path / f"trace{suffix}"))
    assert [one.frame for one in found] == FRAMES
    assert [one.direction for one in found] == ["tx", "rx", "rx"]
    times = [one.at or 0.0 for one in found]
    assert [time - times[0] for time in times] == pytest.approx([0, 0.01, 0.02], abs=1e-4)


def test_remote_error_and_can_fd_frames_of_a_file(tmp_path: Path) -> None:
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
    assert remote.frame == REMOTE
    assert error.frame is not None
    assert error.frame.id & ERROR_FLAG
    assert (fast.frame, fast.fault[:8]) == (None, "a CAN FD")


ASC = """date Mon Jan 1 00:00:00.000 2024
base hex  timestamps absolute
internal events logged
   0.001000 1  625             Rx   d 8 22 03 60 00 93 FF 00 00
// a comment
   0.000000 CANFD   Start of measurement
   0.015991 CAN 1 Status:chip status error active
   0.016000 1  3FEE26x J1939TP FEE3p 6 0 0 - Rx d 2 0A FF
"""
TRC = """;$FILEVERSION=1.1
;$STARTTIME=45000.5
     1)         1.0  Rx         0625  8  22 03 60 00 93 FF 00 00
     2)         2.0  Warng      FFFFFFFF  4  00 00 00 08 BUSHEAVY
"""


@pytest.mark.parametrize(
    ("name", "text", "line", "number"),
    [
        ("trace.asc", ASC, "   0.002000 1  625             Rx   d 8 22 XX 60 00 93 FF 00 00", 9),
        ("trace.asc", ASC, "   0.003000 1  625             Rx   d 8 22 03", 9),
        ("trace.asc", ASC, "   0.004000 1  5A5             Rx   d x", 9),
        ("trace.trc", TRC, "     3)         3.0  Rx         0625  8  22 XX 60 00 93 FF 00 00", 5),
    ],
)
def test_damaged_line_of_asc_and_trc_is_named(
    name: str, text: str, line: str, number: int, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8-sig")
    assert [one.frame for one in read_log(tmp_path / name)] == [FRAMES[0]]
    (tmp_path / name).write_text(text + line)
    frames = read_log(tmp_path / name)
    assert next(frames).frame == FRAMES[0]
    with pytest.raises(RequestError, match=f"line {number} of .* cannot be read"):
        next(frames)


def test_file_that_cannot_be_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RequestError, match="not a log of CAN frames") as caught:
        list(read_log(tmp_path / "trace.pcapng"))
    assert ".log, .txt, .candump, .asc, .blf, .trc" in caught.value.expected
    for name in ("trace.log", "trace.blf"):
        with pytest.raises(FileNotFoundError):
            list(read_log(tmp_path / name))
    (tmp_path / "trace.blf").write_bytes(b"not what it says")
    with pytest.raises(RequestError, match="cannot be read"):
        list(read_log(tmp_path / "trace.blf"))
    monkeypatch.setitem(sys.modules, "can", None)
    with pytest.raises(LinkError, match=r'pip install "motorbus\[can\]"'):
        list(read_log(tmp_path / "trace.asc"))
    (tmp_path / "trace.log").write_text("(1.0) can0 5A5#\n", encoding="utf-8-sig")
    assert [one.frame for one in read_log(tmp_path / "trace.log")] == [FRAMES[2]]
