"""The bounds of a machine file hold for devices that are named by their address, too, and in a rehearsal."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.conftest import Bench, Run
from tests.support.machines import described
from tests.support.processes import Simulated


def bounded(bench: Bench, *lines: str) -> None:
    """The same machine, with these lines for the axis a1."""
    text = bench.file.read_text(encoding="utf-8")
    more = "\n".join(["[axis.a1]", *lines])
    assert "[axis.a1]" in text
    bench.file.write_text(text.replace("[axis.a1]", more, 1), encoding="utf-8")


def goal(run: Run, bench: Bench) -> int:
    raw: int = run("read", "a1", "goal_position", "--json").document["registers"][0]["raw"]
    return raw


@pytest.mark.parametrize(
    "words",
    [
        ("write", "{one}", "goal_position=340deg", "--yes"),
        ("write", "a1", "goal_position=340deg", "--yes"),
        ("write", "{one}", "goal_position=4000", "--raw", "--expert", "--yes"),
        ("write", "{one}", "goal_position=340deg", "--yes", "--dry-run"),
        ("move", "{one}=340deg", "--velocity", "1", "--yes"),
        ("move", "{one}=340deg", "--velocity", "1", "--yes", "--dry-run"),
    ],
    ids=" ".join,
)
def test_beyond_a_soft_limit_nothing_goes_whatever_the_spelling(
    words: tuple[str, ...], run: Run, bench: Bench
) -> None:
    one = f"{bench.machine.buses['arm'].address}#1"
    before = goal(run, bench)
    ran = run(*(word.format(one=one) for word in words))
    assert (ran.code, "a1" in ran.err, "outside" in ran.err) == (8, True, True), ran.err
    assert goal(run, bench) == before


def test_within_its_limits_it_goes(run: Run, bench: Bench) -> None:
    one = f"{bench.machine.buses['arm'].address}#1"
    ran = run("write", one, "goal_velocity=10rpm", "goal_position=190deg", "--yes")
    assert ran.code == 0, ran.err
    assert goal(run, bench) == 2162


@pytest.mark.parametrize("spelling", ["a1", "address"])
def test_one_step_is_no_farther_than_the_file_says(spelling: str, run: Run, bench: Bench) -> None:
    bounded(bench, 'max_step = "5 deg"')
    one = spelling if spelling == "a1" else f"{bench.machine.buses['arm'].address}#1"
    ran = run("write", one, "goal_position=190deg")
    assert (ran.code, "one command may be" in ran.err) == (8, True), ran.err
    assert run("write", one, "goal_position=184deg").code == 0


def test_a_velocity_is_bounded(run: Run, bench: Bench) -> None:
    one = f"{bench.machine.buses['arm'].address}#1"
    ran = run("move", f"{one}=190deg", "--velocity", "40")
    assert (ran.code, "rad/s" in ran.err) == (8, True), ran.err


def test_a_file_that_nobody_understands_bounds_nothing_and_says_so(run: Run, bench: Bench) -> None:
    one = f"{bench.machine.buses['arm'].address}#1"
    bounded(bench, "speed = 3")
    ran = run("write", one, "goal_position=340deg")
    assert ran.code == 0
    assert "bound nothing here" in ran.err


def test_a_bus_that_is_not_in_the_file_has_the_limits_of_its_devices(
    run: Run, bench: Bench, arm: object
) -> None:
    url = arm.url  # type: ignore[attr-defined]
    ran = run("write", f"{url}#1", "goal_position=340deg")
    assert (ran.code, ran.err) == (0, "")


@pytest.fixture
def real(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, state_folder: Path, patient: None
) -> Iterator[Simulated]:
    """A servo on a pseudo-terminal, `arm` in the present folder, with more links to it; the file calls it a1."""
    with Simulated("feetech", ids="1", link=tmp_path / "arm") as simulated:
        (tmp_path / "by-id").mkdir()
        (tmp_path / "by-id" / "usb-arm").symlink_to("../arm")
        (tmp_path / "again").symlink_to(tmp_path / "by-id" / "usb-arm")
        file = tmp_path / "motorbus.toml"
        file.write_text(described({"arm": simulated.bus}, "1", "", False, {}, {}), encoding="utf-8")
        monkeypatch.chdir(tmp_path)
        yield simulated


@pytest.mark.parametrize("spelling", ["arm", "./arm", "by-id/../arm", "by-id/usb-arm", "again", "{pty}"])
def test_it_is_the_same_port_by_every_name(spelling: str, run: Run, real: Simulated, tmp_path: Path) -> None:
    one = f"feetech:{spelling.format(pty=(tmp_path / 'arm').resolve())}#1"
    ran = run("write", one, "goal_position=340deg", "--yes")
    assert (ran.code, "a1" in ran.err, "outside" in ran.err) == (8, True, True), ran.err
    ran = run("move", f"{one}=340deg", "--velocity", "1", "--yes")
    assert (ran.code, "a1" in ran.err) == (8, True), ran.err
    ran = run("write", one, "goal_velocity=10rpm", "goal_position=184deg", "--yes")
    assert ran.code == 0, ran.err
