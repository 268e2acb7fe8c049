"""A script says what it means, prints itself, and says of nonsense which line it is and what is near."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motorbus.errors import RequestError
from motorbus.link.base import Side
from motorbus.simulation.faults import ANY, Fault, Script, parse
from tests.simulation.faults.scripts import scripts


def test_a_script_is_lines_or_semicolons_with_remarks() -> None:
    script = """
        seed 42
        at exchange 17 byte 3: drop          # the id; not the length
        exchange 17 byte 0 to device: corrupt 80; exchange 18 byte 8 to host: delay 0.02
    """
    assert parse(script) == Script(
        (
            Fault(17, 3, "drop"),
            Fault(17, 0, "corrupt", Side.DEVICE, value=0x80),
            Fault(18, 8, "delay", seconds=0.02),
        ),
        seed=42,
    )
    assert parse("") == Script()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("exchange 17 byte 3 to device: flip 4", Fault(17, 3, "flip", Side.DEVICE, value=4)),
        ("exchange 17: delay 0.02", Fault(17, None, "delay", seconds=0.02)),
        ("exchange 17 packet 2: drop", Fault(17, None, "drop", packet=2)),
        ("exchange 0: duplicate", Fault(0, None, "duplicate")),
        ("exchange 5: echo", Fault(5, None, "echo", Side.DEVICE)),
        ("exchange 5: echo 6", Fault(5, None, "echo", Side.DEVICE, value=6)),
        ("exchange 5: split", Fault(5, None, "split")),
        ("exchange 5: split 0.01", Fault(5, None, "split", seconds=0.01)),
        ("exchange 5: corrupt", Fault(5, None, "corrupt", value=ANY)),
        ("1% to host: delay 0.02-0.5", Fault(action="delay", percent=1.0, seconds=0.02, until=0.5)),
        ("1e-3% of bytes: corrupt", Fault(action="corrupt", percent=1e-3, per_byte=True, value=ANY)),
        ("0.1 % of packets: drop", Fault(action="drop", percent=0.1)),
        ("at 2.5 s: power-cycle 3", Fault(action="power-cycle", moment=2.5, node=3)),
        ("at 2.5s: power-cycle all", Fault(action="power-cycle", moment=2.5)),
        ("exchange 30: unplug 0.5", Fault(30, None, "unplug", Side.DEVICE, seconds=0.5)),
        ("exchange 30 byte 2 to host: unplug 0.5", Fault(30, 2, "unplug", Side.HOST, seconds=0.5)),
        ("exchange 30: duplicate-id 0x25", Fault(30, None, "duplicate-id", node=0x25)),
        ("exchange 30: brown-out 0.2", Fault(30, None, "brown-out", seconds=0.2)),
        ("exchange 30: brown-out 0.2 3", Fault(30, None, "brown-out", seconds=0.2, node=3)),
        ("exchange 30: torn-eeprom 3", Fault(30, None, "torn-eeprom", node=3)),
    ],
)
def test_each_form(text: str, fault: Fault) -> None:
    assert parse(text) == Script((fault,))
    assert parse(str(fault)) == Script((fault,))


@pytest.mark.parametrize(
    "line",
    [
        "drop",
        "exchange: drop",
        "exchange 1 byte 2",
        "exchange 1 byte 2:",
        "exchange 1 byte 2: explode",
        "exchange 1 byte 2: drop 3",
        "exchange 1 byte 2: corrupt",
        "exchange 1 byte 2: corrupt 00",
        "exchange 1 byte 2: corrupt 100",
        "exchange 1 byte 2: flip 8",
        "exchange 1 byte 2: insert xy",
        "exchange 1 byte 2: delay 0",
        "exchange 1 byte 2: delay nan",
        "exchange 1 byte 2: delay soon",
        "exchange 1 packet 0: drop",
        "exchange 1: delay 0.5-0.02",
        "exchange 1: split 0.1-0.2",
        "exchange 1: split -1",
        "exchange 1 to host: echo",
        "exchange 1 byte 2 to nowhere: drop",
        "exchange 1 packet 2 byte 3: drop",
        "exchange 1: power-cycle",
        "exchange 1: torn-eeprom all",
        "exchange 1: brown-out 3 4 5",
        "0%: drop",
        "101%: drop",
        "1.2.3%: drop",
        "at -1 s: drop",
        "at 1 s byte 3: drop",
        "seed x",
        "seed 1; seed 2",
    ],
)
def test_nonsense_is_refused_with_its_line(line: str) -> None:
    with pytest.raises(RequestError, match=r"^line 3: .*(fault|seed)"):
        parse(f"# what\nexchange 1: drop\n{line}")


@given(scripts)
def test_a_printed_script_is_the_script(script: Script) -> None:
    assert parse(str(script)) == script
    assert parse(script.line) == script


@given(st.text(alphabet="exchange 17byt:%sdrop;#\n.-to", max_size=60))
def test_any_text_is_a_script_or_one_clear_error(text: str) -> None:
    try:
        script = parse(text)
    except RequestError as error:
        said = error.summary
        script = parse("" if said.startswith("line ") else said)
    assert parse(str(script)) == script


def test_chance_needs_a_seed_and_a_place_does_not() -> None:
    assert not parse("exchange 1 byte 2: corrupt 01").by_chance
    assert parse("1%: drop").by_chance
    assert parse("exchange 1: corrupt").by_chance
    assert parse("exchange 1: delay 0.1-0.2").by_chance
    assert parse("1%: drop").seeded(7).seed == 7
    assert parse("seed 3; 1%: drop").seeded(7).seed == 3
