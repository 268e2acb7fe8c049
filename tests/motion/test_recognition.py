"""Opening a machine asks each device what it is: who is silent is named, and what the file asks in vain is refused."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus import AsyncRobot, NoReply, RequestError, Robot
from motorbus.core.device import device_method
from motorbus.core.family import AxisDriver, Identity
from motorbus.core.steps import Sleep
from motorbus.motion import recognition
from tests.support.machines import listened, machine, said


def test_every_device_is_asked_and_its_axis_knows_what_it_can_do() -> None:
    with machine(arm="1-2", can="0x25", lift=True) as (made, _), Robot.of(made) as robot:
        assert [axis.model for axis in robot.axes.values()] == [
            "STS3215",
            "STS3215",
            robot["c1"].model,
            "stepper controller",
        ]
        assert all(axis.able for axis in robot.axes.values())


def test_loading_only_reads() -> None:
    with machine(arm="1-6", can="0x25,0x26", lift=True) as (made, sims):
        before = [sims["arm"][node].memory.read(0, 56) for node in range(1, 7)]
        listened(sims)
        with Robot.of(made) as robot:
            robot.positions()
            robot.states()
        sent = said(sims)
        assert len(sent) > 20
        assert all(_reads(title) for title in sent), [title for title in sent if not _reads(title)]
        assert [sims["arm"][node].memory.read(0, 56) for node in range(1, 7)] == before


def _reads(title: str) -> bool:
    return title.startswith(("READ ", "SYNC READ", "PING")) or ": read " in title.lower()


def test_who_is_silent_is_named_with_axis_device_and_address() -> None:
    with machine(arm="1-6") as (made, sims):
        sims["arm"][3].unplug()
        with pytest.raises(NoReply, match="a3: arm#3 does not answer") as caught:
            Robot.of(made)
        assert sims["arm"].url in str(caught.value)
        assert "id 3" in str(caught.value)
        assert "nothing was sent but questions" in str(caught.value)


def test_all_who_are_silent_are_named_on_every_bus() -> None:
    with machine(arm="1-6", can="0x25,0x26") as (made, sims):
        for bus, node in (("arm", 2), ("arm", 5), ("can", 0x26)):
            sims[bus][node].unplug()
        with pytest.raises(NoReply) as caught:
            Robot.of(made)
        told = "\n".join([str(caught.value), *caught.value.__notes__])
        assert all(name in told for name in ("a2: arm#2", "a5: arm#5", "c2: can#0x26"))
        assert "a1:" not in told


def test_what_is_not_wanted_need_not_answer() -> None:
    with machine(arm="1-3", can="0x25") as (made, sims):
        sims["arm"][3].unplug()
        sims["can"][0x25].unplug()
        with Robot.of(made, ["a1", "a2"]) as robot:
            assert list(robot.axes) == ["a1", "a2"]
            assert list(robot.buses) == ["arm"]


@pytest.mark.parametrize(
    ("axis", "keys", "what"),
    [
        ("c1", {"torque": 0.5}, "a cap of its torque"),
        ("c1", {"current": "0.4 A"}, "a cap of its current"),
        ("a1", {"current": "0.4 A"}, "a cap of its current"),
        ("lift", {"torque": 0.5}, "a cap of its torque"),
        ("c1", {"exit": "torque_off"}, "a switch for its torque"),
        ("lift", {"exit": "torque_off"}, "a switch for its torque"),
    ],
)
def test_what_the_file_asks_in_vain_is_refused_and_nothing_moves(
    axis: str, keys: dict[str, Any], what: str
) -> None:
    with machine(arm="1", can="0x25", lift=True, axes={axis: keys}) as (made, sims):
        listened(sims)
        with pytest.raises(RequestError, match=rf"axis\.{axis}\.") as caught:
            Robot.of(made)
        assert what in str(caught.value)
        assert "what to do: " in str(caught.value)
        assert all(_reads(title) for title in said(sims))
        with Robot.of(made, [name for name in made.axes if name != axis]) as robot:
            assert robot.axes, "and the ports were given back"


@pytest.mark.parametrize(
    ("axis", "park", "limits"),
    [("c1", "200 deg", "-90.0 deg to 90.0 deg"), ("a1", "-181 deg", "-180.0 deg to 179.9 deg")],
)
def test_a_place_to_park_beyond_the_device_is_refused_before_anything_moves(
    axis: str, park: str, limits: str
) -> None:
    keys = {"exit": "park", "park": park, "low": None, "high": None}
    with machine(arm="1", can="0x25", axes={axis: keys}) as (made, sims):
        listened(sims)
        with pytest.raises(
            RequestError, match=rf"^axis\.{axis}\.park: {park[:-4]}.0 deg is outside"
        ) as caught:
            Robot.of(made)
        assert caught.value.expected == limits
        assert caught.value.advice == 'change park, or write exit = "hold"; nothing was sent but questions'
        assert all(_reads(title) for title in said(sims))
    near = {**keys, "park": "89 deg"}
    with machine(arm="1", can="0x25", axes={axis: near}) as (made, _), Robot.of(made) as robot:
        assert robot.axes


@pytest.mark.parametrize(
    ("model", "registers", "why", "expected"),
    [
        (
            "sm60-360m",
            {"min_position_limit": 0, "max_position_limit": 0},
            "node 1 has position limits of 0 and 0, which has no known meaning in its map",
            "a device that tells its limits",
        ),
    ],
)
def test_who_cannot_tell_his_limits_cannot_be_parked_and_that_is_told_at_its_key(
    model: str, registers: dict[str, int], why: str, expected: str, tmp_path: Path
) -> None:
    file, keys = tmp_path / "motorbus.toml", {"exit": "park", "park": "0 deg"}
    with machine(arm="1-2", options={"arm": {"model": model}}, axes={"a1": keys}) as (made, sims):
        for name, raw in registers.items():
            sims["arm"][1].memory[name] = raw
        file.write_text(made.text(), encoding="utf-8")
        listened(sims)
        with pytest.raises(RequestError) as caught:
            Robot.load(file)
        error = caught.value
        assert error.summary.startswith(
            f"{file}: axis.a1.exit: arm#1 ({model.upper()}) cannot be parked: {why}"
        )
        assert error.expected.startswith(expected)
        assert error.expected.endswith(', or exit = "leave"')
        assert error.advice == 'write exit = "leave"; nothing was sent but questions'
        assert all(_reads(title) for title in said(sims))
        file.write_text(made.text().replace('"park"', '"leave"'), encoding="utf-8")
        with Robot.load(file) as robot:
            assert list(robot.axes) == ["a1", "a2"]
        assert robot.warnings == ()


@pytest.mark.parametrize("exit_", ["hold", "leave"])
def test_a_place_to_park_where_nobody_parks_is_not_judged(exit_: str) -> None:
    keys = {"exit": exit_, "park": "200 deg", "low": None, "high": None}
    with machine(can="0x25", axes={"c1": keys}) as (made, _), Robot.of(made) as robot:
        assert robot["c1"].spec.park is not None


def test_what_a_device_is_refused_for_names_the_file(tmp_path: Path) -> None:
    file = tmp_path / "motorbus.toml"
    with machine(arm="1-2", axes={"a1": {"current": "0.4 A"}, "a2": {"current": "1 A"}}) as (made, _):
        file.write_text(made.text(), encoding="utf-8")
        with pytest.raises(RequestError) as caught:
            Robot.load(file)
        assert caught.value.summary.startswith(f"{file}: axis.a1.current: arm#1 (STS3215) does not have")
        assert caught.value.advice == "take current out of the file; nothing was sent but questions"
        assert "axis.a2.current" in caught.value.__notes__[0]
        asyncio.run(_refused_with(file))


async def _refused_with(file: Path) -> None:
    robot = AsyncRobot.load(file)
    with pytest.raises(RequestError) as caught:
        await robot.__aenter__()
    assert caught.value.summary.startswith(f"{file}: axis.a1.current: ")


def test_a_place_to_park_needs_a_way_to_it() -> None:
    with machine(can="0x25", exit="park", park="0 deg") as (made, _), Robot.of(made, "c1") as robot:
        axis = robot["c1"]
        assert recognition._lacking(axis) is None
        axis.able = AxisDriver(position=axis.able.position)
        refused = recognition._lacking(axis)
        assert refused is not None
        assert "axis.c1.exit" in str(refused)


class Other:
    """A device that is none of those that somebody knows."""

    @device_method
    async def identify(self) -> Identity:
        await Sleep(0)
        return Identity(1, "SCS9999", "9.9", "")


def test_a_device_of_which_nobody_has_said_what_it_can_do_is_refused() -> None:
    with machine(arm="1") as (made, _), Robot.of(made) as robot:
        axis = robot["a1"]
        device = axis.device
        axis.device = Other()
        with pytest.raises(RequestError, match="a1: arm#1 is SCS9999, of which nobody has said"):
            robot.conductor.run(recognition.recognise(robot))
        axis.device = device
        robot.conductor.run(recognition.recognise(robot))
        assert "position" in axis.able


@pytest.mark.parametrize(
    ("asked", "limits", "says"),
    [
        (
            {"arm": "1"},
            {"high": "181 deg"},
            "axis.a1.high: 181.0 deg is outside the travel of arm#1 (STS3215)",
        ),
        ({"arm": "1"}, {"zero": "0 deg"}, "axis.a1.low: -150.0 deg is outside the travel of arm#1"),
        ({"arm": "1"}, {"gear": 3.0}, "-60.0 deg to 60.0 deg"),
        ({"can": "0x25"}, {"low": "-91 deg"}, "axis.c1.low: -91.0 deg is outside the travel of can#0x25"),
    ],
)
def test_limits_beyond_the_travel_of_the_device_are_refused_with_both(
    asked: dict[str, str], limits: dict[str, Any], says: str
) -> None:
    with (
        machine(**asked, axes=dict.fromkeys(("a1", "c1"), limits)) as (made, _),  # type: ignore[arg-type]
        pytest.raises(RequestError) as caught,
    ):
        Robot.of(made)
    assert says in str(caught.value)
    assert caught.value.expected
    assert "nothing was sent but questions" in caught.value.advice


@pytest.mark.parametrize("limits", [{"low": "-180 deg", "high": "180 deg"}, {"sign": -1}, {"gear": 1.2}])
def test_limits_up_to_the_ends_of_the_travel_are_taken(limits: dict[str, Any]) -> None:
    with machine(arm="1", axes={"a1": limits}) as (made, _), Robot.of(made) as robot:
        assert robot["a1"].model == "STS3215"


def test_a_servo_of_many_turns_has_limits_of_many_turns() -> None:
    limits = {"zero": "0 deg", "low": "-5 turn", "high": "5 turn"}
    with machine(arm="1", axes={"a1": limits}) as (made, sims):
        with motorbus.open(made.buses["arm"].address) as bus:
            motorbus.feetech.Servo(bus, 1).write(min_position_limit=0, max_position_limit=0)
        with Robot.of(made) as robot:
            assert robot["a1"].model == "STS3215"
        assert sims["arm"][1].memory["max_position_limit"] == 0


def test_a1_a_servo_with_a_known_map_and_an_unknown_model_number_moves_by_name() -> None:
    with machine(arm="1") as (made, sims):
        sims["arm"][1].memory["model_minor"] = 27
        with Robot.of(made) as robot:
            assert robot["a1"].model == "unknown model 9.27"
            robot.move({"a1": 0.2})
            assert robot.positions()["a1"] == pytest.approx(0.2, abs=0.01)
