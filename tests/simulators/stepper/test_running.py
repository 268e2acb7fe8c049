"""What runs on it, by its bytes: projects, jog, one move, homing, the supply, and what is wired to its inputs."""

from __future__ import annotations

import pytest

from motorbus.errors import RequestError
from tests.simulators.stepper.host import (
    CLEAR,
    DONE,
    FORWARD,
    HOME,
    ONCE,
    REVERSE,
    SAVE,
    SELECT,
    START,
    STOP,
    STOP_PROJECT,
    Host,
    frame,
    step,
    written,
)


def test_edits_while_it_runs_are_acknowledged_and_noted() -> None:
    host = Host()
    host.write(written(1, step(1), step(2)))
    host.say(frame(START, 1))
    host.write(step(2, distance=1))
    assert "runs: it goes on" in host.device.log[-1].text
    host.wait(5.0)
    assert host.device.position == 3200


def test_a_stop_mode_that_is_set_while_it_runs_holds() -> None:
    host = Host()
    host.write(written(1, step(1, distance=160_000, start=100, acceleration=1), stop=0))
    host.say(frame(START, 1))
    host.write([frame(3, 0x0E, 1)])
    host.wait(5.0)
    host.say(STOP_PROJECT, 0.01)
    assert host.device.state.phase.value == "idle"


def test_a_project_that_was_cleared_and_written_anew_is_still_its_own() -> None:
    host = Host()
    host.say(frame(CLEAR, 1))
    host.write(written(1, step(1, distance=160_000, start=100, acceleration=1), stop=0)[1:])
    assert host.dump(1)[6:8] == b"\0\0"  # nothing has been selected since, so it has no steps either
    host.write(written(1, step(1, distance=160_000, start=100, acceleration=1), stop=0))
    host.say(frame(START, 1), 3.0)
    assert host.device.status()["project"] == 1
    host.write([frame(3, 0x0E, 1)])
    host.say(STOP_PROJECT, 0.01)
    assert host.device.state.phase.value == "idle"


@pytest.mark.parametrize(
    ("busy", "answer"), [("ignore", "FF AA 4E 01 00 00"), ("silent", ""), ("restart", "FF AA 4E 01 00 00")]
)
def test_a_start_while_it_runs(busy: str, answer: str) -> None:
    host = Host(busy=busy)
    host.write(written(1, step(1)))
    host.say(frame(START, 1), 0.5)
    assert host.say(frame(START, 1), 0.1) == answer
    host.wait(5.0)
    assert host.device.position == (2400 if busy == "restart" else 1600)


def test_a_project_that_is_not_selected_runs_as_it_is_stored() -> None:
    host = Host()
    host.write([*written(2, step(1, distance=50)), frame(SAVE, 2)])
    host.write(written(2, step(1, distance=99)))
    host.write([frame(SELECT, 3, 1)])
    host.say(frame(START, 2), 3.0)
    assert host.device.position == 50


@pytest.mark.parametrize(("order", "sign"), [(FORWARD, 1), (REVERSE, -1)])
def test_jog_has_the_speed_of_step_1_of_project_1(order: bytes, sign: int) -> None:
    host = Host()
    host.write(written(1, step(1)))
    host.say(order, 2.0)
    assert host.device.position == sign * 3200
    host.say(STOP, 1.0)
    assert host.device.position == sign * 3200


def test_one_move_and_homing_tell_no_end() -> None:
    host = Host()
    host.write(written(1, step(1, delay=500)))
    assert host.say(ONCE, 3.0) == "FF AA 03 0C 00 00"
    assert host.device.position == 1600
    host.bus.press(5, True, host.now + 0.5)
    assert host.say(HOME, 3.0) == "FF AA 03 0F 00 00"
    assert (host.device.position, host.device.state.homed) == (0, True)
    telling = Host(notice_on_once=True)
    telling.write(written(1, step(1)))
    assert telling.say(ONCE, 3.0).endswith(DONE)


def test_homing_at_power_on() -> None:
    host = Host()
    host.write([*written(1, step(1)), frame(0xAE, 1), frame(SAVE, 1)])
    host.device.power_cycle()
    host.wait(1.0)
    assert host.device.status()["phase"] == "homing"
    host.device.set_input(5, True)
    assert host.device.status()["phase"] == "idle"


def test_the_supply_goes_in_the_middle_of_a_project() -> None:
    host = Host()
    host.write([*written(1, step(1, output=4)), frame(SAVE, 1)])
    host.say(frame(START, 1), 0.5)
    host.device.unplug()
    host.device.unplug()
    assert host.device.status()["powered"] is False
    assert host.say(STOP) == ""
    assert host.device.outputs == (False, False, False)
    host.device.plug()
    host.device.plug()
    assert host.wait(10.0) == []  # no end is told
    assert host.device.position == 800
    assert host.device.told == []


# --- inputs and outputs ------------------------------------------------------------------------------------------


def test_inputs_are_read_one_by_one() -> None:
    host = Host()
    host.device.set_input(2, True)
    assert [host.say(frame(0, 0x0B, port)) for port in (1, 2)] == ["FF AA 00 0B 01 00", "FF AA 00 0B 02 01"]
    low = Host(input_polarity="low")
    low.device.set_input(2, True)
    assert [low.say(frame(0, 0x0B, port)) for port in (1, 2)] == ["FF AA 00 0B 01 01", "FF AA 00 0B 02 00"]


@pytest.mark.parametrize("port", [0, 6])
def test_there_are_five_inputs(port: int) -> None:
    with pytest.raises(RequestError, match=f"no input {port}"):
        Host().device.set_input(port, True)


def test_outputs_and_leds() -> None:
    host = Host()
    assert host.say(frame(0, 0x0C, 4, 1)) == "FF AA 00 0C 04 00"
    host.say(frame(0, 0x0C, 2, 0))
    host.say(frame(0, 0x0C, 5, 1))
    assert host.device.outputs == (True, False, True)
    assert host.device.status()["leds"] is True


@pytest.mark.parametrize(("reading", "steps"), [("selected", 3), ("1", 1)])
def test_which_project_input_3_starts(reading: str, steps: int) -> None:
    host = Host(in3_project=reading, notice_on_in3=True)
    host.write([*written(1, step(1)), frame(SAVE, 1), *written(4, step(1), step(2), step(3))])
    host.device.set_input(3, True)
    assert [text for _, text in host.wait(9.0)] == [DONE]
    assert host.device.position == steps * 1600


@pytest.mark.parametrize(("switch", "level"), [("stuck", "01"), ("never", "00")])
def test_a_home_switch_that_is_broken(switch: str, level: str) -> None:
    host = Host(home_switch=switch)
    host.device.set_input(5, switch == "never")
    assert host.say(frame(0, 0x0B, 5)) == f"FF AA 00 0B 05 {level}"
    host.device.power_cycle()
    assert host.say(frame(0, 0x0B, 5)) == f"FF AA 00 0B 05 {level}"


def test_inputs_stay_as_they_are_when_the_supply_goes() -> None:
    host = Host()
    host.device.set_input(1, True)
    host.device.power_cycle()
    assert host.say(frame(0, 0x0B, 1)) == "FF AA 00 0B 01 01"
