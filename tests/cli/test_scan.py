"""Finding devices: some, none, at several rates; and what was found is told even when it is interrupted."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.cli import scan
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_all_that_answer_are_found(run: Run, arm: Simulation) -> None:
    document = run("scan", arm.url, "--ids", "1-5", "--json").document
    assert document["schema"] == "motorbus.scan/1"
    assert document["simulated"] is True
    assert [(one["id"], one["baud"], one["model"]) for one in document["devices"]] == [
        (1, 1_000_000, "STS3215"),
        (2, 1_000_000, "STS3215"),
        (3, 1_000_000, "STS3215"),
    ]


def test_every_id_is_asked_when_none_is_named(run: Run, arm: Simulation) -> None:
    assert len(run("scan", arm.url, "--json").document["devices"]) == 3


def test_ids_may_stand_in_the_address(run: Run, arm: Simulation) -> None:
    assert [one["id"] for one in run("scan", f"{arm.url}#2+9", "--json").document["devices"]] == [2]


def test_a_table_for_eyes(run: Run, arm: Simulation) -> None:
    ran = run("scan", arm.url, "--ids", "1-3")
    assert (ran.code, ran.err) == (0, "")
    assert f"Devices on {arm.url} (simulated)" in ran.out
    assert ran.out.count("STS3215") == 3


def test_other_rates_are_tried_when_asked(run: Run, arm: Simulation) -> None:
    document = run("scan", arm.url, "--ids", "1", "--baud", "500000,1000000", "--json").document
    assert [one["baud"] for one in document["devices"]] == [1_000_000]


def test_nobody_ends_with_5_and_says_where_to_look(run: Run, arm: Simulation) -> None:
    ran = run("scan", arm.url, "--ids", "9")
    assert ran.code == 5
    assert "--baud all" in ran.err


@pytest.mark.parametrize("ids", ["x", "5-1", "254"])
def test_impossible_ids_end_with_2(ids: str, run: Run, arm: Simulation) -> None:
    assert run("scan", arm.url, "--ids", ids).code == 2


def test_what_was_found_is_told_when_it_is_interrupted(
    run: Run, arm: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(event: object, found: list[object], bar: object) -> None:
        listen(event, found, bar)  # type: ignore[arg-type]
        if len(found) == 2:
            raise KeyboardInterrupt

    listen = scan.listen
    monkeypatch.setattr(scan, "listen", interrupt)
    ran = run("scan", arm.url, "--ids", "1-3", "--json")
    assert ran.code == 10
    assert [one["id"] for one in ran.document["devices"]] == [1, 2]


def test_a_scan_reports_a_duplicate_feetech_id(run: Run) -> None:
    with motorbus.simulate("feetech", ids="1-3", duplicate="3") as simulation:
        ran = run("scan", simulation.url, "--ids", "1-4", "--json")
    assert [one["id"] for one in ran.document["devices"]] == [1, 2, 3]
    assert len(ran.document["notes"]) == 1
    assert "#3 at 1000000 bit/s: two servos seem to have the id 3" in ran.document["notes"][0]


@pytest.mark.parametrize("said", ["7", "1000000,7", "2M"])
def test_a_rate_that_no_servo_has_is_refused_and_nothing_is_asked(
    said: str, run: Run, arm: Simulation
) -> None:
    ran = run("scan", arm.url, "--baud", said, "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert "is no rate of feetech devices" in ran.err
    assert " tx " not in ran.err
