"""Ids and rates: written after consent only, in force after save and restart, and never an impossible one."""

from __future__ import annotations

import pytest

from motorbus.cli.kst.identity import bits_per_second, whole
from motorbus.errors import RequestError
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


def test_without_save_it_is_lost_with_it_it_holds_after_the_restart(servos: Simulation, run: Run) -> None:
    device = f"{servos.url}#37"
    for save in (False, True):
        assert run("kst", "node-id", device, "0x27", "--yes").code == 0
        assert run("kst", "node-id", device, "--json").document["reads_back"] == 39
        assert not save or run("kst", "save", device, "--yes").code == 0
        servos[37].power_cycle()
        assert sorted(servos.simulator.nodes) == ([38, 39] if save else [37, 38])


def test_what_is_to_come_is_told(servos: Simulation, run: Run) -> None:
    ran = run("kst", "node-id", f"{servos.url}#37", "39", "--yes")
    assert "motorbus kst save" in ran.out
    assert "power cycle" in ran.out
    assert "answers as #37 (0x25) until it is restarted" in run("kst", "node-id", f"{servos.url}#37").out


def test_a_bit_rate_cannot_be_read_and_says_so(servos: Simulation, run: Run) -> None:
    assert run("kst", "bit-rate", f"{servos.url}#37", "--json").document["bitrate"] is None
    assert "not readable" in run("kst", "bit-rate", f"{servos.url}#37").out


def test_a_bit_rate_is_in_force_after_save_and_restart(servos: Simulation, run: Run) -> None:
    device = f"{servos.url}#37"
    assert run("kst", "bit-rate", device, "250k", "--yes").code == 0
    assert run("ping", device).code == 0
    assert run("kst", "save", device, "--yes").code == 0
    servos[37].power_cycle()
    assert run("ping", device).code == 5
    assert run("ping", device, "--bitrate", "250000").code == 0


@pytest.mark.parametrize("words", [["node-id", "39"], ["bit-rate", "1M"], ["save"]], ids=" ".join)
def test_without_consent_nothing_is_written(words: list[str], servos: Simulation, run: Run) -> None:
    command, *value = words
    ran = run("kst", command, f"{servos.url}#37", *value, "-vv")
    assert ran.code == 8
    assert "625#22" not in ran.err


@pytest.mark.parametrize(
    ("words", "frames"),
    [
        (["node-id", "1"], ["625#2200300001000000"]),
        (["bit-rate", "1000000"], ["625#2201300007000000"]),
        (["save"], ["625#2210100173617665"]),
    ],
)
def test_a_dry_run_shows_the_frame_of_the_manual(
    words: list[str], frames: list[str], servos: Simulation, run: Run
) -> None:
    command, *value = words
    ran = run("kst", command, f"{servos.url}#37", *value, "--dry-run", "--json")
    assert [one["frame"] for one in ran.document["withheld"]] == frames
    assert servos[37].memory["node_id"] == 37


@pytest.mark.parametrize(
    "words",
    [["node-id", "0"], ["node-id", "128"], ["node-id", "me"], ["bit-rate", "123"], ["bit-rate", "fast"]],
    ids=" ".join,
)
def test_what_is_no_id_or_rate_is_refused_before_anything_is_sent(
    words: list[str], servos: Simulation, run: Run
) -> None:
    ran = run("kst", words[0], f"{servos.url}#37", words[1], "--yes", "-vv")
    assert (ran.code, ran.out) == (2, "")
    assert " tx " not in ran.err
    assert servos[37].memory["node_id"] == 37


def test_numbers() -> None:
    assert (whole("0x25", "an id"), whole("37", "an id")) == (37, 37)
    assert [bits_per_second(text) for text in ("500k", "1M", "20000")] == [500_000, 1_000_000, 20_000]
    with pytest.raises(RequestError):
        bits_per_second("3M")
