"""Another baud rate: every code of every map, and everything it is refused for, with nothing written."""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus import session
from motorbus.core.can_frame import CanFrame
from motorbus.errors import LinkError, RequestError
from motorbus.families.feetech.table import BAUD_CODES, BAUD_CODES_OF
from motorbus.simulation.named import Simulation

MODELS = {
    "sts": "sts3215",
    "scs": "scs0009",
    "scs2": "scs215-2",
    "smcl": "sm60-360m",
    "smbl": "sm85blhv",
    "hls": "hls3925",
}
CODES = [(name, code) for name in MODELS for code in BAUD_CODES_OF[name]]
NEAR = range(10)


def tuned(simulation: Simulation, rate: Any, **more: Any) -> Any:
    with motorbus.open(simulation.url) as bus:
        return motorbus.feetech.Servo(bus, 3).set_baud(rate, **{"among": NEAR, **more})


def wear(simulation: Simulation) -> int:
    return sum(servo.memory.wear.total() for servo in simulation.simulator.servos)  # type: ignore[attr-defined]


@pytest.mark.parametrize(("name", "code"), CODES)
def test_every_code_of_every_map(name: str, code: int) -> None:
    with motorbus.simulate("feetech", ids="3", model=MODELS[name]) as simulation:
        servo = simulation[3]
        with motorbus.open(simulation.url) as bus:
            before = bus.rate
            found = motorbus.feetech.Servo(bus, 3).set_baud(BAUD_CODES[code], among=[3])
            assert bus.rate == before
            assert session.unfinished(bus) is None
        assert (found.node, found.rate) == (3, BAUD_CODES[code])
        assert (servo.memory["baud_rate"], servo.locked) == (code, True)
        servo.power_cycle()
        assert servo.baud_rate == BAUD_CODES[code]
        with motorbus.open(simulation.url, baud=BAUD_CODES[code]) as bus:
            assert motorbus.feetech.Servo(bus, 3).ping()


@pytest.mark.parametrize("baud_ack", ["old", "new"])
@pytest.mark.parametrize("level", [0, 1])
def test_whoever_acknowledges_and_at_whichever_rate(baud_ack: str, level: int) -> None:
    with motorbus.simulate("feetech", ids="3", baud_ack=baud_ack) as simulation:
        simulation[3].memory["status_return_level"] = level
        assert tuned(simulation, 500_000).rate == 500_000
        assert simulation[3].locked


def test_what_it_has_already_is_not_written_again() -> None:
    with motorbus.simulate("feetech", ids="3") as simulation:
        assert tuned(simulation, 1_000_000).rate == 1_000_000
        assert wear(simulation) == 0


@pytest.mark.parametrize("rate", [0, 9601, 2_000_000, True, 500_000.0, "fast"])
def test_what_is_no_rate_of_these_servos_is_refused(rate: Any) -> None:
    with motorbus.simulate("feetech", ids="3") as simulation, pytest.raises(RequestError, match="no rate"):
        tuned(simulation, rate)


@pytest.mark.parametrize(("model", "rate"), [("sts3215", 19_200), ("hls3925", 4_800), ("scs0009", 4_800)])
def test_a_rate_that_the_map_lacks_is_refused(model: str, rate: int) -> None:
    with motorbus.simulate("feetech", ids="3", model=model) as simulation:
        with pytest.raises(RequestError, match=f"no code for {rate} bit/s"):
            tuned(simulation, rate)
        assert wear(simulation) == 0


def test_a_rate_that_the_link_lacks_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with motorbus.simulate("feetech", ids="3") as simulation, motorbus.open(simulation.url) as bus:
        tune = bus.link.tune

        def unable(rate: int, listen_only: bool = False) -> None:
            if rate == 76_800:
                raise LinkError("this adapter has no 76800 bit/s")
            tune(rate, listen_only)

        monkeypatch.setattr(bus.link, "tune", unable)
        with pytest.raises(LinkError, match="no 76800"):
            motorbus.feetech.Servo(bus, 3).set_baud(76_800, among=NEAR)
        assert bus.rate == 1_000_000
        assert motorbus.feetech.Servo(bus, 3).ping()
        assert wear(simulation) == 0


def test_an_id_that_is_taken_at_that_rate_is_refused() -> None:
    with motorbus.simulate("feetech", ids=(3, 3)) as simulation:
        other = simulation.simulator.servos[1]  # type: ignore[attr-defined]
        other.memory["baud_rate"] = 1
        with pytest.raises(RequestError, match="the id 3 is taken at 500000 bit/s"):
            tuned(simulation, 500_000)
        assert wear(simulation) == 0


@pytest.mark.parametrize("code", [4, 7, 9])
def test_a_twin_at_a_third_rate_is_refused(code: int) -> None:
    """A servo whose rate is torn might join it there, and would not be told from it."""
    with motorbus.simulate("feetech", ids=(3, 3)) as simulation:
        simulation.simulator.servos[1].memory["baud_rate"] = code  # type: ignore[attr-defined]
        with pytest.raises(RequestError, match=f"the id 3 is taken at {BAUD_CODES[code]} bit/s"):
            tuned(simulation, 500_000)
        assert wear(simulation) == 0


def test_two_with_its_id_are_refused() -> None:
    with motorbus.simulate("feetech", ids=(3, 3)) as simulation:
        simulation.simulator.servos[1].raw_position = 700  # type: ignore[attr-defined]
        with pytest.raises(RequestError, match="two servos seem to have the id 3"):
            tuned(simulation, 500_000)
        assert wear(simulation) == 0


def test_an_hls_servo_that_would_obey_by_its_second_id_is_found_first() -> None:
    with motorbus.simulate("feetech", ids="3+4", model="sts3215+hls3925") as simulation:
        simulation[4].memory["second_id"] = 3
        with pytest.raises(RequestError, match="servo 4 has 3 as its second id"):
            tuned(simulation, 500_000)
        assert simulation[4].baud_rate == 1_000_000


def test_no_other_servo_hears_of_it() -> None:
    with motorbus.simulate("feetech", ids="3+4") as simulation:
        heard: list[bytes] = []
        receive = simulation.simulator.receive

        def overheard(data: bytes | CanFrame, at: float) -> None:
            assert isinstance(data, bytes)
            heard.append(data)
            receive(data, at)

        simulation.simulator.receive = overheard  # type: ignore[method-assign]
        tuned(simulation, 500_000)
        assert simulation[4].baud_rate == 1_000_000
    assert not [frame for frame in heard if frame[2] == 254]
    assert not [frame for frame in heard if frame[2] != 3 and frame[4] == 3]
