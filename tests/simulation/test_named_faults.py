"""A simulation of this process goes wrong by script, and its port can be pulled."""

from __future__ import annotations

import pytest

import motorbus
from motorbus import families
from motorbus.errors import LinkLost, MotorbusError, NoReply, PortNotFound, RequestError
from motorbus.link.base import PerfectLine
from motorbus.simulation.faults import FaultyLine, parse
from motorbus.simulation.named import KNOCK, Simulation
from tests.simulation.links import QueueLink
from tests.support.noisy_line import NoisyLine


def simulation(faults: str = "", **options: object) -> Simulation:
    return Simulation(families.load("feetech"), (1,), faults=faults, **options)  # type: ignore[arg-type]


def test_a_script_from_the_beginning() -> None:
    with motorbus.simulate("feetech", faults="seed 4; 100%: drop") as sim, motorbus.open(sim.url) as bus:
        with pytest.raises(NoReply):
            motorbus.feetech.Servo(bus, 1).position()
        assert sim.faults.count == len(sim.faults.record) > 0
        sim.faults = ""
        assert motorbus.feetech.Servo(bus, 1).position() is not None


def test_a_script_at_any_time_and_what_happened() -> None:
    with motorbus.simulate("feetech") as sim, motorbus.open(sim.url) as bus:
        servo = motorbus.feetech.Servo(bus, 1)
        servo.enable_torque()
        sim.faults = parse("exchange 1: power-cycle 1")
        assert servo.read("torque_enable") == {"torque_enable": False} or not sim[1].memory["torque_enable"]
        assert str(sim.faults.record) == "exchange 1: power-cycle 1"
        assert sim.line is sim.faults


@pytest.mark.parametrize(
    "script",
    [
        "seed 8; 2% of bytes: corrupt; 5%: delay 0.01-0.3; 3% to device: drop; 2%: duplicate",
        "seed 9; 6%: brown-out 0.05; 6%: power-cycle all; exchange 40: unplug 0.2",
        "seed 3; exchange 2: torn-eeprom 1; 2% of bytes: power-cycle 2; 5%: echo",
    ],
)
def test_the_same_script_does_the_same_again(script: str) -> None:
    def run(script: str) -> tuple[list[str], str]:
        said = []
        there = motorbus.simulate("feetech", ids="1-3", faults=script, name="again")
        with there as sim, motorbus.open(sim.url) as bus:
            servos = [motorbus.feetech.Servo(bus, id) for id in (1, 2, 3)]
            for servo in servos * 15:
                try:
                    said.append(f"{servo.position():.6f} {bus.link.now():.9f}")
                except MotorbusError as error:
                    said.append(f"{error.summary} {bus.link.now():.9f}")
            return said, str(sim.faults.record)

    said, record = run(script)
    assert len(record.splitlines()) > 5
    assert run(record) == (said, record)


def test_without_a_script_there_are_no_faults_and_nothing_in_between() -> None:
    with simulation() as sim:
        link = sim.link()
        assert link.simulator is sim.simulator
        assert sim.faults.faults == ()
        sim.line = line = PerfectLine()
        assert link.line is line
        sim.faults = "exchange 1: drop"
        assert isinstance(link.line, FaultyLine)
        assert link.simulator is not sim.simulator
        assert sim[1].plugged


@pytest.mark.parametrize("wrong", ["exchange 1: explode", "exchange 1: power-cycle 9"])
def test_a_bad_script_changes_nothing(wrong: str) -> None:
    with pytest.raises(RequestError):
        simulation(wrong, name="bad")
    with simulation("exchange 1: drop", name="bad") as sim:  # the name is free
        with pytest.raises(RequestError):
            sim.faults = wrong
        assert str(sim.faults) == "exchange 1: drop"


def test_a_pulled_port_is_away_and_comes_back() -> None:
    with simulation("exchange 1: unplug 0.35") as sim:
        link = sim.link()
        link.write(b"\x01")
        with pytest.raises(LinkLost):
            link.read(1.0)
        link.close()
        for _ in range(4):
            with pytest.raises(PortNotFound, match=r"(?s)unplugged.*it is there again in"):
                sim.link()
        link = sim.link()
        assert link.now() >= 4 * KNOCK
        link.close()


def test_a_bus_that_may_have_real_devices_suffers_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def open_link(port: str, **options: object) -> QueueLink:
        opened.append(port)
        return QueueLink(name=port, no_wire=False)

    monkeypatch.setattr("motorbus.link.url.open_can", open_link)
    real = "can://socketcan/can0"
    with Simulation(families.load("kst"), (37,), faults="1%: drop") as sim:
        for line in (sim.line, NoisyLine(1)):
            sim.line = line
            with pytest.raises(RequestError, match="can0: faults are refused on a CAN bus"):
                sim.serve(real)
        assert opened == []
        sim.faults = ""
        with sim.serve(real) as served:
            with pytest.raises(RequestError, match="can0: faults are refused on a CAN bus"):
                sim.faults = "1%: echo"
            with pytest.raises(RequestError, match="can0: faults are refused on a CAN bus"):
                sim.line = NoisyLine(1)
            assert str(sim.faults) == ""
            assert served.line is sim.line
            sim.faults = ""
