"""Requests to all servos of a bus."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from motorbus.core.family import IdChanged
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.kst import broadcast_write
from motorbus.families.kst.profiles import SAVE as LETTERS
from tests.families.kst.bench import Bench
from tests.simulators.kst.host import SAVE


def write(bench: Bench, name: str, value: float, **how: Any) -> tuple[int, ...]:
    return bench.bus.run(broadcast_write(name, value, bench.settings, **how))


@pytest.mark.parametrize(("profile", "start"), [("kst", ""), ("xqpower", "000#0100")])
def test_broadcast_of_a_target_starts_and_moves_all(profile: str, start: str) -> None:
    with Bench(1, 2, profile=profile) as bench:
        assert sorted(write(bench, "goal_position", 0.2, nodes=(1, 2))) == [1, 2]
        raw = bench[1].memory["goal_position"]
        assert raw == bench[2].memory["goal_position"] == {"kst": 115, "xqpower": 206}[profile]
        assert bench.sent() == [*filter(None, [start]), f"600#22036000{raw:02X}000000"]


@pytest.mark.parametrize(
    ("name", "value", "how", "error"),
    [
        ("goal_position", 0.1, {}, RequestError),
        ("goal_position", 9.0, {"nodes": (1,)}, LimitExceeded),
        ("goal_position", nan, {"nodes": (1,)}, LimitExceeded),
        ("goal_position", 0.1, {"nodes": (1, 0)}, RequestError),
        ("present_position", 0.1, {}, RequestError),
        ("node_id", 9, {}, RequestError),
        ("node_id", 0, {"force": True}, RequestError),
        ("bit_rate_code", 8, {}, RequestError),
    ],
)
def test_impossible_broadcast_is_refused(
    name: str, value: float, how: dict[str, Any], error: type[Exception]
) -> None:
    with Bench(1) as bench:
        with pytest.raises(error):
            write(bench, name, value, **how)
        assert (bench.sent(), bench.of(IdChanged)) == ([], [])


@pytest.mark.parametrize("reply", ["none", "ack"])
def test_broadcast_of_bit_rate_and_save_changes_all(reply: str) -> None:
    with Bench(1, 2, save_reply=reply) as bench:
        assert write(bench, "bit_rate_code", 4) == (1, 2)
        start = bench.link.now()
        assert write(bench, "store", LETTERS) == ((1, 2) if reply == "ack" else ())
        assert bench.link.now() - start >= 0.15
        assert bench.sent() == ["600#2201300004000000", f"600#{SAVE}"]
        for servo in bench.simulator.servos:
            servo.power_cycle()
        assert [servo.bit_rate for servo in bench.simulator.servos] == [250_000] * 2


def test_broadcast_of_a_node_id_is_announced() -> None:
    with Bench(1, 2) as bench:
        assert write(bench, "node_id", 9, force=True) == (1, 2)
        assert bench.of(IdChanged) == [IdChanged(None, 9)]
        assert [servo.memory["node_id"] for servo in bench.simulator.servos] == [9, 9]
