"""Every manual command as a method: its bytes, its docstring, its refusals; inputs and outputs."""

from __future__ import annotations

import json
from copy import copy
from inspect import signature
from pathlib import Path
from typing import Any

import pytest

from motorbus.core.family import Identity
from motorbus.core.request import Effect
from motorbus.errors import FramingError, MotorbusError, NoReply, OutcomeUnknown, RequestError
from motorbus.families.stepper import FAMILY, AsyncController, Controller, InputChanged, StepperDriver
from motorbus.families.stepper.parameters import PARAMETERS, allowed
from motorbus.families.stepper.protocol import COMMANDS, MOTOR, encode
from tests.families.stepper.bench import READ_1, STOP_MOTOR, STOP_PROJECT, bench

MANUAL = [
    row
    for row in json.loads(Path("tests/vectors/stepper/manual.json").read_text(encoding="utf-8"))
    if len(bytes.fromhex(row["hex"])) == 11
]
VERIFIED = {
    "read_project",
    "start_project",
    "jog_forward",
    "jog_reverse",
    "run_once",
    "home",
    "set_output",
    "read_input",
}
"""Methods of the manual that do more than send one request."""


def numbers(name: str, row: dict[str, Any]) -> dict[str, int]:
    data = bytes.fromhex(row["hex"])
    return {
        field: int.from_bytes(data[at : at + PARAMETERS[field].size], "little")
        for field, at in COMMANDS[name].fields.items()
    }


def test_all_27_examples_of_the_manual_are_here() -> None:
    assert sorted(row["expected"]["command"] for row in MANUAL) == sorted(COMMANDS)
    assert len(COMMANDS) == 27


PLAIN = [row for row in MANUAL if row["expected"]["command"] not in VERIFIED]


@pytest.mark.parametrize("row", PLAIN, ids=lambda row: row["expected"]["command"])
def test_method_sends_the_frame_of_the_manual(row: dict[str, Any]) -> None:
    name = row["expected"]["command"]
    with bench() as one:
        values = numbers(name, row)
        one.device.state.selected = 1
        getattr(one.device, name)(**values)
        assert one.sent() == [bytes.fromhex(row["hex"]).hex(" ").upper()]


@pytest.mark.parametrize("name", COMMANDS)
def test_docstring_states_item_and_ranges(name: str) -> None:
    method = getattr(Controller, name)
    text = (method.__doc__ or "").replace("\n", " ")
    assert f"item {COMMANDS[name].number}" in text
    if name not in VERIFIED:
        for field in COMMANDS[name].fields:
            assert f"`{field}`: {allowed(field)}" in text
        assert set(signature(method.function).parameters) == {"node", *COMMANDS[name].fields}
    assert getattr(AsyncController, name).__doc__ == method.__doc__


@pytest.mark.parametrize("name", sorted(COMMANDS.keys() - VERIFIED))
def test_number_out_of_range_is_refused_before_anything_is_sent(name: str) -> None:
    with bench() as one:
        for field in COMMANDS[name].fields:
            row = PARAMETERS[field]
            for raw in {row.high + 1, row.low - 1, True}:
                values = {other: max(1, PARAMETERS[other].low) for other in COMMANDS[name].fields}
                with pytest.raises(RequestError, match=field):
                    getattr(one.device, name)(**{**values, field: raw})
        assert one.sent() == []


@pytest.mark.parametrize("name", ["set_step_start_input", "set_step_stop_input"])
def test_step_may_not_use_the_inputs_that_start_and_stop(name: str) -> None:
    with bench() as one, pytest.raises(RequestError, match="4 is not possible"):
        getattr(one.device, name)(1, 4)


def test_reply_of_another_command_is_no_acknowledgement() -> None:
    with bench() as one:
        one.line.change = lambda data: data if len(data) > 6 else bytes.fromhex("FFAA03070001")
        with pytest.raises(MotorbusError) as caught:
            one.device.set_step_distance(1, 100)
        assert isinstance(caught.value, OutcomeUnknown)


def test_silence_to_an_edit_is_repeated_and_then_unknown() -> None:
    with bench() as one:
        one.line.change = lambda data: data if len(data) > 6 else b""
        with pytest.raises((OutcomeUnknown, NoReply)):
            one.device.set_step_distance(1, 100)
        edits = [frame for frame in one.sent() if frame.startswith("FF AA 03 03")]
        assert 2 <= len(edits) <= 3


def test_motor_number_is_that_of_the_bus() -> None:
    with bench(motor=7) as one:
        one.device.stop()
        assert one.sent() == [STOP_PROJECT, encode("stop_motor", motor=7).hex(" ").upper()]
    with pytest.raises(RequestError, match="motor"):
        FAMILY.open(motor="0")


# -- the bus -----------------------------------------------------------------------------------------------------------


def test_axis_has_no_position() -> None:
    driver = FAMILY.open()
    assert driver.axis(Identity(1, "stepper controller", "", "")).names == {
        "jog", "home", "plan_move", "run", "stop",
    }  # fmt: skip
    assert not driver.axis(Identity(1, "", "", "")).names


def test_only_dumps_are_sent_to_find_a_controller() -> None:
    with bench() as one:
        found = one.run(one.bus.driver.scan())
        assert [device.node for device in found] == [1]
        assert one.device.identify().details["motor"] == MOTOR
        assert {frame[:8] for frame in one.sent()} == {"FF AA 3E"}
        one.simulated.unplug()
        assert one.run(one.bus.driver.scan()) == []
        assert one.device.ping() is False


def test_probe_reads_projects_in_turn_and_forgets_what_was_read() -> None:
    driver = FAMILY.open()
    frames = {bytes(driver.probe(1, attempt).wire) for attempt in range(8)}  # type: ignore[arg-type]
    assert {frame[2:4] for frame in frames} == {b"\x3e\x01", b"\x3e\x02", b"\x3e\x03", b"\x3e\x04"}
    with bench() as one:
        one.device.dump(1)
        assert set(one.device.state.projects) == {1}
        assert one.bus.driver.probe(1, 0).repeatable
        assert one.device.state.projects == {}


def test_emergency_stop_sends_both_commands_without_waiting_for_a_silent_controller() -> None:
    driver = FAMILY.open()
    for nodes in ({}, {1: None}):
        stop = driver.stop(nodes)
        assert [str(frame)[9:-1].upper() for frame in stop.requests] == [STOP_PROJECT, STOP_MOTOR]
        assert [bool(frame.expected) for frame in stop.requests] == [bool(nodes)] * 2
        assert {frame.effect for frame in stop.requests} == {Effect.MOTION}


def test_open_reads_nothing_but_a_dump() -> None:
    test = FAMILY.open().echo_test()
    assert test is not None
    assert test.wire == bytes.fromhex(READ_1)


# -- inputs and outputs ------------------------------------------------------------------------------------------------


def test_inputs_are_read_until_two_readings_agree() -> None:
    with bench() as one:
        one.simulated.set_input(2, True)
        assert one.device.read_input(2) is True
        assert one.device.inputs((2, 3)) == {2: True, 3: False}
        assert len(one.sent()) == 1 + 4
        levels = iter((0, 1, 1))
        one.line.change = lambda data: data[:5] + bytes([next(levels)])
        assert one.device.inputs((1,)) == {1: True}
        count = iter(range(10))
        one.line.change = lambda data: data[:5] + bytes([next(count) % 2])
        with pytest.raises(FramingError, match="input 1 changed"):
            one.device.inputs((1,))


def test_watched_input_is_reported_at_its_second_reading() -> None:
    with bench() as one:
        seen = iter([0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1, *[1] * 1000])  # one glitch, then a change
        one.line.change = lambda data: data[:5] + bytes([next(seen)])
        changes = one.device.watch_inputs((1,), 0.1)
        assert [(change.port, change.active) for change in changes] == [(1, True)]
        assert one.told(InputChanged) == list(changes)
        with pytest.raises(RequestError, match="seconds"):
            one.device.watch_inputs((1,), 0)
        with pytest.raises(RequestError, match="port"):
            one.device.watch_inputs((6,), 1)


def test_outputs_are_remembered_as_sent_and_forgotten_without_an_acknowledgement() -> None:
    with bench() as one:
        assert one.device.last_commanded == {1: None, 2: None, 3: None, 5: None}
        one.device.set_output(4, True)
        one.device.set_output(2, False)
        one.device.set_output(5, True)
        assert one.device.last_commanded == {1: True, 2: False, 3: True, 5: True}
        assert one.simulated.status()["outputs"] == [True, False, True]
        assert one.simulated.status()["leds"] is True
        one.line.change = lambda data: b""
        with pytest.raises(MotorbusError):
            one.device.set_output(1, False)
        assert one.device.last_commanded[1] is None
        impossible: list[tuple[Any, Any]] = [(6, True), (1, 2), (1, "on")]
        for port, level in impossible:
            with pytest.raises(RequestError):
                one.device.set_output(port, level)


def test_each_bus_has_its_own_state_and_settings() -> None:
    with bench(dump_order="big") as one, bench() as other:
        one.device.set_output(1, True)
        assert one.device.last_commanded[1] is True
        assert other.device.last_commanded[1] is None
        assert Controller(one.bus).state is one.device.state
        assert (
            one.device.read_raw("step_1_delay")
            == other.device.read_raw("step_1_delay")
            == {"step_1_delay": 1000}
        )
        assert one.device.dump(1) != other.device.dump(1)
    for settings in ({"dump_order": "middle"}, {"order": "big"}, {"motor": "x"}):
        with pytest.raises(RequestError):
            FAMILY.open(**settings)


def test_dry_run_leaves_the_state_of_the_bus() -> None:
    driver = FAMILY.open(motor=5, dump_order="big")
    assert isinstance(driver, StepperDriver)
    copied = copy(driver)
    copied.state.outputs[1] = True
    copied.state.may_run = True
    assert (copied.motor, copied.order) == (5, "big")
    assert (driver.state.outputs[1], driver.state.may_run) == (None, False)
