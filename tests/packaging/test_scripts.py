"""What the Makefile's scripts promise: a Python that is missing is NOT RUN, one that fails fails, peers stay apart."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

import pytest

from scripts import interpreters, peers

THIS = (sys.version_info[0], sys.version_info[1])
OTHER = next(version for version in interpreters.WANTED if version != THIS)


def program(file: Path, text: str) -> str:
    """An executable file, as a version manager's shim is one."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    file.chmod(file.stat().st_mode | stat.S_IXUSR)
    return str(file)


def test_an_interpreter_is_believed_when_it_has_run() -> None:
    assert interpreters.runs(sys.executable, THIS)


def test_an_interpreter_of_another_version_is_not_taken() -> None:
    assert not interpreters.runs(sys.executable, OTHER)


@pytest.mark.parametrize("text", ["exit 127", "echo pypy 3 12 /x", "true"])
def test_a_shim_that_leads_nowhere_is_not_taken(text: str, tmp_path: Path) -> None:
    assert not interpreters.runs(program(tmp_path / "python3.12", text), (3, 12))


def test_a_file_that_is_not_there_is_not_taken(tmp_path: Path) -> None:
    assert not interpreters.runs(str(tmp_path / "python3.12"), (3, 12))


def test_folders_of_version_managers_are_searched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    found = [
        program(tmp_path / ".pyenv/versions/3.12.1/bin/python3.12", "true"),
        program(tmp_path / ".local/share/uv/python/cpython-3.12/bin/python3.12", "true"),
    ]
    assert set(found) <= set(interpreters.candidates((3, 12)))


def only(version: tuple[int, int], path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """This machine has `path` for `version`, and nothing else is wanted."""
    monkeypatch.setattr(interpreters, "WANTED", (THIS, version))
    monkeypatch.setattr(interpreters, "candidates", lambda _: iter([path]))


def test_a_missing_interpreter_is_reported_as_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    only(OTHER, str(tmp_path / "nothing"), monkeypatch)
    assert interpreters.main() == 0
    printed = capsys.readouterr().out
    assert f"NOT RUN: {OTHER[0]}.{OTHER[1]}" in printed
    assert "passed" not in printed


def test_an_interpreter_that_fails_makes_the_check_fail(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = program(tmp_path / "bin" / "python", "echo 3 failed; exit 1")
    only(OTHER, broken, monkeypatch)
    monkeypatch.setattr(interpreters, "runs", lambda *_: True)
    monkeypatch.setattr(interpreters, "environment", lambda *_: Path(broken))
    assert interpreters.main() == 1
    assert "FAILED: 3 failed" in capsys.readouterr().out


def test_each_peer_keeps_its_own_hashes() -> None:
    found = peers.requirements(
        "a==1 \\\n    --hash=sha256:1 \\\n    --hash=sha256:2\nb==2 \\\n    --hash=sha256:3\n"
    )
    assert found == {
        "a": "a==1 \\\n    --hash=sha256:1 \\\n    --hash=sha256:2\n",
        "b": "b==2 \\\n    --hash=sha256:3\n",
    }


def test_the_peers_are_those_that_were_asked_for() -> None:
    locked = peers.requirements((peers.ROOT / "peers.txt").read_text(encoding="utf-8"))
    wanted = (peers.ROOT / "peers.in").read_text(encoding="utf-8").split()
    assert sorted(lines.split()[0] for lines in locked.values()) == sorted(wanted)
