"""CSV in and out: what was written is read back, and of what is wrong there is one message with line and column."""

from __future__ import annotations

from itertools import accumulate
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.motion.trajectory import Trajectory, columns
from tests.motion.trajectory.files import AXES, BROKEN, GOOD, Broken

positions = st.floats(-1e6, 1e6) | st.floats(-10, 10)
rows = st.lists(st.tuples(st.floats(0.001, 10), positions, positions, positions), min_size=2, max_size=20)


def made(samples: list[tuple[float, float, float, float]]) -> Trajectory:
    times = [0.0, *accumulate(gap for gap, *_ in samples[1:])]
    return Trajectory(times, {name: [row[number] for row in samples] for number, name in enumerate(AXES, 1)})


def test_a_file_is_read_in_the_units_of_its_header() -> None:
    read = Trajectory.parse(GOOD, AXES)
    assert read.times == (0.0, 0.5, 1.5)
    assert list(read.axes) == ["shoulder", "slide"]
    assert read.axes["shoulder"] == pytest.approx((0.0, pi / 2, pi / 2))
    assert read.axes["slide"] == pytest.approx((0.0, 0.0125, 0.0125))
    assert Trajectory.parse(GOOD) == read


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace("\n", "\r\n"),
        "\ufeff" + GOOD,
        GOOD.replace(",", " ,\t"),
        GOOD.replace("time (s),shoulder (deg)", '"time (s)","shoulder (deg)"'),
        GOOD.replace("0.5,", "5e-1,").rstrip("\n"),
        GOOD.replace("# A trajectory of motorbus: format = 1\n", ""),
        GOOD.replace("time (s)", "time"),
        GOOD.replace("time (s)", "time(ms)").replace("0.5,", "500,").replace("1.5,", "1500,"),
        GOOD.replace("\n0,0,0", "\n7,0,0").replace("0.5,", "7.5,").replace("1.5,", "8.5,"),
    ],
)
def test_spreadsheets_and_people_write_it_in_many_ways(text: str) -> None:
    assert Trajectory.parse(text, AXES) == Trajectory.parse(GOOD, AXES)


def test_without_a_unit_a_number_is_in_rad_or_m() -> None:
    read = Trajectory.parse("time,elbow,slide\n0,1.5,0.01\n1,-1.5,0\n", AXES)
    assert read.axes == {"elbow": (1.5, -1.5), "slide": (0.01, 0.0)}


@given(rows)
def test_a_round_trip_keeps_every_digit(samples: list[tuple[float, float, float, float]]) -> None:
    one = made(samples)
    assert Trajectory.parse(one.text()) == one


@given(rows)
def test_a_round_trip_in_units_of_people_keeps_twelve_digits(
    samples: list[tuple[float, float, float, float]],
) -> None:
    one = made([(gap, lift, bend, slide / 1e3) for gap, lift, bend, slide in samples])
    near = {name: [place * 0.999 for place in places] for name, places in one.axes.items()}
    one = Trajectory(one.times, near)  # twelve digits of the farthest place would be beyond it
    back = Trajectory.parse(one.text(AXES), AXES)
    assert back.times == one.times
    for name, places in one.axes.items():
        assert back.axes[name] == pytest.approx(places, rel=1e-11, abs=0.0)
    assert Trajectory.parse(back.text(AXES), AXES).text(AXES) == one.text(AXES)


def test_what_is_written_looks_like_this() -> None:
    one = Trajectory([0.0, 0.5], {"shoulder": [0.0, pi / 4], "slide": [0.0125, 0.0]})
    assert one.text(AXES).splitlines() == [
        "# A trajectory of motorbus: format = 1",
        "time (s),shoulder (deg),slide (mm)",
        "0,0,12.5",
        "0.5,45,0",
    ]
    assert one.text().splitlines()[1:3] == ["time (s),shoulder,slide", "0,0,0.0125"]


@pytest.mark.parametrize("broken", [pytest.param(one, id=name) for name, one in BROKEN.items()])
def test_a_broken_file_gets_one_message_with_its_place_and_a_fix(broken: Broken) -> None:
    with pytest.raises(RequestError) as refused:
        Trajectory.parse(broken.text, AXES)
    assert refused.value.summary.startswith(broken.says)
    assert broken.fix in refused.value.advice
    assert refused.value.advice.endswith("nothing was moved")
    assert refused.value.expected
    assert all(len(line) < 200 for line in str(refused.value).splitlines())


def test_there_are_enough_broken_files() -> None:
    assert len(BROKEN) >= 15
    assert len({(one.text, one.says) for one in BROKEN.values()}) == len(BROKEN)


def test_sizes_have_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = ",".join(["time", *(f"a{number}" for number in range(columns.MOST_COLUMNS))])
    with pytest.raises(RequestError, match="258 columns are too many"):
        Trajectory.parse(f"{wide}\n")
    with pytest.raises(RequestError, match="the file has more than 67108864 characters"):
        Trajectory.parse("#" * (columns.LONGEST + 1))
    monkeypatch.setattr(columns, "MOST_ROWS", 3)
    with pytest.raises(RequestError, match="line 5: there are more than 3 rows"):
        Trajectory.parse("time,elbow\n0,1\n1,1\n2,1\n3,1\n4,1\n")


def test_an_axis_that_is_not_there_is_not_written() -> None:
    with pytest.raises(RequestError, match="no axis 'sholder'") as refused:
        Trajectory([0.0, 1.0], {"sholder": [0.0, 0.0]}).text(AXES)
    assert refused.value.advice == "did you mean shoulder?"
    with pytest.raises(RequestError, match="'a,b' is no name"):
        Trajectory([0.0, 1.0], {"a,b": [0.0, 0.0]}).text()


@given(st.text(alphabet='time,elbow()0123456789.-+eE# \n"\tnaif=;_', max_size=80))
def test_whatever_is_in_it_it_is_read_or_refused(text: str) -> None:
    try:
        read = Trajectory.parse(f"time,elbow\n{text}", AXES)
    except RequestError:
        return
    assert list(read.axes) == ["elbow"]
