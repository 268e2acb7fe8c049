"""The machine of the demo, in virtual time: what it tells a person of its movements, and what it gives to be drawn."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import pytest

import motorbus
from motorbus.cli import nine
from motorbus.cli.machine import using
from motorbus.cli.output import Output
from motorbus.cli.robot import InHand, robot


@pytest.fixture
def hand(tmp_path: Path) -> Iterator[InHand]:
    """The machine over simulations in this process, open."""
    with ExitStack() as stack:
        addresses = {
            name: stack.enter_context(motorbus.simulate(part.family, ids=part.ids)).url
            for name, part in nine.PARTS.items()
        }
        file = tmp_path / "motorbus.toml"
        file.write_text(nine.machine(addresses).text(), encoding="utf-8")
        stack.enter_context(using(str(file)))
        yield stack.enter_context(robot(nine.AXES, {}, Output()))


def test_it_goes_there_and_back(hand: InHand) -> None:
    there, back = nine.there_and_back(hand, 6.0)
    assert there.began == 0.0
    assert back.began >= there.moved.duration
    for (_, moved), goals in ((there, nine.REACH), (back, dict.fromkeys(nine.AXES, 0.0))):
        assert moved.duration == pytest.approx(3.0, rel=0.02)
        assert {name: one.goal for name, one in moved.axes.items()} == pytest.approx(goals)
        assert {name for name, one in moved.axes.items() if one.estimated} == {"slide"}
        assert moved.started_apart < 0.005
        assert moved.ended_apart < 0.02 * moved.duration
    assert hand.robot["slide"].estimated == pytest.approx(0.0, abs=1e-4)


def test_the_shortest_that_is_allowed_is_kept(hand: InHand) -> None:
    for _, moved in nine.there_and_back(hand, nine.LEAST):
        assert moved.duration == pytest.approx(nine.LEAST / 2, rel=0.02)


def test_what_is_drawn_leaves_the_pause_out_and_says_so(hand: InHand) -> None:
    movements = nine.there_and_back(hand, 6.0)
    close, (pause,) = nine.drawn_together(movements)
    assert pause.end - pause.begin == pytest.approx(nine.GAP)
    assert (close[0].began, close[1].began) == (0.0, pause.end)
    assert "nothing moves" in pause.name
    tracks = nine.joined(hand.robot.machine, close)
    assert list(tracks) == list(nine.AXES)
    for name, track in tracks.items():
        assert all(before <= after for before, after in pairwise(track.times))
        assert track.present.count(None) == 2  # one behind each movement
        assert track.unit == ("mm" if name == "slide" else "deg")
    assert max(tracks["slide"].goal) == pytest.approx(90, rel=0.01)
    assert min(tracks["roll"].goal) == pytest.approx(-90, rel=0.01)


def test_a_person_is_told_of_each_axis(
    hand: InHand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = Output()
    output.simulated = True
    found = nine.found_on(hand.robot, output)
    movements = nine.there_and_back(hand, 6.0)
    drawn = nine.draw(tmp_path / "nine.png", hand.robot.machine, movements, output)
    nine.sum_up(hand.robot.machine, found, {}, movements, drawn, output)
    out = capsys.readouterr().out
    assert drawn is not None
    assert drawn.read_bytes().startswith(b"\x89PNG")
    assert out.startswith("Found (simulated)\n")
    for name in nine.AXES:
        assert out.count(f"\n{name} ") == 3
    for words in (
        "STS3215",
        "70.0 deg",
        "90.00 mm",
        "estimated",
        "orders left within",
        "nine.png (simulated)",
    ):
        assert words in out


def test_without_matplotlib_there_is_no_picture_and_the_reason_is_told(
    hand: InHand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    movements = nine.there_and_back(hand, 6.0)
    assert nine.draw(tmp_path / "nine.png", hand.robot.machine, movements, Output()) is None
    assert "pip install 'motorbus[plot]'" in capsys.readouterr().err
    assert list(tmp_path.glob("*.png")) == []
