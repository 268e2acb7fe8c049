"""What is wrong with a file is said with its name, and an error of the bus is not taken for one of a file."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from motorbus.cli.files import check_writable, replaced, usable
from motorbus.errors import LinkLost, RequestError


def test_a_file_that_is_good_is_used(tmp_path: Path) -> None:
    with usable(tmp_path / "a", "written"):
        (tmp_path / "a").write_text("x")
    assert (tmp_path / "a").read_text() == "x"


def test_what_is_wrong_is_said_with_the_name(tmp_path: Path) -> None:
    missing = tmp_path / "none" / "a"
    with (
        pytest.raises(RequestError, match="a cannot be written: no such file or directory"),
        usable(missing, "written"),
    ):
        missing.write_text("x")
    with pytest.raises(RequestError, match="cannot be read: is a directory"), usable(tmp_path, "read"):
        tmp_path.read_text()


def test_a_lost_port_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(LinkLost), usable(tmp_path, "read"):
        raise LinkLost("gone")


def test_another_text_is_there_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, link = tmp_path / "a", tmp_path / "link"
    file.write_text("old")
    file.chmod(0o640)
    link.symlink_to(file)
    replaced(link, "new\r\n")
    assert file.read_bytes() == b"new\r\n"
    assert link.is_symlink()
    assert stat.S_IMODE(file.stat().st_mode) == 0o640

    def cut_off(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", cut_off)
    with pytest.raises(RequestError, match="link cannot be written: no space left on device"):
        replaced(link, "third")
    assert file.read_bytes() == b"new\r\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "link"]


def test_a_file_is_judged_before_anything_is_begun(tmp_path: Path) -> None:
    check_writable(tmp_path / "a.PNG", (".png", ".svg"))
    (tmp_path / "there.csv").write_text("x")
    check_writable(tmp_path / "there.csv")
    for file, why in (
        (tmp_path, "it is a folder"),
        (tmp_path / "none" / "a", "its folder is not there"),
    ):
        with pytest.raises(RequestError, match=f"cannot be written: {why}"):
            check_writable(file)
    with pytest.raises(RequestError, match=r"what kind of file") as refused:
        check_writable(tmp_path / "a.txt", (".png", ".svg"))
    assert refused.value.expected == "a name that ends in .png, .svg"
