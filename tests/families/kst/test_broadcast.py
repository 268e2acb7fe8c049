"""Requests to all servos of a bus."""

from __future__ import annotations

import pytest

from motorbus.core.family import IdChanged
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.kst import (
    Started,
    broadcast_bit_rate,
    broadcast_node_id,
    broadcast_position,
    broadcast_read,
    broadcast_save,
)
from tests.families.kst.bench import Bench
from tests.simulators.kst.host import SAVE, frame


def test_broadcast_read_leaves_out_duplicates_refusals_and_silence() -> None:
    with Bench(1, 2, 3, 4, duplicate="2", duplicate_delay=0.0003, profile="kst-ext") as bench:
        for number, servo in enumerate(bench.simulator.servos):
            servo.raw_position = 10 * number
        bench[4].unplug()
        found = bench.bus.run(broadcast_read("present_position", bench.settings))
        assert found == {1: 0.0, 3: pytest.approx(0.0349, abs=1e-4)}
        assert bench.sent() == ["600#4002600000000000"]
        with pytest.raises(RequestError, match="can only be written"):
            bench.bus.run(broadcast_read("bit_rate_code", bench.settings))
        assert bench.sent() == []
    with Bench(1, settings={"profile": "kst-ext"}) as bench:
        assert bench.bus.run(broadcast_read("status", bench.settings)) == {}


@pytest.mark.parametrize(("profile", "start"), [("kst", ""), ("xqpower", "000#0100")])
def test_broadcast_position_starts_and_moves_all(profile: str, start: str) -> None:
    with Bench(1, 2, profile=profile) as bench:
        nodes = bench.bus.run(broadcast_position(0.2, (1, 2), bench.settings))
        assert sorted(nodes) == [1, 2]
        raw = bench[1].memory["goal_position"]
        assert raw == bench[2].memory["goal_position"] == {"kst": 115, "xqpower": 206}[profile]
        assert bench.sent() == [*filter(None, [start]), f"600#22036000{raw:02X}000000"]
        assert bench.of(Started) == ([Started(0, frame(start))] if start else [])


def test_broadcast_position_without_servos_or_out_of_range_is_refused() -> None:
    with Bench(1) as bench:
        with pytest.raises(RequestError, match="moves all servos"):
            bench.bus.run(broadcast_position(0.1, (), bench.settings))
        with pytest.raises(LimitExceeded):
            bench.bus.run(broadcast_position(9.0, (1,), bench.settings))
        assert bench.sent() == []


@pytest.mark.parametrize("reply", ["none", "ack"])
def test_broadcast_bit_rate_and_save_change_all(reply: str) -> None:
    with Bench(1, 2, save_reply=reply) as bench:
        assert bench.bus.run(broadcast_bit_rate(250_000, bench.settings)) == (1, 2)
        start = bench.link.now()
        assert bench.bus.run(broadcast_save(bench.settings)) == ((1, 2) if reply == "ack" else ())
        assert bench.link.now() - start >= 0.15
        assert bench.sent() == ["600#2201300004000000", f"600#{SAVE}"]
        for servo in bench.simulator.servos:
            servo.power_cycle()
        assert [servo.bit_rate for servo in bench.simulator.servos] == [250_000] * 2


def test_broadcast_node_id_needs_force() -> None:
    with Bench(1, 2) as bench:
        for call in (broadcast_node_id(9, bench.settings), broadcast_node_id(0, bench.settings, force=True)):
            with pytest.raises(RequestError):
                bench.bus.run(call)
        assert bench.sent() == []
        assert bench.bus.run(broadcast_node_id(9, bench.settings, force=True)) == (1, 2)
        assert bench.of(IdChanged) == [IdChanged(None, 9)]
        assert [servo.memory["node_id"] for servo in bench.simulator.servos] == [9, 9]
