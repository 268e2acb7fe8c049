"""What `--help` shows fits a terminal of 80 columns, as it stands in the file: no line is broken by the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

import pytest
from cyclopts import App

from motorbus.cli import _COMMANDS, build, faces
from tests.cli.conftest import Run

WIDTH = 79
BOX = "\N{BOX DRAWINGS LIGHT VERTICAL}\N{BOX DRAWINGS LIGHT ARC DOWN AND RIGHT}\N{BOX DRAWINGS LIGHT ARC UP AND RIGHT}"


def commands() -> Iterator[tuple[str, ...]]:
    yield ()
    for group in _COMMANDS.values():
        yield from ((name,) for name in group)
    for family in faces.names():
        yield (family,)
        yield from ((family, name) for name in app_of((family,)) if not name.startswith("-"))


def app_of(words: tuple[str, ...]) -> App:
    if not words:
        return build()
    app: App = import_module(f"motorbus.cli.{words[0].replace('-', '_')}").app
    return app[words[1]] if words[1:] else app


@pytest.mark.parametrize("words", list(commands()), ids=" ".join)
def test_the_help_of_every_command_fits_80_columns(
    words: tuple[str, ...], run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    ran = run(*words, "--help")
    assert ran.code == 0
    shown = ran.out.splitlines()
    assert not [line for line in shown if len(line.rstrip()) > WIDTH + line.startswith(tuple(BOX))]
    said = [line for line in str(app_of(words).help_epilogue or "").splitlines() if line.strip()]
    assert [line for line in said if line not in map(str.rstrip, shown)] == []
