"""Switches of a simulator are given as text or values, have limits, and are listed as options."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from motorbus.core.family import Option
from motorbus.core.switches import options, switch, switched
from motorbus.errors import RequestError


@dataclass(frozen=True, kw_only=True)
class Doubts:
    """Of an imagined device."""

    reply: str = switch("new", "which id answers", "new", "old", source="not documented")
    keeps: bool = switch(True, "keeps what it was told", source="manual, 3")
    rate: int = switch(500, "the rate", 250, 500, source="manual, 1")
    byte: int = switch(0, "a byte", source="an assumption", span=(0, 255))
    wait: float = switch(0.1, "seconds", source="an assumption")
    name: str = switch("", "any text", source="an assumption")
    echo: str = switch("no", "what comes back", "no", "yes", "half", source="an assumption")


def test_text_and_values_mean_the_same() -> None:
    text = switched(
        Doubts,
        "any",
        {"reply": "old", "keeps": "no", "rate": "250", "byte": "0x10", "wait": "1", "name": "x"},
    )
    assert text == Doubts(reply="old", keeps=False, rate=250, byte=16, wait=1.0, name="x")
    assert switched(Doubts, "any", {}) == Doubts()


@pytest.mark.parametrize(
    ("name", "value", "says", "expected"),
    [
        ("replay", "new", "a simulated any bus has no option 'replay'", "perhaps reply"),
        ("reply", "both", "'both' is not possible", "one of new, old"),
        ("keeps", "maybe", "neither yes nor no", "yes or no"),
        ("rate", "300", "'300' is not possible", "one of 250, 500"),
        ("byte", "256", "'256' is not possible", "a whole number, 0 to 255"),
        ("wait", "nan", "'nan' is not possible", "a number, 0 or more"),
    ],
)
def test_what_is_impossible_is_refused_by_name(name: str, value: str, says: str, expected: str) -> None:
    with pytest.raises(RequestError) as caught:
        switched(Doubts, "any", {name: value})
    assert says in caught.value.summary
    assert expected in caught.value.expected


def test_every_switch_is_an_option_with_its_choices_and_its_source() -> None:
    found = options(Doubts)
    assert found[0] == Option("reply", str, "new", "which id answers", ("new", "old"), "not documented")
    assert [option.choices for option in found] == [
        ("new", "old"),
        (),
        (250, 500),
        (),
        (),
        (),
        ("no", "yes", "half"),
    ]
    assert all(option.source for option in found)
    assert [option.kind for option in found] == [str, bool, int, int, float, str, str]
