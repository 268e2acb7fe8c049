"""The commands `motorbus kst ...`, judged by their output and by the memory of the simulated servo."""

from __future__ import annotations

from math import radians

import pytest

import motorbus
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


@pytest.mark.parametrize(
    ("value", "raw"),
    [("10.85deg", 109), ("-10.85deg", -109), ("-0.5", -286)],
)
def test_position_rounds_half_a_count_away_from_zero(
    value: str, raw: int, servos: Simulation, run: Run
) -> None:
    document = run("kst", "position", f"{servos.url}#37", value, "--json").document
    assert (document["schema"], document["id"]) == ("motorbus.kst.position/1", 37)
    assert servos[37].memory["goal_position"] == raw


def test_position_waits_and_needs_consent_beyond_180_degrees(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    document = run("kst", "position", device, "-95deg", "--wait", "--json").document
    assert document["position"] == pytest.approx(radians(-95), abs=0.02)
    assert run("kst", "position", device, "95deg").code == 8
    assert newer[37].memory["goal_position"] == -950
    assert run("kst", "position", device, "95deg", "--yes").code == 0
    assert newer[37].memory["goal_position"] == 950


def test_status_and_version_depend_on_the_firmware(servos: Simulation, newer: Simulation, run: Run) -> None:
    raw = run("kst", "status", f"{servos.url}#37", "--json").document
    assert (raw["x1"], raw["x2"]) == (0, 0)
    assert "may be returning the position" in run("kst", "status", f"{servos.url}#37").err
    assert run("kst", "status", f"{newer.url}#37", "--json").document["temperature"] == 25
    assert "25 °C" in run("kst", "status", f"{newer.url}#37").out
    assert run("kst", "version", f"{servos.url}#37", "--json").document["version"] == "1.00"


def test_node_id_takes_effect_after_save_and_power_cycle(servos: Simulation, run: Run) -> None:
    device = f"{servos.url}#37"
    written = run("kst", "node-id", device, "0x27", "--yes")
    assert f"#39 (0x27) after `motorbus kst save {device}` and a power cycle" in written.out
    assert run("kst", "node-id", device, "--json").document["reads_back"] == 39
    assert "answers as #37 (0x25) until it is restarted" in run("kst", "node-id", device).out
    assert run("kst", "save", device, "--yes", "--json").document["confirmed"] is None
    servos[37].power_cycle()
    assert sorted(servos.simulator.nodes) == [38, 39]


def test_bit_rate_takes_effect_after_save_and_power_cycle(servos: Simulation, run: Run) -> None:
    device = f"{servos.url}#37"
    assert run("kst", "bit-rate", device, "--json").document["bitrate"] is None
    assert "not readable" in run("kst", "bit-rate", device).out
    document = run("kst", "bit-rate", device, "250k", "--yes", "--json").document
    assert (document["new"], document["in_force"]) == (250_000, False)
    assert run("ping", device).code == 0
    assert run("kst", "save", device, "--yes").code == 0
    servos[37].power_cycle()
    assert run("ping", device).code == 5
    assert run("ping", device, "--bitrate", "250000").code == 0


def test_provision_reports_each_step_and_verifies_after_the_power_cycle(run: Run) -> None:
    with motorbus.simulate("kst", ids="0x25+0x26", faults="at 9 s: power-cycle 37") as servos:
        ran = run("kst", "provision", f"{servos.url}#0x25", "--new-id", "0x27", "--yes", "--json")
        assert ran.code == 0, ran.err
        assert {one["schema"] for one in ran.records} == {"motorbus.kst.provision/1"}
        events = [one for one in ran.records if one["event"] != "progress"]
        assert [one["event"] for one in events] == ["power-cycle", "provisioned"]
        assert (events[-1]["id"], events[-1]["from"], events[-1]["resumed"]) == (39, 37, False)
        assert "switch the supply of this servo off and on again now" in ran.err
        assert [one["id"] for one in run("scan", servos.url, "--json").document["devices"]] == [38, 39]


def test_provision_resumes_after_a_timeout(servos: Simulation, run: Run) -> None:
    words = ["kst", "provision", f"{servos.url}#37", "--new-id", "39", "--yes", "--timeout", "1s"]
    ran = run(*words)
    assert ran.code == 1
    assert "did not come back within 1 s" in ran.err
    servos[37].power_cycle()
    ran = run(*words)
    assert ran.code == 0, ran.err
    assert "#39 (0x27) had these values already: it answers at 500000 bit/s" in ran.out


def test_limits_are_saved_and_bound_the_next_move(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("kst", "limits", device, "-45deg", "30deg", "--yes").code == 0
    newer[37].power_cycle()
    document = run("kst", "limits", device, "--json").document
    assert (document["low"], document["high"]) == pytest.approx((radians(-45), radians(30)))
    assert run("kst", "position", device, "40deg").code == 8


def test_reverse_changes_only_its_bit(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    before = newer[37].memory["function_enable"]
    assert run("kst", "reverse", device, "--json").document["reversed"] is False
    assert "in reverse" in run("kst", "reverse", device, "on", "--yes").out
    assert newer[37].memory["function_enable"] == before | 0x20
    assert run("kst", "reverse", device, "--json").document["reversed"] is True


def test_mid_point_sets_the_zero_here(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("kst", "position", device, "20deg", "--wait").code == 0
    shown = run("kst", "mid-point", device, "--dry-run", "--json").document["withheld"]
    assert [one["frame"][:12] for one in shown] == ["625#22093000", "625#22101001"]
    assert newer[37].memory["present_position"] == 200
    document = run("kst", "mid-point", device, "--yes", "--json").document
    assert document["position"] == pytest.approx(0, abs=0.01)


def test_reports_start_and_stop(newer: Simulation, run: Run) -> None:
    device = f"{newer.url}#37"
    assert run("kst", "reports", "on", device, "--interval", "20ms", "--json").document["interval"] == 0.02
    assert newer[37].memory["report_interval"] == 20
    assert newer.simulator.due() is not None
    assert run("kst", "reports", "off", device).code == 0
    assert newer.simulator.due() is None


@pytest.mark.parametrize(
    ("words", "frames"),
    [
        ("kst position BUS 90deg", ["625#2203600084030000"]),
        ("kst node-id BUS 1", ["625#2200300001000000"]),
        ("kst bit-rate BUS 1000000", ["625#2201300007000000"]),
        ("kst save BUS", ["625#2210100173617665"]),
        (
            "kst provision BUS --new-id 39 --new-bitrate 1M",
            ["625#2200300027000000", "625#2201300007000000", "625#2210100173617665"],
        ),
        ("kst position BUS 40deg --profile xqpower", ["000#0125", "625#22036000D0020000"]),
    ],
)
def test_dry_run_shows_the_frames_of_the_manual_and_sends_none(
    words: str, frames: list[str], servos: Simulation, run: Run
) -> None:
    before = dict(servos[37].memory)
    ran = run(*words.replace("BUS", f"{servos.url}#37").split(), "--dry-run", "--json")
    assert [one["frame"] for one in ran.document["withheld"]] == frames
    assert dict(servos[37].memory) == before
