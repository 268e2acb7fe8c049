"""What verbs return, as plain data."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import Enum
from math import inf, nan
from typing import NamedTuple

from motorbus.cli.plain import plain


class Colour(Enum):
    """As promises are."""

    RED = "a long sentence"


class Pair(NamedTuple):
    """As results are."""

    name: str
    value: object


@dataclass
class Box:
    """As identities are."""

    inside: object


def test_everything_becomes_plain() -> None:
    value = Pair("x", Box({1: [Colour.RED, b"\x01\xff", None, True], "y": (1.5, nan, inf)}))
    found = {"name": "x", "value": {"inside": {"1": ["red", "01 FF", None, True], "y": [1.5, None, None]}}}
    assert plain(value) == found
    assert json.loads(json.dumps(plain(value), allow_nan=False)) == found


def test_what_is_unknown_is_told_as_text() -> None:
    assert plain(Ellipsis) == "Ellipsis"
    assert plain(range(2)) == "range(0, 2)"
