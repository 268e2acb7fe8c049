"""Every word of the issue is there, says what it does, and has something to do somewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from motorbus.simulation.faults import WORDS

ALL = """drop corrupt flip insert duplicate delay reorder echo split merge stall unplug power-cycle duplicate-id
    brown-out torn-eeprom clock-step truncate"""


def test_every_word_is_there() -> None:
    assert set(WORDS) == set(ALL.split())


@pytest.mark.parametrize("name", WORDS)
def test_a_word_says_what_it_does(name: str) -> None:
    word = WORDS[name]
    assert word.name == name
    assert word.packet
    assert not word.packet.endswith(".")
    assert (word.byte == "") == (name in ("merge", "echo"))


def test_what_belongs_to_what_the_host_sends() -> None:
    outward = {name for name, word in WORDS.items() if word.outward}
    assert outward == {name for name, word in WORDS.items() if word.world} | {"echo"}


@pytest.mark.parametrize("name", WORDS)
def test_the_page_says_the_same(name: str) -> None:
    page = (Path(__file__).resolve().parents[3] / "docs" / "reference" / "faults.md").read_text(
        encoding="utf-8"
    )
    word = WORDS[name]
    takes, byte = word.takes.value or "nothing", word.byte or "(not)"
    assert f"| `{name}` | {takes} | {byte} | {word.packet} |\n" in page
