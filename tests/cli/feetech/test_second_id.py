"""The second id from the shell: read, changed with consent, shown without being sent, refused where others have it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


@pytest.fixture
def pair() -> Iterator[Simulation]:
    with motorbus.simulate("feetech", ids="3+4", model="hls3925") as simulation:
        yield simulation


def test_it_is_read(run: Run, pair: Simulation) -> None:
    assert (
        run("feetech", "second-id", f"{pair.url}#3").out
        == "simulated\n#3 obeys writes to 3, its own id, alone\n"
    )
    pair[3].memory["second_id"] = 9
    assert run("feetech", "second-id", f"{pair.url}#3").out == "simulated\n#3 obeys writes to 9, too\n"
    document = run("feetech", "second-id", f"{pair.url}#3", "--json").document
    assert (document["schema"], document["id"], document["second_id"]) == (
        "motorbus.feetech.second-id/1",
        3,
        9,
    )


def test_it_is_given_with_consent(run: Run, pair: Simulation) -> None:
    ran = run("feetech", "second-id", f"{pair.url}#3", "9", "--among", "1-9")
    assert ran.code == 8
    assert "give #3 the second id 9 for good" in ran.err
    assert pair[3].second_id == 3
    ran = run("feetech", "second-id", f"{pair.url}#3", "0x9", "--among", "1-9", "--yes")
    assert (ran.code, ran.out) == (0, "simulated\n#3 obeys writes to 9, too\n")
    assert pair[3].second_id == 9


def test_all_that_would_be_sent_is_shown(run: Run, pair: Simulation) -> None:
    ran = run("feetech", "second-id", f"{pair.url}#3", "9", "--among", "1-9", "--dry-run", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert sorted(one["data"][12:-3] for one in ran.document["withheld"]) == [
        *("03 07 09", "03 28 00", "03 37 00", "03 37 01")
    ]
    assert pair[3].second_id == 3


def test_what_another_has_is_refused_before_anybody_is_asked(run: Run, pair: Simulation) -> None:
    pair[4].memory["second_id"] = 9
    ran = run("feetech", "second-id", f"{pair.url}#3", "9", "--among", "1-9")
    assert ran.code == 2
    assert "`motorbus feetech second-id BUS#ID 4` of servo 4" in ran.err
    assert run("feetech", "second-id", f"{pair.url}#3", "9", "--force", "--among", "1-9", "--yes").code == 0


@pytest.mark.parametrize("words", ["--force", "--among 1-9", "--dry-run", "nine", "254"])
def test_what_is_no_request(words: str, run: Run, pair: Simulation) -> None:
    assert run("feetech", "second-id", f"{pair.url}#3", *words.split()).code == 2


def test_a_map_that_has_none_and_a_plain_write_say_so(run: Run, arm: Simulation, pair: Simulation) -> None:
    assert "has no second id" in run("feetech", "second-id", f"{arm.url}#3").err
    ran = run("write", f"{pair.url}#3", "second_id=9", "--yes")
    assert ran.code == 2
    assert "`motorbus feetech second-id BUS#ID NEW`" in ran.err


def test_set_id_takes_it_along_and_shows_that(run: Run, pair: Simulation) -> None:
    ran = run("set-id", f"{pair.url}#3", "7", "--dry-run", "--json", "--among", "1-9")
    assert [one["data"][6:8] + one["data"][14:-3] for one in ran.document["withheld"]][-3:] == [
        *("03 05 07", "07 07 07", "07 37 01")
    ]
    assert run("set-id", f"{pair.url}#3", "7", "--yes", "--among", "1-9").code == 0
    assert (pair[7].id, pair[7].second_id) == (7, 7)
