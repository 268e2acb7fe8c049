"""Reading and writing one object: which bytes leave, what is believed, and what a refusal becomes."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from motorbus.core.entry import Entry
from motorbus.core.operation import Answer, Effect, Exchange, Rank, Reply
from motorbus.errors import DeviceError, MotorbusError, UnexpectedReply
from motorbus.families.kst import driver, wire
from motorbus.families.kst.driver import dialect_of
from motorbus.families.kst.driver.exchanges import OtherSize, meant, order, sized, upload, upload_row, whole
from tests.families.kst.bench import abort, bench, node, play, watch

READ = "605#4002600000000000"
NO_SUCH = 0x0602_0000


def test_a_read_is_one_exchange_that_can_be_kept() -> None:
    one = node()
    exchange = upload_row(one, one.table["present_position"], int, tells_position=True)
    assert (exchange.lane, exchange.rank, exchange.effect) == (5, Rank.POLL, Effect.NONE)
    assert exchange.repeatable
    assert exchange.tells_position
    assert exchange.replies == (wire.upload_due(5, 0x6002),)
    for back, raw in (("4b02600084030000", 900), ("4b0260007cfc0000", -900), ("4302600084030000", 900)):
        assert play(exchange, (READ, back)) == raw
    assert play(exchange, (READ, "4202600001000000")) == 1  # length not stated: the object takes its own
    assert one.at > 100


@pytest.mark.parametrize(
    "back", ["4f02600001000000", "4102600008000000", "4302600000100100", "430260008403ffff"]
)
def test_a_value_of_another_size_is_no_value(back: str) -> None:
    one = node()
    with pytest.raises(OtherSize, match="and not in 2"):
        play(upload_row(one, one.table["present_position"], int), (READ, back))


def test_a_refusal_without_a_reason_is_told_with_what_it_may_have_been() -> None:
    with pytest.raises(DeviceError, match="refused node_id") as raised:
        play(order(one := node(), one.table["node_id"], 7), ("605#2200300007000000", abort(0x3000, 0)))
    assert raised.value.code == 0
    assert "may have made one of an acknowledgement" in raised.value.cause


ROWS = [row for row in node("kst-ext").table.values() if row.readable]
SPECIFIERS = st.one_of(st.sampled_from([0x4F, 0x4B, 0x47, 0x43, 0x42, 0x41, 0x80]), st.integers(0, 255))
RESTS = st.one_of(st.binary(max_size=9), st.binary(min_size=4, max_size=4), st.just(b"\x84\x03\x00\x00"))


def said_by(exchange: Exchange[int], data: bytes) -> object:
    """The value that these data of a reply come to, or all that its error says."""
    assert exchange.read is not None
    answer = Answer((Reply(5, None, data),), (), 100.0)
    try:
        return exchange.read(answer)
    except MotorbusError as error:
        return type(error), str(error), error.node, error.received, getattr(error, "__notes__", None)


@given(st.sampled_from(ROWS), SPECIFIERS, st.sampled_from([0, 0, 0, 1, 2, 3]), RESTS)
@example(node().table["present_position"], 0x4B, 0, b"\x84\x03\xff\xff")
@example(node().table["present_position"], 0x4B, 0, b"\x84\x03\xff")
def test_a_reply_that_is_read_as_it_is_comes_to_what_it_says_taken_apart(
    row: Entry, specifier: int, wrong: int, rest: bytes
) -> None:
    one, other = node("kst-ext"), node("kst-ext")
    index, subindex = row.address, row.subindex or 0
    head = bytes((specifier, index & 0xFF, index >> 8, subindex))
    data = bytes(byte ^ (wrong == at > 0) for at, byte in enumerate(head)) + rest
    apart = upload(other, index, subindex, lambda reply: row.decode(sized(other, row, reply)))
    assert said_by(upload_row(one, row, int), data) == said_by(apart, data)
    assert one.at == other.at


def test_a_refusal_is_told_in_the_manual_s_words() -> None:
    one = node()
    with pytest.raises(DeviceError, match="Object does not exist in the object dictionary") as raised:
        play(driver.position(one), (READ, abort(0x6002, NO_SUCH)))
    error = raised.value
    assert (error.code, error.register, error.node) == (NO_SUCH, "present_position", 5)
    assert not hasattr(error, "__notes__")


@pytest.mark.parametrize("index", [0x1010, 0])
def test_a_refusal_that_names_less_is_taken_and_says_so(index: int) -> None:
    one = node()
    with pytest.raises(DeviceError) as raised:
        play(
            order(one, one.table["store"], 0x65766173),
            ("605#2210100173617665", abort(index, 0x0800_0000)),
        )
    assert f"names 0x{index:04X}:0" in raised.value.__notes__[0]


def test_a_code_the_wrong_way_round_is_understood() -> None:
    assert meant(0x0000_0206) == NO_SUCH
    assert meant(NO_SUCH) == NO_SUCH
    assert meant(0x0F00_0009) == 0x0F00_0009


@pytest.mark.parametrize("code", [0x0504_0001, 0x0607_0010, 0x0607_0012, 0x0607_0013])
def test_who_refuses_a_write_without_length_gets_one_with_it_ever_after(code: int) -> None:
    one = node()
    row = one.table["node_id"]
    unsized, sized = "605#2200300007000000", "605#2F00300007000000"
    played = watch(order(one, row, 7), (unsized, abort(0x3000, code)), (sized, "6000300000000000"))
    assert [exchange.effect for exchange in played.exchanges] == [Effect.IDENTITY] * 2
    play(order(one, row, 7), (sized, "6000300000000000"))
    assert not one.dialect.states_length(6), "another node is another servo"


def test_other_refusals_are_no_reason_to_say_it_differently() -> None:
    one = node()
    with pytest.raises(DeviceError):
        play(order(one, one.table["node_id"], 7), ("605#2200300007000000", abort(0x3000, 0x0609_0030)))


def test_the_form_of_writes_can_be_set() -> None:
    frame, refusal = "605#2200300007000000", abort(0x3000, 0x0607_0010)
    never = node(sized="no")
    with pytest.raises(DeviceError):
        play(order(never, never.table["node_id"], 7), (frame, refusal))
    always = node(sized="yes")
    with pytest.raises(DeviceError):
        play(order(always, always.table["node_id"], 7), ("605#2F00300007000000", refusal))


def test_a_servo_that_takes_no_sized_write_is_written_to_all_the_same() -> None:
    with bench(accept_sized=False) as there:
        there.servo().move(0.2)
    with bench(accept_sized=False, settings={"sized": "yes"}) as there, pytest.raises(DeviceError):
        there.servo().move(0.2)


def test_a_servo_that_takes_only_sized_writes_gets_them() -> None:
    with bench(accept_unsized=False, profile="kst-ext") as there:
        there.servo().set_travel_limits(-0.5, 0.5)
        there.servo().move(0.2)
        assert "605#2203600073000000" not in there.sent(), "that was learnt from the limits"


# --- segments -----------------------------------------------------------------------------------------------

VERSION = "605#400A100000000000"
START = "410a10000a000000"


def test_a_long_text_is_taken_in_segments_with_the_bus_alone() -> None:
    one = node()
    script = [
        (VERSION, START),
        (VERSION, START),
        ("605#6000000000000000", "00" + b"V2.10-r".hex()),
        ("605#7000000000000000", "19" + b"c42".hex() + "00000000"),
    ]
    played = watch(driver.version(one), *script)
    assert played.alone == 1
    assert play(driver.version(one), *script) == "V2.10-rc42"


def test_a_text_of_another_length_than_announced_is_no_text() -> None:
    one = node()
    with pytest.raises(UnexpectedReply, match="announced 10 bytes"):
        play(
            whole(one, one.table["firmware_version"]),
            (VERSION, START),
            (VERSION, START),
            ("605#6000000000000000", "01" + b"V2.10-r".hex()),
        )


def test_a_text_without_end_is_given_up() -> None:
    one = node()
    endless = [(f"605#{60 + 10 * (n % 2)}00000000000000", f"{10 * (n % 2):02}" + "41" * 7) for n in range(37)]
    with pytest.raises(UnexpectedReply, match="does not end"):
        play(
            whole(one, one.table["firmware_version"]),
            (VERSION, START),
            (VERSION, START),
            *endless,
            ("605#800A100000000008", None),
        )


def test_segments_with_nothing_in_them_do_not_go_on_for_ever() -> None:
    one = node()
    with pytest.raises(UnexpectedReply, match="does not end"):
        play(
            whole(one, one.table["firmware_version"]),
            (VERSION, START),
            (VERSION, START),
            ("605#6000000000000000", "0e00000000000000"),
            ("605#800A100000000008", None),
        )


def test_long_versions_of_the_simulator() -> None:
    with bench(firmware="KST X20-3612 V1.07 2026", ids=(5, 6)) as there:
        assert there.servo().version() == "KST X20-3612 V1.07 2026"
        assert [one.identity and one.identity.firmware for one in there.run(there.family.scan())] == [
            "KST X20-3612 V1.07 2026"
        ] * 2
        assert "firmware_version" not in there.servo().read()
        with pytest.raises(UnexpectedReply):
            there.servo().read("firmware_version")


def test_the_simulator_s_refusals_whatever_they_repeat() -> None:
    for mux in ("echo", "index-only", "zero"):
        for turned in ("little", "big"):
            with bench(abort_mux=mux, abort_order=turned) as there:
                servo = there.servo()
                assert servo.bit_rate() is None
                with pytest.raises(DeviceError):
                    there.run(order(servo, servo.table["present_position"], 0))
                assert servo.position() == 0.0
                assert dialect_of(there.family).memory is not None
