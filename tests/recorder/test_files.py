"""Recordings of serial lines on disk: bytes, or bytes in hexadecimal."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.errors import RequestError
from motorbus.recorder.files import RAW, TEXT, from_hex, read_bytes

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
    assert from_hex(text) == b"\xff\x0a"


def test_nothing_is_nothing() -> None:
    assert from_hex(" \n") == b""


@pytest.mark.parametrize("text", ["f", "fg", "FF 0", "(1.0) can0 625#00"])
def test_what_is_not_hexadecimal_is_refused(text: str) -> None:
    with pytest.raises(RequestError, match="not bytes in hexadecimal") as refused:
        from_hex(text)
    assert refused.value.sent == text


@pytest.mark.parametrize("name", ["line", "line.asc", "bin"])
def test_another_ending_is_refused_before_it_is_read(name: str, tmp_path: Path) -> None:
    with pytest.raises(RequestError, match=r"\.bin, \.raw \(bytes\)"):
        read_bytes(tmp_path / name)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_bytes(tmp_path / "line.bin")


@pytest.mark.parametrize("suffix", TEXT)
def test_a_byte_order_mark_is_none_of_the_bytes(suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"line{suffix}").write_text("FF 0A", encoding="utf-8-sig")
    assert read_bytes(tmp_path / f"line{suffix}") == b"\xff\x0a"
    with pytest.raises(RequestError):
        from_hex("FF \ufeff0A")
