"""What several servos feel, in one exchange: the quick way says what `state_of` says of each, or that it must ask."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import motorbus
from motorbus import feetech
from motorbus.core.operation import UNLIKE, Exchange
from motorbus.errors import RequestError
from motorbus.families.feetech.driver import Node, sync_read_positions, sync_read_raw, sync_read_states
from motorbus.families.feetech.driver.feedback import FEEDBACK, state_of
from tests.families.feetech.driver_script import packet, play, sync_reads
from tests.families.feetech.maps import met
from tests.families.feetech.test_driver_gauge import AT, LITTLE, is_same, slowly

RAWS = st.sampled_from((0, 1, 0x7FFF, 0x8000, 0xFFFF)) | st.integers(0, 65535)


def block(raws: list[int]) -> bytes:
    """A feedback block of these, two bytes each, and one more."""
    return b"".join(raw.to_bytes(2, "little") for raw in raws)[:FEEDBACK]


BLOCKS = st.lists(RAWS, min_size=8, max_size=8).map(block)


@given(
    st.lists(st.sampled_from(LITTLE), min_size=1, max_size=3),
    st.booleans(),
    st.sampled_from((0, 0, 1)),
    st.data(),
)
def test_the_quick_way_says_what_the_slow_way_says(
    maps: list[tuple[str, dict[str, int]]], longer: bool, alarm: int, draw: st.DataObject
) -> None:
    nodes = [met(name, id, **settings) for id, (name, settings) in enumerate(maps)]
    exchange: Exchange[Any] = sync_read_states(nodes)
    if longer:
        assert exchange.other is not None
        exchange = exchange.other()
    datas = [draw.draw(BLOCKS) for _ in nodes]
    rest = (9,) if longer else ()
    heads = [alarm, 0, 0]
    data = b"".join(packet(id, heads[id], *one, *rest) for id, one in enumerate(datas))
    quick = is_same(exchange, data)
    assert not (quick and alarm)
    found = slowly(exchange, data)
    for node, one in zip(nodes, datas, strict=True):
        assert node.table is not None
        assert found.values[node.node] == state_of(node, node.table, one)
    spoilt = bytearray(data)
    spoilt[draw.draw(st.integers(0, len(data) - 1))] ^= draw.draw(st.integers(1, 255))
    assert not is_same(exchange, bytes(spoilt))
    nodes[-1].settings = met("sts", at_30=2).settings
    assert not is_same(exchange, data)


@pytest.mark.parametrize("name", ["sts", "smbl", "smcl", "hls"])
def test_what_is_usual_goes_the_quick_way(name: str) -> None:
    exchange: Any = sync_read_states([met(name, 1), met(name, 2)])
    usual = (0, 8, 10, 0x80, 0, 0, 120, 30, 0, 0, 1, 0, 0, 5, 0)
    data = packet(1, 0, *usual) + packet(2, 0, *usual)
    assert is_same(exchange, data)
    found = exchange.whole(data, AT)
    assert (found.missing, found.at, set(found.values)) == ((), AT, {1, 2})
    assert exchange.whole(packet(2, 0, *usual) + packet(1, 0, *usual), AT) is UNLIKE
    assert exchange.whole(data[:-1], AT) is UNLIKE


def test_who_is_silent_is_missing_and_who_has_an_alarm_says_so() -> None:
    nodes = [met("sts", 1), met("sts", 2)]
    line = sync_reads(56, {1: None, 2: (0, 8, *(0 for _ in range(13)))}, FEEDBACK)
    assert isinstance(line.back, list)
    found = play(sync_read_states(nodes), line._replace(back=[packet(2, 1, *line.back[0][5:-1])]))
    assert found.missing == (1,)
    assert found.values[2].alarm == ("voltage",)


def test_a_servo_that_may_not_be_asked_so_is_refused_before_anything_is_sent() -> None:
    for servos, why in (
        ([Node(1)], "not prepared"),
        ([met("scs", 1)], "no SYNC READ"),
        ([met("sts", id) for id in range(40)], "more than 4 ms of air"),
        ([met("sts", 1), met("sts", 1)], "named twice"),
    ):
        for make in (
            lambda servos=servos: sync_read_states(servos),
            lambda servos=servos: sync_read_raw(56, 15, servos),
        ):
            with pytest.raises(RequestError, match=why) as caught:
                make()
            assert "nothing was sent" in caught.value.advice


@pytest.mark.parametrize(("address", "count"), [(56, 2), (250, 6), (254, 1), (255, 1), (0, 251), (0, 253)])
def test_raw_bytes_come_whole_again_and_again_also_at_the_end_of_the_table(address: int, count: int) -> None:
    with motorbus.simulate("feetech", ids="1-2") as sim, motorbus.open(sim.url) as bus:
        servos = [feetech.Servo(bus, id) for id in (1, 2)]
        bus.run(feetech.prepare_all(servos))
        exchange = sync_read_raw(address, count, servos, air=0.01)
        for _ in range(4):
            assert {id: len(data) for id, data in bus.run(exchange).items()} == {1: count, 2: count}


@pytest.mark.parametrize(("address", "count"), [(0, 0), (0, 254), (255, 2), (-1, 2)])
def test_raw_bytes_that_do_not_exist_are_refused(address: int, count: int) -> None:
    with pytest.raises(RequestError, match="do not exist"):
        sync_read_raw(address, count, [met("sts", 1)])


@pytest.mark.parametrize("ask", [sync_read_states, sync_read_positions, partial(sync_read_raw, 56, 2)])
@pytest.mark.parametrize("servos", [None, 5, met("sts", 1)])
def test_what_is_no_list_of_servos_is_refused(ask: Any, servos: Any) -> None:
    with pytest.raises(RequestError, match="is no list of servos") as caught:
        ask(servos)
    assert "nothing was sent" in caught.value.advice


@pytest.mark.parametrize("wrong", ["56", 56.0, None, True, "present_position", [56], 1j])
def test_an_address_and_a_count_are_whole_numbers(wrong: Any) -> None:
    nodes = [met("sts", 1)]
    for address, count, word in ((wrong, 2, "address"), (56, wrong, "count")):
        with pytest.raises(RequestError, match=f"{word}: .* is not a whole number") as caught:
            sync_read_raw(address, count, nodes)
        assert "nothing was sent" in caught.value.advice
