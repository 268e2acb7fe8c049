"""Whether two servos share an id, from the shell: the verdict, its exit code, and what it cannot know."""

from __future__ import annotations

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_one_alone(run: Run, arm: Simulation) -> None:
    ran = run("feetech", "duplicates", f"{arm.url}#3")
    assert ran.code == 0
    assert "no second servo was seen at 3: of 200 answers none was garbled" in ran.out
    assert "look like one" in ran.err


def test_two(run: Run) -> None:
    with motorbus.simulate("feetech", ids=(3, 3)) as simulation:
        simulation.simulator.servos[1].raw_position = 700  # type: ignore[attr-defined]
        ran = run("feetech", "duplicates", f"{simulation.url}#3", "--polls", "50")
        assert ran.code == 1
        assert "two servos seem to have the id 3: of " in ran.out
        assert "connect one servo at a time" in ran.err
        document = run("feetech", "duplicates", f"{simulation.url}#3", "--json").document
    assert document["suspected"] is True
    assert document["garbled"] > 0


def test_what_is_no_request(run: Run, arm: Simulation) -> None:
    for polls in ("0", "-3"):
        ran = run("feetech", "duplicates", f"{arm.url}#3", "--polls", polls)
        assert ran.code == 2
        assert f"error: {polls} polls" in ran.err
        assert "expected: 1 to 100000" in ran.err
    assert run("feetech", "duplicates", arm.url).code == 2
    assert run("feetech", "duplicates", "kst:sim,ids=37#37").code == 2


def test_nobody_at_all_is_silence_with_cause_and_advice(run: Run, arm: Simulation) -> None:
    ran = run("feetech", "duplicates", f"{arm.url}#9")
    assert (ran.code, ran.out) == (5, "")
    assert "likely cause: no such id on this bus" in ran.err
    assert f"`motorbus scan {arm.url}` lists who answers" in ran.err
