"""What common commands use of this family: who is there, what a loop sends, and what a scan has noticed."""

from __future__ import annotations

import motorbus
from motorbus import families
from motorbus.cli.kst import offers
from motorbus.core.can_bits import bits
from motorbus.core.steps import Progress
from motorbus.families.kst import Skipped, Suspicion
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_everyone_answers_a_broadcast(servos: Simulation) -> None:
    with motorbus.open(servos.url) as bus:
        assert offers.ping_everyone(bus) == [37, 38]


def test_a_loop_sends_every_position_there_is() -> None:
    family = families.load("kst").open(profile="kst-ext")
    frames = offers.budget_frames(family, 0x25)
    goals, acknowledgements = frames["write"]
    requests, replies = frames["read"]
    assert [str(one) for one in (goals[0], goals[-1])] == ["625#2203600018FC0000", "625#22036000E8030000"]
    assert [str(one) for one in (*acknowledgements, *requests)] == [
        "5A5#6003600000000000",
        "625#4002600000000000",
    ]
    assert (len(goals), len(replies), str(replies[1000])) == (2001, 2001, "5A5#4B02600000000000")


def test_the_settings_of_the_bus_count() -> None:
    family = families.load("kst").open(id_format="ext", sized="yes")
    goals, _ = offers.budget_frames(family, 1)["write"]
    assert str(goals[0]) == "00000601#2B0360007CFC0000"
    assert bits(goals[0]) > bits(offers.budget_frames(families.load("kst").open(), 1)["write"][0][0])


def test_a_report_is_short() -> None:
    frames = offers.report_frames(families.load("kst").open(profile="kst-ext"), 0x25)
    assert {len(one.data) for one in frames} == {4}
    assert {one.id for one in frames} == {0x5A5}


def test_what_a_scan_notices_is_told() -> None:
    assert offers.say(Suspicion(37, 500_000, "two servos")) == "#37 at 500000 bit/s: two servos"
    assert offers.say(Suspicion(0, 500_000, "errors")) == "at 500000 bit/s: errors"
    assert "nothing was sent at 800000" in offers.say(Skipped(800_000, "in use"))
    assert offers.say(Progress(1, 2)) == ""


def test_a_version_is_text_in_tables_of_objects(servos: Simulation, run: Run) -> None:
    rows = run("read", f"{servos.url}#37", "firmware_version", "node_id", "--json").document["registers"]
    assert [(row["name"], row["meaning"]) for row in rows] == [("firmware_version", "1.00"), ("node_id", "")]
