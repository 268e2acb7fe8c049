"""What a healthy controller may come to hold by commands that it takes is read, judged, timed, shown and written."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

import motorbus
from motorbus.families.stepper import Program
from motorbus.families.stepper.simulator import Controller as Simulated
from motorbus.families.stepper.table import decode_image
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import Line
from tests.simulators.stepper.host import CLEAR, SAVE, SELECT, Host, frame, step

WRITTEN = [frame(SELECT, 2, 5), frame(3, 1, 0x10, 0, 0x5A), frame(3, 2, 0x88, 0x13)]
LOOP = frame(0x7E, 4, 5, 2)
SHORTER, KEPT, CLEARED = frame(SELECT, 2, 4), frame(SAVE, 2), frame(CLEAR, 2)


class Held(NamedTuple):
    """How a controller comes to hold it, and the rule that says so."""

    frames: list[bytes]
    rule: str
    select: str = "load"


CASES = {
    "shortened": Held([*WRITTEN, LOOP, SHORTER, KEPT], "L9", select="relabel"),
    "shortened after a save": Held([*WRITTEN, LOOP, KEPT, SHORTER, KEPT], "L9"),
    "edits that selecting takes back": Held([*WRITTEN, LOOP, SHORTER, KEPT], "L1"),
    "shortened with a move": Held([*WRITTEN, LOOP, *step(1), KEPT, SHORTER, KEPT], "L9"),
    "selected after clearing": Held([CLEARED, frame(SELECT, 2, 3), KEPT], "L1"),
    "steps and no geometry": Held([CLEARED, frame(SELECT, 2, 3), *step(1), *step(3), KEPT], "L1"),
    "a loop that ends before it begins": Held([*WRITTEN, frame(0x7E, 5, 3, 2), *step(1), KEPT], "L9"),
}


@pytest.fixture(params=CASES, ids=str)
def case(request: pytest.FixtureRequest) -> Held:
    return CASES[request.param]


def dump_of(case: Held) -> bytes:
    host = Host(select=case.select)
    host.write(case.frames, within=0.2)
    return host.dump(2)


def test_every_command_takes_it_and_the_lint_says_what_it_is(run: Run, tmp_path: Path, case: Held) -> None:
    dump, text, again = (str(tmp_path / name) for name in ("held.bin", "held.toml", "again.bin"))
    Path(dump).write_bytes(dump_of(case))
    found = run("stepper", "check", dump, "--json").document["findings"]
    assert case.rule in {one["rule"] for one in found}
    for command in ("estimate", "order", "show"):
        ran = run("stepper", command, dump)
        assert (ran.code, ran.err) == (0, "")
    assert run("stepper", "show", dump, "--output", str(tmp_path / "held.png")).code == 0
    assert run("stepper", "convert", dump, "--output", text).code == 0
    assert "expert = true" in Path(text).read_text(encoding="utf-8")
    assert run("stepper", "convert", text, "--to", "dump", "--output", again).code == 0
    assert Path(again).read_bytes() == Path(dump).read_bytes()
    assert run("decode", "--family", "stepper", Path(dump).read_bytes().hex()).code == 0


def test_it_is_read_from_a_controller(line: Line, case: Held) -> None:
    data = dump_of(case)
    controller = line.simulation.simulator.nodes[1]
    assert isinstance(controller, Simulated)
    controller.store.put(2, decode_image(data[6:]))
    with motorbus.open(line.url) as bus:
        assert motorbus.stepper.Controller(bus).read_project(2).dump() == data


def test_what_is_written_into_a_cleared_project_has_no_steps_and_no_file(run: Run, tmp_path: Path) -> None:
    host = Host(selected_at_boot=2)
    host.write([frame(CLEAR, 2), *WRITTEN[1:], KEPT], within=0.2)
    dump = tmp_path / "none.bin"
    dump.write_bytes(host.dump(2))
    ran = run("stepper", "check", str(dump), "--json")
    assert [(one["rule"], one["text"]) for one in ran.document["findings"]] == [
        ("L8", "the project has no steps: it has been cleared, and not selected since")
    ]
    ran = run("stepper", "convert", str(dump))
    assert ran.code == 2
    assert (
        "project 2 has been cleared: there is nothing for a file to say; microsteps, step_angle, turn_distance"
        in ran.err
    )
    assert "keep it as a dump" in ran.err
    assert run("stepper", "convert", str(dump), "--to", "dump").code == 0


def test_a_count_of_255_is_told_and_not_refused(tmp_path: Path, run: Run) -> None:
    """The simulated controller does not take it; another one may."""
    data = bytearray(dump_of(CASES["shortened with a move"]))
    data[8:11] = b"\x01\x02\xff"
    assert Program.from_dump(bytes(data)).project.loop_count == 255
    (tmp_path / "many.bin").write_bytes(data)
    found = run("stepper", "check", str(tmp_path / "many.bin"), "--json").document["findings"]
    assert "count 255 is not defined for steps" in [one["text"] for one in found]
