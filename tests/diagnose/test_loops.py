"""A loop counted by simulated devices costs what the loop over an open machine of the same devices costs."""

from __future__ import annotations

import pytest

from motorbus import families
from motorbus.diagnose.budget import Transfer, budget
from motorbus.diagnose.loops import Wanted, count
from motorbus.errors import RequestError
from motorbus.families.kst.cli import budget_frames
from motorbus.session.robot import Robot
from tests.support.machines import machine


def test_it_is_what_an_open_machine_says() -> None:
    with machine(arm="1-6", can="0x25,0x26") as (made, _), Robot.of(made) as robot:
        there = robot.budget(100.0)
    for bus, address in (("arm", "feetech:/dev/x"), ("can", "kst:can://slcan/dev/x")):
        axes = {made.axes[name].node: name for name in there.buses[bus].axes}
        found = count(Wanted(address, axes))
        assert found is not None
        assert found.budget == there.buses[bus]
        assert found.goals + found.readings == pytest.approx(found.budget.wire)


def test_six_sts_servos_at_1_mbaud_reach_1136_hz() -> None:
    found = count(Wanted("feetech:/dev/x", {node: str(node) for node in range(1, 7)}))
    assert found is not None
    assert found.goals * 1e6 == pytest.approx(
        26 * 10
    )  # FF FF FE len inst addr size, 6 × (id, goal), checksum
    assert found.readings * 1e6 == pytest.approx((14 + 6 * 8) * 10)
    assert found.budget.highest_rate == pytest.approx(1136.36, abs=0.01)


def test_what_devices_think_counts_where_one_follows_the_other() -> None:
    axes = {1: "a", 2: "b"}
    line, can = Wanted("feetech:/dev/x", axes), Wanted("kst:can://slcan/dev/x", axes)
    for wanted, waits in ((line, 2 * 0.0005), (can, 0.0)):
        found = count(wanted, turnaround=0.0005)
        assert found is not None
        assert found.budget.waits == pytest.approx(waits)


def test_options_of_the_address_count() -> None:
    plain = count(Wanted("kst:can://slcan/dev/x", {1: "a"}))
    long = count(Wanted("kst:can://slcan/dev/x,id_format=ext", {1: "a"}))
    fast = count(Wanted("kst:can://slcan/dev/x,bitrate=1000000", {1: "a"}))
    assert plain is not None
    assert long is not None
    assert fast is not None
    assert long.budget.wire > plain.budget.wire
    assert fast.budget.wire == pytest.approx(plain.budget.wire / 2)


def test_whom_nobody_can_lead_costs_nothing_that_could_be_told() -> None:
    assert count(Wanted("stepper:/dev/x", {1: "slide"})) is None


@pytest.mark.parametrize(
    "wanted",
    [
        Wanted("nowhere", {1: "a"}),
        Wanted("feetech:/dev/x,baud=fast", {1: "a"}),
        Wanted("feetech:/dev/x", {1: "a"}, "abacus"),
        Wanted("feetech:/dev/x", {999: "a"}),
    ],
    ids=str,
)
def test_what_cannot_be_is_refused(wanted: Wanted) -> None:
    with pytest.raises(RequestError):
        count(wanted)


def test_on_can_it_lies_within_what_is_counted_to_the_bit() -> None:
    nodes = (0x21, 0x22, 0x23)
    found = count(Wanted("kst:can://slcan/dev/x", {node: str(node) for node in nodes}))
    assert found is not None
    frames = [
        Transfer(node, one)
        for node in nodes
        for one in budget_frames(families.load("kst").open(), node).values()
    ]
    exact = budget(frames, found.budget.bit_rate)
    assert exact.time.least < found.budget.wire < exact.time.most
