"""Each option of the simulated servos: what it changes, the values it accepts, its help."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.errors import RequestError
from motorbus.families.kst.simulator import OPTIONS, simulate
from tests.simulators.kst.host import MOVE, READ_ID, SAVE, SET_ID, Host

ID, ID_SET, MOVED = "5A5#4F00300025000000", "5A5#6000300000000000", "5A5#6003600000000000"
READ_GOAL, TOO_FAR = "4003600000000000", "2203600085030000"
START, REPORT = "025#0100", "5A5#00000000"
EXTENDED = f"00000625#{READ_ID}"
RESTART = "restart"
Script = list[str | float]

CASES: list[tuple[str, object, Script, list[str]]] = [
    ("profile", "kst-ext", ["4005600000000000"], ["5A5#4305600000001900"]),
    ("bit_rate", "250000", [READ_ID], []),
    ("id_format", "std", [READ_ID, EXTENDED], [ID]),
    ("id_format", "ext", [READ_ID, EXTENDED], ["000005A5#4F00300025000000"]),
    ("duplicate", "0x25", [READ_ID], [ID, ID]),
    ("sized", "no", ["2B03600001000000"], ["5A5#8003600001000405"]),
    ("sized", "yes", ["2203600001000000"], ["5A5#8003600010000706"]),
    ("out_of_range", "clamp", [TOO_FAR, READ_GOAL], [MOVED, "5A5#4B03600084030000"]),
    ("save_reply", "ack", [SAVE], ["5A5#6010100100000000"]),
    ("save_reply", "abort", [SAVE], ["5A5#8010100120000008"]),
    ("flash_cut", "new", [SET_ID, SAVE, RESTART, f"626#{READ_ID}"], [ID_SET, "5A6#4F00300026000000"]),
    ("nmt", "vendor", [START, 0.04], [REPORT] * 2),
]
"""Option, value, steps (requests, s to wait, restart), the frames of the servos."""


def replies(steps: Script, options: dict[str, Any]) -> list[str]:
    """The frames of a servo with these options."""
    host = Host(**options)
    found: list[str] = []
    for step in steps:
        if step == RESTART:
            host.restart()
            found += host.wait(0.01)
        else:
            found += host.send(step) if isinstance(step, str) else host.wait(step)
    return found


@pytest.mark.parametrize(("name", "value", "steps", "expected"), CASES, ids=lambda one: str(one)[:20])
def test_option_changes_the_frames(name: str, value: object, steps: Script, expected: list[str]) -> None:
    assert replies(steps, {name: value}) == expected
    assert replies(steps, {}) != expected


def test_options_have_help_source_and_a_default_that_text_can_give() -> None:
    assert [option.name for option in OPTIONS] == list(dict.fromkeys(case[0] for case in CASES))
    for option in OPTIONS:
        assert option.help, option.name
        assert option.source or option.name == "profile"
        assert isinstance(option.default, option.kind)
        assert not option.choices or option.default in option.choices
    defaults = {option.name: str(option.default) for option in OPTIONS}
    assert replies([READ_ID, MOVE, 0.1], defaults) == replies([READ_ID, MOVE, 0.1], {})


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"out_of_reach": "abort"}, "out_of_range"),
        ({"out_of_range": "both"}, "abort, clamp"),
        ({"sized": "maybe"}, "either, no, yes"),
        ({"bit_rate": "300000"}, "one of 20000, 50000"),
        ({"profile": "futaba"}, "kst, kst-ext, kingmax, xqpower"),
        ({"duplicate": "twice"}, "0x25+0x26"),
        ({"duplicate": "0x80"}, "one of [1]"),
    ],
    ids=str,
)
def test_impossible_value_is_refused(options: dict[str, Any], expected: str) -> None:
    with pytest.raises(RequestError) as raised:
        simulate([1], **options)
    assert expected in raised.value.expected


@pytest.mark.parametrize("ids", [(), (0,), (128,), (1, 300)], ids=str)
def test_impossible_ids_are_refused(ids: tuple[int, ...]) -> None:
    with pytest.raises(RequestError):
        simulate(ids)
