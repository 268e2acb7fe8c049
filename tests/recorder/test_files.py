"""Recordings of serial lines on disk: bytes, or bytes in hexadecimal."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.errors import RequestError
from motorbus.recorder.files import RAW, TEXT, from_text, read_bytes

LINE = bytes(range(256))


@pytest.mark.parametrize("suffix", [*RAW, *TEXT, ".BIN", ".Hex"])
def test_what_was_kept_is_read(suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"line{suffix}"
    if suffix.lower() in RAW:
        file.write_bytes(LINE)
    else:
        file.write_text(LINE.hex(" ", 8) + "\n")
    assert read_bytes(file) == LINE


@pytest.mark.parametrize("text", ["ff0A", "FF 0a", "0xFF,0X0a", "ff:0a", "FF\n\t0A;"])
def test_hexadecimal_is_written_in_many_ways(text: str) -> None:
    assert from_text(text) == b"\xff\x0a"


def test_nothing_is_nothing() -> None:
    assert from_text(" \n") == b""


@pytest.mark.parametrize("text", ["f", "fg", "FF 0", "FF F F", "0xF", "[1, 256]", "(1.0) can0 625#00"])
def test_other_text_is_refused_with_its_line(text: str) -> None:
    with pytest.raises(RequestError, match="line 2: .* is not bytes") as refused:
        from_text(f"FF\n{text}")
    assert refused.value.sent == text


DUMPED = b"\xff\xff\x01\x04\x028\x02\xbeABC   D|" + bytes(range(60, 71))


ESCAPED = "".join(f"\\x{byte:02x}" for byte in DUMPED)


def _ascii(data: bytes) -> str:
    return "".join(chr(byte) if 32 <= byte < 127 else "." for byte in data)


def _dump(form: str) -> str:
    lines = []
    for start in range(0, len(DUMPED), 16):
        row = DUMPED[start : start + 16]
        halves = f"{row[:8].hex(' ')}  {row[8:].hex(' ')}"
        lines.append(
            {
                "xxd": f"{start:08x}: {row.hex(' ', -2):<39}  {_ascii(row)}",
                "hexdump": f"{start:08x}  {halves:<48}  |{_ascii(row)}|",
                "offsets": f"{start:04x}   {halves:<48}   {_ascii(row)}",
            }[form]
        )
    return "\n".join([*lines, *([f"{len(DUMPED):08x}"] if form == "hexdump" else [])])


@pytest.mark.parametrize(
    "text",
    [
        _dump("xxd"),
        _dump("hexdump"),
        _dump("offsets"),
        ESCAPED,
        f"b'{ESCAPED}'",
        "const uint8_t frame[29] = {  // 3 bytes\n" + ", ".join(f"0x{byte:02X}" for byte in DUMPED) + " };",
        str(list(DUMPED)),
        f"12:30:01.123 {DUMPED.hex(' ')}",
        f"(1690000000.123456) {DUMPED.hex(' ')}",
    ],
    ids=["xxd", "hexdump", "offsets", "escapes", "literal", "array", "list", "clock", "seconds"],
)
def test_bytes_as_programs_show_them(text: str) -> None:
    assert from_text(text) == DUMPED


def test_other_endings_and_absent_files_are_refused(tmp_path: Path) -> None:
    for name in ("line", "line.asc", "bin"):
        with pytest.raises(RequestError, match=r"\.bin, \.raw \(bytes\)"):
            read_bytes(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        read_bytes(tmp_path / "line.bin")


def test_a_byte_order_mark_is_none_of_the_bytes(tmp_path: Path) -> None:
    (tmp_path / "line.txt").write_text("FF 0A", encoding="utf-8-sig")
    assert read_bytes(tmp_path / "line.txt") == b"\xff\x0a"
    with pytest.raises(RequestError):
        from_text("FF \ufeff0A")
