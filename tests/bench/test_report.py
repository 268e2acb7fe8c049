"""The page and the table say what the samples say, and say plainly what was not measured."""

from __future__ import annotations

import json

from bench.estimates import Cost as Estimated
from bench.figures import Spread
from bench.growth import MEMORY, Point
from bench.page import page
from bench.report import Results, as_json, as_text, spoiled, tables, verdict
from bench.robot_loop import Sample as Looped
from bench.rounds import Sample
from bench.row import PROCESS, Row
from bench.startup import Cost
from bench.stepper_line import BACKUP
from bench.stepper_line import Sample as Job
from bench.workloads import WORKLOADS

MACHINE = {"processor": "A processor", "cores": "2", "system": "Linux", "python": "CPython"}
RESULTS = Results(
    machine=MACHINE,
    rounds=1,
    wire=[
        Sample(0, name, workload, seconds, 5e-5)
        for name, seconds in (("motorbus", 1e-5), ("other", 4e-5))
        for workload in WORKLOADS
    ],
    memory=[Sample(0, "motorbus", workload, 2.5e-6, 2.5e-6) for workload in WORKLOADS],
    calls=None,
    starts=[Cost("import motorbus", Spread(0.0123, 0.01, 0.02), 42, ())],
    missing=[],
    can=[
        Sample(0, name, load, seconds, seconds)
        for name, seconds in (("motorbus", 1e-4), ("python-canopen", 2e-4))
        for load in ("can-read1", "can-read8")
    ],
)


def test_the_table_has_cost_ratio_and_what_is_missing() -> None:
    first = as_text(tables(RESULTS)[0])
    other = next(line for line in first.splitlines() if line.strip().startswith("other"))
    assert "40.0" in other
    assert "0.25 (0.25 – 0.25)" in other
    assert "not measured" in other


def test_the_page_holds_every_table() -> None:
    text = page(RESULTS)
    assert all(f"### {name}:" in text for name in WORKLOADS)
    assert "## CAN, over slcan" in text
    assert "2.00 (2.00 – 2.00)" in text
    assert "CAN" not in page(RESULTS._replace(can=()))
    assert "| import motorbus | 12.3 | 10.0 – 20.0 | 42 | none |" in text
    assert "A processor with 2 cores" in text
    assert "Estimates" not in text
    told = page(RESULTS._replace(forecasts=[Estimated("ten steps", Spread(0.0012, 0.001, 0.06))]))
    assert "| ten steps | 1.20 | 1.00 – 60.00 |" in told
    assert "estimated in 1.20 ms. Less than 50 ms: reached." in told
    assert "Stepper" not in text
    jobs = page(RESULTS._replace(stepper=[Job(BACKUP, 2.0, 1.9, 1.9)]))
    assert f"| {BACKUP} | 2.000 s |" in jobs
    assert "5.0%. At most 15%: reached." in jobs
    assert "robot.loop" not in text
    flat = Looped("direct ahead", 1136.4, 1136.4, 1020.0, 5100, 5000, 500, 4e-4, 9.7e-4, 1.2e-4)
    looped = page(RESULTS._replace(loop=[flat]))
    assert "| direct ahead | 1136.4 | 1020.0 | 89.8% | 5000 | 500 | 400 | 970 | 120 |" in looped
    assert "89.8%. At least 88%: reached." in looped


def test_the_page_begins_with_the_goals_and_shows_the_pictures() -> None:
    assert "## Goals" not in page(RESULTS)
    row = Row("4", "something", "somebody", "x", 0.7, 0.6, 0.9, "<= 0.8", "<= 0.65", margin=PROCESS)
    point = Point(MEMORY, "motorbus", 253, Spread(1e-4, 9e-5, 2e-4))
    text = page(RESULTS._replace(rows=[row], growth=[point], failures=["rows of x: why"]))
    assert text.index("## Goals") < text.index("## On a pseudo-terminal") < text.index("## Growth")
    assert "| 4: something | somebody | <= 0.8, <= 0.65 | 0.70, 0.60 – 0.90 | met |" in text
    assert "1 of 1 goals are met." in text
    assert "Not measured: rows of x: why." in text
    assert "| in process | motorbus | 253 | 100.0 | 90.0 – 200.0 |" in text
    assert "(images/performance-goals.png)" in text
    assert "(images/performance-growth.png)" in text


def test_a_contender_is_in_the_tables_of_what_it_can_do() -> None:
    lacking = [one for one in RESULTS.wire if (one.contender, one.workload) != ("other", "cycle")]
    by_title = {table.title.split(":")[0]: table for table in tables(RESULTS._replace(wire=lacking))}
    assert [row[0] for row in by_title["cycle"].rows] == ["motorbus"]
    assert [row[0] for row in by_title["read1"].rows] == ["motorbus", "other"]


def test_the_json_has_every_sample() -> None:
    document = json.loads(as_json(RESULTS))
    assert len(document["wire"]) == 2 * len(WORKLOADS)
    assert document["wire"][0] == RESULTS.wire[0]._asdict()
    assert document["system_calls"] is None


def test_the_goal_for_system_calls_counts_a_cycle_as_two_exchanges() -> None:
    calls = {("motorbus", name): {"read": 2.0, "write": 1.0, "select": 1.0} for name in WORKLOADS}
    calls["motorbus", "cycle"] = {"read": 4.0, "write": 2.0, "select": 2.0}
    assert verdict(RESULTS._replace(calls=calls)).endswith("cycle 4.00 (a cycle is two). At most 4: reached.")
    calls["motorbus", "read1"] = {"read": 4.04}
    assert "At most 4: MISSED" in verdict(RESULTS._replace(calls=calls))
    assert "not measured" in verdict(RESULTS)


def test_who_was_measured_again_is_said() -> None:
    late = RESULTS.wire[0]._replace(repeats=2)
    assert ": nobody. " in spoiled(RESULTS)
    assert "scanning: scan 3 times" in spoiled(RESULTS._replace(repeated={"scanning: scan": 3}))
    assert "motorbus 2 times" in spoiled(RESULTS._replace(wire=[late, *RESULTS.wire[1:]]))
