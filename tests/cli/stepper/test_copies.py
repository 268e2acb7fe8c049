"""All that is stored, as a file and back."""

from __future__ import annotations

from pathlib import Path

import pytest

import motorbus
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE, Line, line_of


@pytest.fixture
def kept(run: Run, line: Line, tmp_path: Path) -> Path:
    """A backup of a controller with two projects."""
    path = tmp_path / "controller.toml"
    assert run("stepper", "write", EXAMPLE, line.url, "--yes").code == 0
    line.heard.clear()
    assert run("stepper", "backup", line.url, str(path)).code == 0
    return path


def test_a_backup_only_reads(kept: Path, line: Line) -> None:
    assert set(line.commands()) == {"read_project"}
    assert "made = " in kept.read_text(encoding="utf-8")
    assert "version = " in kept.read_text(encoding="utf-8")


def test_a_backup_replaces_no_file_unasked(run: Run, line: Line, kept: Path) -> None:
    before = kept.read_bytes()
    ran = run("stepper", "backup", line.url, str(kept), "--projects", "1")
    assert (ran.code, kept.read_bytes()) == (8, before)
    assert run("stepper", "backup", line.url, str(kept), "--projects", "1", "--yes", "--json").document[
        "projects"
    ] == {"1": True}


def test_another_controller_gets_the_same(
    run: Run, line: Line, kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with motorbus.simulate("stepper", shipped="empty") as simulation:
        other = line_of(simulation, monkeypatch)
        assert run("stepper", "restore", str(kept), other.url).code == 8
        assert other.orders() == []
        told = run("stepper", "restore", str(kept), other.url, "--yes", "--json").document["projects"]
        assert [(one["project"], one["saved"]) for one in told] == [
            (1, True),
            (2, True),
            (3, False),
            (4, False),
        ]
        other.simulation[1].power_cycle()
        images = [other.simulation[1].store.stored, line.simulation[1].store.stored]
        assert images[0] == images[1]


def test_nothing_is_asked_where_nothing_differs(run: Run, line: Line, kept: Path) -> None:
    line.heard.clear()
    ran = run("stepper", "restore", str(kept), line.url)
    assert ran.code == 0
    assert ran.out.count("nothing differs") == 4
    assert line.orders() == []


def test_what_was_cleared_is_cleared_again(run: Run, line: Line, tmp_path: Path) -> None:
    path = tmp_path / "before.toml"
    run("stepper", "backup", line.url, str(path))
    run("stepper", "write", EXAMPLE, line.url, "--yes")
    ran = run("stepper", "restore", str(path), line.url, "--dry-run", "--json")
    assert [one["data"][6:11] for one in ran.document["withheld"]] == ["1E 02"]
    assert run("stepper", "restore", str(path), line.url, "--projects", "2", "--yes").code == 0
    assert "cleared" in run("stepper", "read-project", line.url, "--project", "2").out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("restore not-there.toml BUS", "not-there.toml"),
        ("restore EXAMPLE BUS", "this backup cannot be used"),
        ("restore KEPT BUS --projects 5", "there is no project 5"),
        ("restore KEPT feetech:sim", "is no stepper bus"),
        ("restore TORN BUS", "does not fit its dump"),
        ("restore NOISE BUS", "is no text"),
        ("backup BUS FILE --projects 0", "there is no project 0"),
        ("backup BUS", "FILE"),
    ],
)
def test_bad_input_sends_nothing(
    words: str, told: str, run: Run, line: Line, kept: Path, tmp_path: Path
) -> None:
    torn, noise = tmp_path / "torn.toml", tmp_path / "noise.toml"
    torn.write_text(kept.read_text(encoding="utf-8").replace("E8 03", "E8 04", 1), encoding="utf-8")
    noise.write_bytes(b"\xff\xfe")
    for word, text in (("EXAMPLE", EXAMPLE), ("KEPT", str(kept)), ("TORN", str(torn)), ("NOISE", str(noise))):
        words = words.replace(word, text)
    line.heard.clear()
    ran = run(
        "stepper", *words.replace("BUS", line.url).replace("FILE", str(tmp_path / "new")).split(), "--yes"
    )
    assert (ran.code, ran.out) == (2, "")
    assert told in ran.err
    assert line.heard == []
