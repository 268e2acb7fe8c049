"""A script says what it means, prints itself, and says of nonsense which line it is and what is near."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

import motorbus
from motorbus.errors import RequestError
from motorbus.link.base import Side
from motorbus.simulation.faults import ANY, Fault, Script, parse
from motorbus.simulation.faults.fault import FARTHEST
from motorbus.simulation.faults.script import as_script, is_meant, requested
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
        ("exchange 5: merge", Fault(5, None, "merge")),
        ("exchange 5: echo", Fault(5, None, "echo", Side.DEVICE)),
        ("exchange 5: echo 6", Fault(5, None, "echo", Side.DEVICE, value=6)),
        ("exchange 5: split", Fault(5, None, "split")),
        ("exchange 5: split 0.01", Fault(5, None, "split", seconds=0.01)),
        ("exchange 5: reorder", Fault(5, None, "reorder")),
        ("exchange 5: stall 2", Fault(5, None, "stall", seconds=2.0)),
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
        ("exchange 30: clock-step 3600", Fault(30, None, "clock-step", seconds=3600.0)),
        (
            "1% of bytes on adapter: flip",
            Fault(action="flip", percent=1.0, per_byte=True, value=ANY, adapter=True),
        ),
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
        "exchange 1 byte 2: merge",
        "exchange 1 packet 0: drop",
        "exchange 1: delay 0.5-0.02",
        "exchange 1: stall 0.1-0.2",
        "exchange 1: split -1",
        "exchange 1 to host: echo",
        "exchange 1 byte 2 to nowhere: drop",
        "exchange 1 packet 2 byte 3: drop",
        "exchange 1: power-cycle",
        "exchange 1: torn-eeprom all",
        "exchange 1: brown-out 3 4 5",
        "exchange 1: delay 0.1 on adapter",
        "exchange 1 on adapter: delay 0.1",
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


@pytest.mark.parametrize(
    ("line", "near"),
    [
        ("exchnge 1: drop", "`exchange`"),
        ("exchange 1 byt 2: drop", "`byte`"),
        ("exchange 1: corupt", "corrupt"),
        ("exchange 1: power_cycle 3", "power-cycle"),
        ("exchange 1: torn-eprom 3", "torn-eeprom"),
    ],
)
def test_what_is_near_is_said(line: str, near: str) -> None:
    with pytest.raises(RequestError, match=near):
        parse(line)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("exchange -1: drop", "exchanges are counted from 1"),
        ("at exchange +1: drop", "exchanges are counted from 1"),
        ("exchange 1 packet -2: drop", "packets are counted from 1"),
        ("exchange 1 byte -3: drop", "bytes are counted from 0"),
        ("exchange 1 byte -3", "bytes are counted from 0"),
        ("-5%: drop", "a chance is more than 0 and at most 100 %"),
        ("-.5e1 % of bytes: corrupt", "a chance is more than 0 and at most 100 %"),
        ("at -1 s: power-cycle 1", "a moment is counted from the beginning"),
        ("exchange 1: drop on adapter", "`on adapter` stands before the colon"),
        ("exchange 1: delay 0.1 to  device", "`to device` stands before the colon"),
        (f"exchange {10**32}: drop", "no run comes that far"),
        (f"exchange 1 byte {FARTHEST + 1}: drop", "no run comes that far"),
        (f"exchange 1 packet {FARTHEST + 1}: drop", "no run comes that far"),
    ],
)
def test_what_is_wrong_with_a_place_is_said(line: str, why: str) -> None:
    with pytest.raises(RequestError, match=r"^line 1: .* is not a fault: ") as caught:
        parse(line)
    assert why in caught.value.summary


def test_the_farthest_place_is_told_and_can_be_said() -> None:
    assert len(parse(f"exchange {FARTHEST} byte {FARTHEST}: drop; exchange 1 packet {FARTHEST}: drop")) == 2
    with pytest.raises(RequestError) as caught:
        parse(f"exchange {FARTHEST + 1}: drop")
    assert caught.value.expected == "exchanges, packets and bytes up to 1,000,000,000,000"
    with pytest.raises(RequestError) as caught:
        parse("exchange 3: drop on adapter")
    assert caught.value.expected == "the place first, as `exchange 17 on adapter: drop`"


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


def test_a_script_is_text_faults_or_itself() -> None:
    fault = Fault(1, 2, "drop")
    assert as_script("exchange 1 byte 2: drop") == as_script([fault]) == as_script(Script((fault,)))
    assert list(as_script([fault])) == [fault]
    assert len(as_script([fault])) == 1


@pytest.mark.parametrize(
    "line",
    [
        f"exchange {'9' * 5000}: drop",
        f"exchange 1 byte {'9' * 5000}: drop",
        f"seed {'9' * 5000}",
        f"exchange 1: echo {'9' * 5000}",
        f"exchange 1: power-cycle 0x{'f' * 5000}",
        f"exchange 1: brown-out 1 0x{'f' * 5000}",
        f"exchange 1: {'x' * 5000}",
        "x" * 5000,
        "exchange 1: corrupt -1",
        "exchange 1: insert -1",
        "exchange 1: flip -1",
    ],
)
def test_numbers_beyond_all_measure_are_refused_in_few_words(line: str) -> None:
    with pytest.raises(RequestError, match="^line 2: ") as caught:
        parse(f"seed\t1\n{line}" if not line.startswith("seed") else f"\n{line}")
    assert len(str(caught.value)) < 700


@pytest.mark.parametrize(
    "line",
    [
        f"{before}{number}{behind}"
        for number in (
            "1_0",
            "+5",
            "\u0661",
            "\uff11",
            "0b1",
            "0o7",
            "nan",
            "inf",
            "Infinity",
            "1e400",
            "1e1_0",
        )
        for before, behind in (
            ("exchange ", ": drop"),
            ("exchange 1 byte ", ": drop"),
            ("exchange 1 packet ", ": drop"),
            ("", "%: drop"),
            ("", "% of bytes: drop"),
            ("at ", " s: drop"),
            ("seed ", ""),
            ("exchange 1: echo ", ""),
            ("exchange 1 byte 2: flip ", ""),
            ("exchange 1: flip ", ""),
            ("exchange 1: delay ", ""),
            ("exchange 1: delay 0.1-", ""),
            ("exchange 1: split ", ""),
            ("exchange 1: power-cycle ", ""),
            ("exchange 1: brown-out 1 ", ""),
            ("exchange 1: brown-out ", ""),
        )
    ]
    + ["exchange 1: power-cycle 01", "exchange 1: delay 1,5", "exchange 1: delay .", "exchange 1: delay 1e"]
    + [
        f"exchange 1 byte 2: {word} {number}"
        for word in ("corrupt", "insert")
        for number in ("1_0", "+5", "\u0661", "\uff11", "0o7", "0x", "0x_1", "-0", "nan")
    ],
)
def test_a_number_is_digits_as_people_write_them(line: str) -> None:
    with pytest.raises(RequestError, match="^line 2: "):
        parse(f"exchange 1: drop\n{line}")


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("exchange 1 byte 2: corrupt 0x8f", Fault(1, 2, "corrupt", value=0x8F)),
        ("exchange 1 byte 2: insert 0aB", Fault(1, 2, "insert", value=0xAB)),
        ("exchange 1: delay .5", Fault(1, None, "delay", seconds=0.5)),
        ("exchange 1: delay 5.", Fault(1, None, "delay", seconds=5.0)),
        ("exchange 1: delay 1E-3", Fault(1, None, "delay", seconds=1e-3)),
        ("exchange 1: power-cycle 0X1f", Fault(1, None, "power-cycle", node=0x1F)),
        ("exchange 007: drop", Fault(7, None, "drop")),
    ],
)
def test_a_number_that_people_write_in_other_ways(line: str, fault: Fault) -> None:
    assert parse(line) == Script((fault,))


@pytest.mark.parametrize("text", ["seed 3", "# nothing", "\n"])
def test_who_asks_for_a_script_without_a_fault_is_told(text: str) -> None:
    assert len(parse(text)) == len(requested("")) == len(requested(())) == 0
    asks: list[Callable[[], object]] = [
        lambda: requested(text),
        lambda: motorbus.simulate("feetech", faults=text),
        lambda: motorbus.open("feetech:sim,ids=1", faults=text),
    ]
    for ask in asks:
        with pytest.raises(RequestError, match="there is no fault in it"):
            ask()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "exchange 17 byte 3; drop",
            "line 1: 'exchange 17 byte 3' is not a fault: it does not say what goes wrong",
        ),
        (
            "seed 1\nexchange 17:",
            "line 2: 'exchange 17:' is not a fault: it does not say what goes wrong there",
        ),
        ("1% of bytes", "'1% of bytes' is not a fault: it does not say what goes wrong there"),
        ("drop", "'drop' is not a fault: it does not say where"),
        (": delay 0.1", "': delay 0.1' is not a fault: it does not say where"),
        ("drop: ", "'drop:' is not a fault: it does not say where"),
        ("exchange 17 drop", "'exchange 17 drop' is not a fault: there is no colon before drop"),
        ("seed x", "'seed x' is no seed"),
        ("seed", "'seed' is no seed"),
    ],
)
def test_what_a_part_lacks_is_said(text: str, says: str) -> None:
    with pytest.raises(RequestError) as caught:
        parse(text)
    assert says in caught.value.summary
    assert caught.value.expected


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1%: stall 0", "line 1: '1%: stall 0' is not a fault: impossible stall"),
        (
            "exchange 1 byte 2: echo",
            "line 1: 'exchange 1 byte 2: echo' is not a fault: echo is for a whole packet",
        ),
        (
            "exchange 1 on adapter: delay 1",
            "'exchange 1 on adapter: delay 1' is not a fault: delay cannot be done to",
        ),
        ("101%: drop", "line 1: '101%: drop' is not a fault: impossible chance"),
        ("1%: stall x:y", "line 1: '1%: stall x:y' is not a fault: impossible 'x:y'"),
    ],
)
def test_a_fault_that_is_impossible_is_said_once(text: str, says: str) -> None:
    with pytest.raises(RequestError) as caught:
        parse(text)
    assert says in caught.value.summary
    assert caught.value.summary.count("fault") == 1


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("seed 1", True),
        ("drop", True),
        ("exchange 1", True),
        ("exchange 1: x", True),
        ("# nothing", True),
        ("noise", False),
        ("exchange.txt", False),
        ("/tmp/noise; more", False),
        ("\0", False),
    ],
)
def test_a_script_is_told_from_the_name_of_a_file(text: str, meant: bool) -> None:
    assert is_meant(text) is meant
