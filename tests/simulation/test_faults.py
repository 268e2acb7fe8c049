"""Faults by script: what they are parsed from, and what they do to packets, ports and devices."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import motorbus
from motorbus.core.can_frame import CanFrame
from motorbus.errors import LinkLost, MotorbusError, NoReply, PortNotFound, RequestError
from motorbus.families.feetech.simulator import simulate
from motorbus.link.base import Delivery, Side
from motorbus.session import open as open_bus
from motorbus.session import simulate as simulate_bus
from motorbus.simulation.faults import KINDS, LONGEST, Fault, parse
from motorbus.simulation.faulty import BROKEN, FaultyBus

REQUEST, REPLY = b"request", b"reply"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("1%: drop", Fault("drop", percent=1.0)),
        ("0.5 % to device : corrupt", Fault("corrupt", percent=0.5, to=Side.DEVICE)),
        ("exchange 17: delay 0.2", Fault("delay", exchange=17, seconds=0.2)),
        ("1%: delay 0.01-0.3", Fault("delay", percent=1.0, seconds=0.01, until=0.3)),
        ("exchange 3: echo", Fault("echo", exchange=3, to=Side.DEVICE)),
        ("at 2.5 s: unplug 0.5", Fault("unplug", moment=2.5, to=Side.DEVICE, seconds=0.5)),
        ("at 0s: power-cycle 0x25", Fault("power-cycle", moment=0.0, to=Side.DEVICE, node=0x25)),
        ("2%: brown-out 0.1 3", Fault("brown-out", percent=2.0, to=Side.DEVICE, seconds=0.1, node=3)),
    ],
)
def test_a_fault_from_text(text: str, fault: Fault) -> None:
    assert parse(text).faults == (fault,)


def test_a_script_has_lines_comments_and_a_seed() -> None:
    script = parse("seed 7; 1%: drop  # noise\n\n# all\nat 1 s: unplug 2;")
    assert (script.seed, len(script.faults)) == (7, 2)
    assert str(script) == "seed 7; 1%: drop; at 1 s: unplug 2"
    assert parse("") == parse("# nothing") == ((), 0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("drop", "no place"),
        ("1: drop", "no place"),
        ("exchange 1 byte 3: drop", "no place"),
        ("1%: dorp", "did you mean drop"),
        ("1%:", "there is no kind"),
        ("0%: drop", "more than 0"),
        ("101%: drop", "at most 100"),
        ("1e999%: drop", "not possible"),
        ("exchange 0: drop", "1 or more"),
        ("at -1 s: drop", "0 or more"),
        ("1%: delay", "delay SECONDS"),
        ("1%: delay 0", "not possible"),
        ("1%: delay 0.3-0.1", "range does not fit"),
        ("at 1 s: unplug 1-2", "range does not fit"),
        ("1%: drop 3", "do not fit"),
        ("at 1 s: unplug 1 2", "do not fit"),
        ("1%: power-cycle x", "not a number"),
        ("1% to host: echo", "no direction"),
        ("1% to host: unplug 1", "no direction"),
        ("seed x", "not a seed"),
        ("seed 1 2", "not a seed"),
    ],
)
def test_text_that_is_no_fault(text: str, message: str) -> None:
    with pytest.raises(RequestError) as caught:
        parse(text)
    assert message in str(caught.value)


@st.composite
def faults(draw: st.DrawFn) -> Fault:
    name = draw(st.sampled_from(sorted(KINDS)))
    kind = KINDS[name]
    place: dict[str, Any] = draw(
        st.one_of(
            st.fixed_dictionaries({"percent": st.floats(1e-6, 100)}),
            st.fixed_dictionaries({"exchange": st.integers(1, 10**9)}),
            st.fixed_dictionaries({"moment": st.floats(0, LONGEST)}),
        )
    )
    place = {
        key: float(f"{value:.15g}") if isinstance(value, float) else value for key, value in place.items()
    }
    side = draw(st.sampled_from(Side)) if kind.packet and name != "echo" else Side.DEVICE
    seconds = float(f"{draw(st.floats(1e-6, LONGEST)):.15g}") if kind.seconds else 0.0
    node = draw(st.none() | st.integers(0, 500)) if kind.node else None
    until = LONGEST if kind.until and seconds < LONGEST and draw(st.booleans()) else 0.0
    return Fault(name, to=side, seconds=seconds, until=until, node=node, **place)


@given(faults())
def test_a_fault_prints_as_the_text_of_itself(fault: Fault) -> None:
    assert parse(str(fault)).faults == (fault,)


def faulty(script: str) -> FaultyBus:
    bus = FaultyBus(simulate((1, 2)), lambda seconds: None)
    bus.set(script, 0.0)
    return bus


def arrivals(script: str, exchanges: int = 1) -> list[list[Delivery]]:
    """What arrives of a request and its reply, sent at the seconds 0, 1, 2 …"""
    bus = faulty(script)
    return [
        [*bus.carry(Side.HOST, REQUEST, at), *bus.carry(Side.DEVICE, REPLY, at)]
        for at in map(float, range(exchanges))
    ]


SENT = Delivery(0.0, Side.DEVICE, REQUEST)
ANSWERED = Delivery(0.0, Side.HOST, REPLY)


@pytest.mark.parametrize(
    ("script", "arrived"),
    [
        ("", [SENT, ANSWERED]),
        ("exchange 2: drop", [SENT, ANSWERED]),
        ("exchange 1: drop", [SENT]),
        ("100% to device: drop", [ANSWERED]),
        ("exchange 1: duplicate", [SENT, ANSWERED, ANSWERED]),
        ("at 0 s: delay 0.5; exchange 9: drop", [SENT, ANSWERED._replace(at=0.5)]),
        ("exchange 1: echo", [Delivery(0.0, Side.HOST, REQUEST), SENT, ANSWERED]),
        ("exchange 1: duplicate; exchange 1: delay 2", [SENT, *[ANSWERED._replace(at=2.0)] * 2]),
    ],
)
def test_what_a_fault_does_to_a_packet(script: str, arrived: list[Delivery]) -> None:
    assert arrivals(script)[0] == arrived


def test_corruption_changes_one_byte_and_breaks_a_can_frame() -> None:
    for _, reply in arrivals("100%: corrupt", 50):
        assert len(reply.data) == len(REPLY)
        assert sum(one != other for one, other in zip(reply.data, REPLY, strict=True)) == 1
    frame = CanFrame(0x625, b"12345678")
    assert faulty("100% to device: corrupt").carry(Side.HOST, frame, 0.0) == [
        Delivery(0.0, Side.HOST, BROKEN)
    ]


def test_chance_strikes_about_as_often_as_it_says_and_a_seed_repeats_it() -> None:
    def lost(script: str) -> list[bool]:
        return [len(packets) == 1 for packets in arrivals(script, 2000)]

    assert 140 < sum(lost("seed 1; 10%: drop")) < 260
    first, second, third = arrivals("exchange 1: delay 1.5", 3)
    assert [packets[1].at for packets in (first, second, third)] == [1.5, 1.5, 2.0], "no packet overtakes"
    assert lost("seed 1; 10%: drop") == lost("seed 1; 10%: drop") != lost("seed 2; 10%: drop")


@pytest.mark.parametrize("script", ["at 1 s: power-cycle 9", "1%: brown-out 1 9", "1%: dorp"])
def test_a_bad_script_leaves_the_former_faults(script: str) -> None:
    bus = faulty("exchange 1: drop")
    with pytest.raises(RequestError):
        bus.set(script, 0.0)
    assert str(bus.script) == "exchange 1: drop"


def test_faults_of_devices_happen_at_their_time() -> None:
    with simulate_bus("feetech", ids="1-2") as sim, open_bus(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        servo.enable_torque()
        sim.faults = "at 1 s: power-cycle 1; at 2 s: brown-out 1 2"
        sim.wait(sim.now + 0.9)
        assert sim[1].memory["torque_enable"] == 1
        sim.wait(sim.now + 0.2)
        assert sim[1].memory["torque_enable"] == 0
        sim.wait(sim.now + 1.0)
        with pytest.raises(NoReply):
            motorbus.feetech.Servo(bus, 2).position()
        sim.faults = ""
        sim.wait(sim.now + 1.5)
        assert motorbus.feetech.Servo(bus, 2).position() > 0, "the supply is back though the script ended"


def test_an_unplugged_port_is_lost_and_back_in_time() -> None:
    with simulate_bus("feetech") as sim:
        with open_bus(sim.url, reconnect=False) as bus:
            servo = motorbus.feetech.Servo(bus, 1)
            assert servo.position() > 0
            sim.faults = "exchange 1: unplug 0.5"
            with pytest.raises(LinkLost):
                servo.position()
            lost_at = sim.now
        with pytest.raises(PortNotFound, match="unplugged"):
            open_bus(sim.url)
        while True:
            try:
                with open_bus(sim.url) as bus:
                    assert motorbus.feetech.Servo(bus, 1).position() > 0
                    break
            except PortNotFound:
                assert sim.now < lost_at + 1.0


def test_the_same_script_does_the_same_again() -> None:
    script = "seed 8; 2%: corrupt; 5%: delay 0.01-0.3; 6%: brown-out 0.05; exchange 40: unplug 0.2"

    def run() -> list[str]:
        results = []
        with simulate_bus("feetech", ids="1-3", faults=script, name="again") as sim, open_bus(sim.url) as bus:
            for node in (1, 2, 3) * 15:
                try:
                    results.append(f"{motorbus.feetech.Servo(bus, node).position():.6f} {sim.now:.9f}")
                except MotorbusError as error:
                    results.append(f"{error.summary} {sim.now:.9f}")
            assert sim.faults.count > 0
        return results

    assert run() == run()
