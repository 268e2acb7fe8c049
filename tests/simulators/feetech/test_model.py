"""Models by name: each that has a number, in the map that its firmware tells."""

from __future__ import annotations

import pytest

from motorbus.core.register import Storage
from motorbus.errors import RequestError
from motorbus.families.feetech.simulator import simulate
from motorbus.families.feetech.simulator.model import MODELS, model, models
from motorbus.families.feetech.table import CONTROL, TABLES, choose
from motorbus.families.feetech.table import MODELS as NUMBERS
from tests.simulators.feetech.host import READ, Host, packet


def test_the_usual_model_and_the_same_in_capitals() -> None:
    assert model("") is model("STS3215") is MODELS["sts3215"]


def test_an_unknown_model_is_refused_with_those_there_are() -> None:
    with pytest.raises(RequestError) as caught:
        model("sts9999")
    assert "sts3215" in caught.value.expected


def test_every_model_that_has_a_number_can_be_simulated() -> None:
    assert set(MODELS) == {known.name.lower() for known in NUMBERS.values()}


@pytest.mark.parametrize("name", MODELS)
def test_what_a_model_tells_leads_back_to_it_and_to_its_map(name: str) -> None:
    servo = simulate((1,), name).nodes[1]
    major, minor, end, *number = servo.memory.read(0, 5)
    found = choose((major, minor), (number[0], number[1]), end)
    assert found.model is not None
    assert (found.model.name.lower(), found.table) == (name, servo.model.table.name)


@pytest.mark.parametrize("name", MODELS)
def test_every_stored_register_holds_a_value_its_row_allows_and_no_alarm_is_on(name: str) -> None:
    servo = simulate((1,), name).nodes[1]
    stored = [row for row in servo.model.table.values() if row.storage is Storage.EEPROM]
    assert {
        row.name: servo.memory[row.name]
        for row in stored
        if not row.low <= servo.memory[row.name] <= row.high
    } == {}
    assert (servo.error, servo.alarm) == (0, 0)
    assert servo.mode is not None


def test_nothing_but_the_identity_contradicts_the_table() -> None:
    told = {"firmware_major", "firmware_minor", "model_major", "model_minor"}
    for one in MODELS.values():
        known = {row.name: row.default for row in one.table.values() if row.default is not None}
        assert {name for name, raw in one.defaults.items() if known.get(name, raw) != raw} <= told
        assert set(one.defaults) <= set(one.table)


def test_every_setting_of_every_map_has_a_shipped_value() -> None:
    """Either the table gives it or it is assumed: none is 0 because nobody thought of it."""
    for one in MODELS.values():
        missing = {
            row.name
            for row in one.table.values()
            if row.storage is Storage.EEPROM and row.default is None and row.name not in one.defaults
        }
        assert missing == set()


def test_several_numbers_with_one_name_are_the_first_unless_the_firmware_says_otherwise() -> None:
    assert model("sm100-360m").defaults["model_major"] == 6
    other = model("sm100-360m", "2.45")
    assert (other.defaults["model_major"], other.table.name) == (8, "smbl")


@pytest.mark.parametrize(("firmware", "block"), [("3.9", "03 09"), ("20.1", "14 01")])
def test_a_firmware_is_told_and_changes_nothing_else(firmware: str, block: str) -> None:
    host = Host((1,), firmware=firmware)
    (reply,) = host.say(packet(1, READ, 0, 5))
    assert reply.startswith(f"FF FF 01 07 00 {block} 00 09 03")
    assert host.bus.nodes[1].model.table is TABLES["sts"]


@pytest.mark.parametrize("text", ["3", "3.x", "256.1", "-1.2", "3.1.2"])
def test_a_firmware_that_is_none(text: str) -> None:
    with pytest.raises(RequestError) as caught:
        model("sts3215", text)
    assert "firmware" in caught.value.summary


def test_one_for_all_or_one_for_each() -> None:
    assert [one.name for one in models("sts3215", "", (1, 2))] == ["sts3215", "sts3215"]
    mixed = models("sts3215+scs0009+hls3925", "3.9+0.10+3.45", (4, 5, 6))
    assert [one.table.name for one in mixed] == ["sts", "scs", "hls"]
    assert [one.defaults["firmware_minor"] for one in mixed] == [9, 10, 45]
    assert [one.name for one in models("sts3215,scs0009", "", (1, 2))] == ["sts3215", "scs0009"]
    for names, firmwares in (("sts3215+scs0009", ""), ("", "3.9+3.10")):
        with pytest.raises(RequestError) as caught:
            models(names, firmwares, (1, 2, 3))
        assert "as many as there are ids" in caught.value.expected


def test_0x0a_is_for_hls_and_brushless_ones() -> None:
    assert model("hls3925").clears_turns
    assert model("sts3045bl").clears_turns
    assert not model("sts3215").clears_turns
    assert not model("scs0009").clears_turns


def test_figures_are_those_of_the_map() -> None:
    for one in MODELS.values():
        assert one.turn == CONTROL[one.table.name].turn
        low, high = (simulate((1,), one.name).nodes[1].memory[row] for row in ("min_voltage", "max_voltage"))
        assert low < one.voltage * 10 < high
    assert model("sm85blhv").voltage == 24.0


def test_motors_of_which_a_data_sheet_says_more() -> None:
    # 60 degrees are 4096/6 counts in 0.133 s; 55 rpm are 330 degrees/s, and 1024 counts are 300 degrees
    assert model("sts3250").drive.top_speed == pytest.approx(4096 / 6 / 0.133, abs=1)
    assert model("scs15").drive.top_speed == pytest.approx(330 * 1024 / 300, abs=1)
    assert model("scs15").drive.stall_current == 1.5
    assert model("sts3032").drive is model("sts3215").drive
