"""How a bus is spoken to: impossible settings are named with the choices, and only a configured bus remembers."""

from __future__ import annotations

import pytest

from motorbus.core.operation import CanFrame
from motorbus.errors import NoReply, RequestError
from motorbus.families.kst import FAMILY, wire
from motorbus.families.kst.driver import PLAIN, Dialect, Ear, Memory, dialect_of, window
from motorbus.families.kst.driver.dialect import ALARM_HELD, LOW_VOLTAGE
from tests.families.kst.bench import bench


@pytest.mark.parametrize(
    ("setting", "value", "choice"),
    [
        ("profile", "futaba", "xqpower"),
        ("id_format", "both", "auto"),
        ("sized", "maybe", "no"),
        ("nmt", "vendro", "vendor"),
        ("window", "0", "1 to 127"),
        ("window", "many", "1 to 127"),
        ("colour", "red", "id_format"),
    ],
)
def test_an_impossible_setting_is_refused_with_the_choices(setting: str, value: str, choice: str) -> None:
    with pytest.raises(RequestError, match=setting) as raised:
        FAMILY.configured(**{setting: value})
    assert choice in raised.value.expected


def test_settings_may_be_text_or_values() -> None:
    assert dialect_of(FAMILY.configured(sized=True)).sized == "yes"
    assert dialect_of(FAMILY.configured(sized=False)).sized == "no"
    assert dialect_of(FAMILY.configured(profile="KST-EXT")).profile.name == "kst-ext"
    assert window("0x10") == window(16) == 16


def test_an_alarm_outlives_whoever_asks_before_he_knows_the_time() -> None:
    with bench() as there:
        there.sim().voltage = 1.0
        there.servo().ping()
        assert there.servo().alarm == (LOW_VOLTAGE,)
        assert there.servo().telemetry().alarm == (LOW_VOLTAGE,)


def test_any_reply_teaches_the_id_format() -> None:
    memory = Memory()
    Ear(frozenset({False, True}), memory).feed(CanFrame(0x585, bytes.fromhex("6003600000000000"), True))
    assert Dialect(id_format="auto", memory=memory).extended(5) is True


def test_nothing_is_learnt_without_a_memory() -> None:
    PLAIN.learn_format(5, True)
    PLAIN.learn_sized(5)
    assert (PLAIN.extended(5), PLAIN.states_length(5), PLAIN.alarm(5, 1.0), PLAIN.memory) == (
        False,
        False,
        (),
        None,
    )


def test_what_is_no_family_of_ours_is_spoken_to_as_the_manual_says() -> None:
    assert dialect_of(None) is PLAIN
    assert dialect_of(FAMILY) is PLAIN


@pytest.mark.parametrize(
    ("id_format", "formats"), [("std", {False}), ("ext", {True}), ("auto", {False, True})]
)
def test_answers_are_expected_in_the_formats_of_the_setting(id_format: str, formats: set[bool]) -> None:
    dialect = Dialect(id_format=id_format)
    assert dialect.formats == formats
    assert dialect.extended(5) is (id_format == "ext")
    assert dialect.undecided(5) is (id_format == "auto")


def test_another_make_on_the_same_bus_shares_what_was_learnt() -> None:
    bus = Dialect("kst", "auto", memory=Memory())
    other = bus.like("xqpower")
    bus.learn_format(5, True)
    assert (other.profile.name, other.nmt, other.extended(5)) == ("xqpower", "standard", True)
    assert Dialect(nmt="vendor").like("xqpower").nmt == "vendor"


def test_an_alarm_is_shown_for_a_while_after_it_was_heard() -> None:
    memory = Memory()
    ear = Ear(frozenset({False}), memory)
    dialect = Dialect(memory=memory)
    assert [event.kind for event in ear.feed(wire.encode_alarm(5))] == ["alarm"]  # type: ignore[union-attr]
    assert dialect.alarm(6, 10.0) == ()
    assert dialect.alarm(5, 10.0) == (LOW_VOLTAGE,)
    assert dialect.alarm(5, 10.0 + ALARM_HELD) == (LOW_VOLTAGE,)
    assert dialect.alarm(5, 10.1 + ALARM_HELD) == ()
    ear.feed(wire.encode_alarm(5, b"\x0b\x02\x00\x00"))
    assert dialect.alarm(5, 20.0) == ("alarm 0B 02 00 00",)
    assert ear.flush() == []


def test_frames_and_errors_are_counted_apart() -> None:
    memory = Memory()
    ear = Ear(frozenset({False}), memory)
    ear.feed(CanFrame(1 << 29, bytes(8)))
    ear.feed(wire.encode_upload(5, 0x6002))
    assert (memory.frames, memory.errors) == (1, 1)


def test_auto_finds_out_which_format_a_node_answers_and_asks_once() -> None:
    with bench(settings={"id_format": "auto"}, id_format="ext") as there:
        servo = there.servo()
        assert servo.position() == 0.0
        assert there.sent() == [
            "605#4000300000000000",
            "00000605#4000300000000000",
            "00000605#4002600000000000",
        ]
        assert there.servo().position() == 0.0
        assert there.sent() == ["00000605#4002600000000000"]
        servo.move(0.1, wait=False)
        assert there.estop().acknowledged == (5,)
        assert all(frame.startswith("00000605#") for frame in there.sent())


def test_auto_prefers_eleven_bits_and_says_who_is_silent() -> None:
    with bench(settings={"id_format": "auto"}) as there:
        assert there.servo().ping() is True
        assert there.sent() == ["605#4000300000000000"] * 2
        with pytest.raises(NoReply):
            there.servo(6).position()
        assert there.servo(6).ping() is False


def test_twenty_nine_bits_by_setting() -> None:
    with bench(settings={"id_format": "ext"}, id_format="ext") as there:
        assert there.servo().identify().details["id_format"] == "ext"
        there.servo().move(0.3)
        assert [one.node for one in there.run(there.family.scan())] == [5]
        assert all(frame.index("#") == 8 for frame in there.sent())
