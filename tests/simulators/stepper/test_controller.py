"""What the simulated controller does with requests, inputs, and a loss of its supply."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper import FAMILY
from motorbus.families.stepper.parameters import Project, Step, encode_image
from motorbus.families.stepper.protocol import COMMANDS, encode
from motorbus.families.stepper.simulator import OPTIONS, Quirks, simulate
from motorbus.families.stepper.simulator.controller import EXAMPLE
from tests.simulators.stepper.host import NOTICE, TURN, Host, made

MANUAL = json.loads(Path("tests/vectors/stepper/manual.json").read_text(encoding="utf-8"))
FRAMES = [(row["expected"]["command"], bytes.fromhex(row["hex"])) for row in MANUAL]
REQUESTS = {name: data for name, data in FRAMES if len(data) == 11}
REPLIES = {
    "read_project": b"\xff\xaa\x3e\x01\x00\x00",
    **{name: data for name, data in FRAMES if len(data) == 6},
}


# -- requests and replies ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", COMMANDS)
def test_example_of_the_manual_is_answered_as_documented(name: str) -> None:
    replies = Host().send(REQUESTS[name], 0.1)
    assert replies[0][:6] == REPLIES[name]
    assert len(replies[0]) == (226 if name == "read_project" else 6)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_damaged_request_is_not_answered(name: str) -> None:
    host = Host()
    before = encode_image(host.controller.store.working)
    for at in range(2, 11):
        data = REQUESTS[name]
        assert host.send(data[:at] + bytes([data[at] ^ 0x40]) + data[at + 1 :]) == []
    assert encode_image(host.controller.store.working) == before
    assert host.phase == "idle"


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("select_project", {"project": 5, "total_steps": 1}),
        ("select_project", {"project": 1, "total_steps": 11}),
        ("set_microstep_and_angle", {"microsteps": 0, "step_angle": 180}),
        ("set_step_output", {"output": 9, "step": 1}),
        ("set_step_delay", {"delay": 1, "step": 11}),
        ("read_input", {"port": 6}),
        ("set_output", {"port": 1, "level": 2}),
        ("start_project", {"project": 0}),
    ],
)
def test_number_out_of_range_is_not_answered(name: str, values: dict[str, int]) -> None:
    host = Host()
    assert host.ask(name, **values) == []


def test_other_motor_and_unknown_command_are_not_answered() -> None:
    host = Host(motor=7)
    assert host.ask("stop_motor") == []
    assert host.send(encode("stop_motor", motor=7)) == [bytes.fromhex("FFAA070D0000")]
    assert host.ask("stop_project") == [bytes.fromhex("FFAA5E000000")]
    unknown = bytes.fromhex("FFAA0710000000000000")
    assert host.send(unknown + bytes([sum(unknown) & 255])) == []


def test_requests_in_pieces_after_noise_and_after_a_gap() -> None:
    host, request = Host(), REQUESTS["stop_project"]
    assert host.send(request[:5]) == []
    assert host.send(request[5:]) == [REPLIES["stop_project"]]
    assert host.send(b"\xff\x00\xff\xaa\x01" + request) == [REPLIES["stop_project"]]
    assert host.send(request[:5]) == []
    host.wait(0.2)
    assert host.send(request[5:]) == []
    assert host.send(request + request, 0.01) == [REPLIES["stop_project"]] * 2


def test_host_at_another_rate_is_not_heard() -> None:
    host = Host()
    host.line.tune(19200)
    assert host.send(REQUESTS["stop_project"]) == []


def test_reply_comes_after_the_turnaround_and_a_save_after_its_time() -> None:
    host = Host(turnaround=0.01)
    host.ask("stop_project", 0.1)
    assert host.came[-1][0] == pytest.approx(0.01)
    begun = host.now
    assert host.ask("save_project", 0.03, project=1) == []
    assert host.controller.midway() == pytest.approx(begun + 0.025)
    assert host.wait(0.02) == [REPLIES["save_project"]]
    assert host.controller.midway() == float("inf")


def test_echo_returns_what_the_host_sends() -> None:
    host = Host(echo=True)
    assert host.ask("stop_project") == [REQUESTS["stop_project"], REPLIES["stop_project"]]


# -- memory ------------------------------------------------------------------------------------------------------------


def test_new_controller_has_the_example_or_nothing() -> None:
    assert Host().read(1) == EXAMPLE
    assert Host().read(2) == Project()
    assert Host(shipped="cleared").read(1) == Project()
    assert Host().controller.memory["step_1_delay"] == 1000


def test_edits_show_at_once_and_are_lost_without_a_save() -> None:
    host = Host()
    host.ask("set_step_delay", delay=7, step=1)
    assert host.read(1).step(1).delay == 7
    host.controller.power_cycle()
    assert host.read(1).step(1).delay == 1000
    host.ask("set_step_delay", delay=7, step=1)
    host.ask("save_project", 0.1, project=1)
    host.controller.power_cycle()
    assert host.read(1).step(1).delay == 7


def test_stored_view_shows_edits_only_after_the_save() -> None:
    host = Host(read_view="stored")
    host.ask("set_step_delay", delay=7, step=1)
    assert host.read(1).step(1).delay == 1000
    host.ask("save_project", 0.1, project=1)
    assert host.read(1).step(1).delay == 7


@pytest.mark.parametrize("select", ["load", "relabel"])
def test_selection_loads_or_renames(select: str) -> None:
    host = Host(made(number=2), select=select)
    host.ask("set_step_delay", delay=7, step=1)
    host.ask("select_project", project=2, total_steps=3)
    shown = host.read(2)
    assert (shown.number, shown.total_steps) == (2, 3)
    assert shown.step(1) == (TURN if select == "load" else Step(**{**steps(EXAMPLE), "delay": 7}))
    (reply,) = host.ask("set_project_loop", project_loop=1)
    assert reply[3] == 2, "the reply names the selected project"


def steps(project: Project) -> dict[str, Any]:
    step = project.step(1)
    return {name: getattr(step, name) for name in step.__slots__}


def test_save_stores_the_selected_project_under_any_number() -> None:
    host = Host()
    host.ask("save_project", 0.1, project=3)
    assert host.read(3).step(1) == EXAMPLE.step(1)
    assert host.read(3).number == 3


def test_clear_empties_stored_and_edited_copy() -> None:
    host = Host()
    host.ask("clear_project", 0.1, project=1)
    assert host.read(1) == Project()
    host.controller.power_cycle()
    assert host.read(1) == Project()
    assert host.ask("start_project", project=1) == [REPLIES["start_project"], NOTICE]


@pytest.mark.parametrize("save_cut", ["old", "empty"])
def test_supply_lost_during_a_save(save_cut: str) -> None:
    host = Host(save_cut=save_cut)
    host.ask("set_step_delay", delay=7, step=1)
    host.ask("save_project", 0.01, project=1)
    host.controller.power_cycle()
    assert host.wait(0.1) == [], "the acknowledgement is lost"
    assert host.read(1) == (EXAMPLE if save_cut == "old" else Project())


@pytest.mark.parametrize("order", ["little", "big"])
def test_dump_has_the_byte_order(order: str) -> None:
    host = Host(made(Step(distance=0x010203)), dump_order=order)
    (dump,) = host.ask("read_project", project=1)
    assert dump[26:29] == bytes((1, 2, 3) if order == "big" else (3, 2, 1))


# -- motion ------------------------------------------------------------------------------------------------------------


def test_project_runs_its_loops_and_sends_one_notice() -> None:
    there, back = (
        Step(**{**steps(made()), "delay": 100}),
        Step(**{**steps(made()), "direction": 1, "distance": 400}),
    )
    project = made(there, back, loop_first=1, loop_last=2, loop_count=2, project_loop=3)
    host = Host(project)
    assert host.ask("start_project", project=1) == [REPLIES["start_project"]]
    assert host.controller.status()["step"] == 1
    came = host.wait(30.0)
    assert came == [NOTICE]
    assert host.controller.position == 6 * (1600 - 400)
    assert host.phase == "idle"


def test_outputs_follow_steps_and_commands_and_stay_until_power_off() -> None:
    host = Host(made(Step(output=2), Step(output=4), Step(output=5)))
    host.ask("set_output", port=1, level=1)
    host.ask("set_output", port=5, level=1)
    host.ask("start_project", project=1)
    status = host.controller.status()
    assert status["outputs"] == [False, True, True]
    assert status["leds"] is True
    host.controller.power_cycle()
    assert host.controller.status()["outputs"] == [False] * 3


def test_inputs_start_stop_wait_and_cut() -> None:
    waits, cut = Step(**{**steps(made()), "start_input": 1}), Step(**{**steps(made()), "stop_input": 2})
    host = Host(made(waits, cut))
    assert host.ask("read_input", port=1)[0][5] == 0
    host.controller.set_input(3, True)
    assert host.phase == "waiting for an input"
    host.controller.set_input(1, True)
    assert host.phase == "moving"
    assert host.ask("read_input", port=1)[0][5] == 1
    host.wait(1.3)
    assert host.controller.status()["step"] == 2
    host.controller.set_input(2, True)
    assert host.wait(0.01) == [], "a project that an input started sends no notice"
    assert 1600 < host.controller.position < 2200
    host.controller.set_input(2, False)
    host.ask("start_project", project=1)
    host.controller.set_input(4, True)
    assert host.wait(5.0) == []
    assert host.phase == "idle"
    with pytest.raises(RequestError, match="input 6"):
        host.controller.set_input(6, True)


def test_busy_controller_acknowledges_and_ignores_a_start() -> None:
    host = Host(made(project_loop=255))
    host.ask("start_project", project=1)
    assert host.ask("jog_forward") == [REPLIES["jog_forward"]]
    assert host.controller.status()["project"] == 1
    host.ask("set_step_delay", delay=7, step=1)
    host.ask("stop_motor")
    host.wait(1.0)
    assert host.phase == "idle"


@pytest.mark.parametrize("mode", [0, 1])
def test_stop_mode_decides_how_a_stop_ends_the_motion(mode: int) -> None:
    host = Host(made())
    host.ask("set_stop_mode", stop_mode=mode)
    host.ask("jog_reverse", 0.5)
    host.ask("stop_project", 0.01)
    assert host.phase == "jogging", "stop project does not end a manual motion"
    host.ask("stop_motor", 0.002)
    assert host.phase == ("slowing down" if mode == 0 else "idle")
    host.wait(0.1)
    assert host.phase == "idle"
    assert host.controller.position < -400
    host.ask("jog_reverse", 0.5)
    host.ask("set_stop_mode", stop_mode=1 - mode)
    host.ask("stop_motor", 0.002)
    assert host.phase == ("idle" if mode == 0 else "slowing down")


@pytest.mark.parametrize(("tick", "seconds"), [(1.0, 1.092), (10.0, 1.853)])
def test_ramp_grows_in_each_tick(tick: float, seconds: float) -> None:
    host = Host(made(Step(distance=1600, speed=60, start_frequency=400, acceleration=10)), ramp_tick_ms=tick)
    host.ask("run_once", seconds - 0.03)
    assert host.phase == "making one move"
    host.wait(0.06)
    assert (host.phase, host.controller.position) == ("idle", 1600)
    assert host.wait(1.0) == []


# -- home switch, power ------------------------------------------------------------------------------------------------


def test_wired_switch_is_closed_at_its_place_and_behind_it() -> None:
    host = Host(made(), home_switch="wired", home_at=-500)
    host.ask("home", 10.0)
    status = host.controller.status()
    assert (status["phase"], status["position"], status["homed"], status["inputs"]) == ("idle", 0, True, [5])
    host.controller.set_input(5, False)
    assert host.controller.status()["inputs"] == [5], "its place has it"
    host.ask("jog_forward", 0.5)
    assert host.controller.status()["inputs"] == []
    host.ask("stop_motor", 2.0)
    host.ask("home", 10.0)
    assert host.controller.position == 0
    assert host.controller.offset == -500


@pytest.mark.parametrize(("switch", "inputs"), [("stuck", [5]), ("never", []), ("free", [])])
def test_other_home_switches(switch: str, inputs: list[int]) -> None:
    host = Host(made(), home_switch=switch)
    assert host.controller.status()["inputs"] == inputs
    host.ask("home", 60.0)
    assert host.phase == ("idle" if switch == "stuck" else "homing")
    assert host.controller.position == (0 if switch == "stuck" else pytest.approx(-60 * 1600, rel=0.01))
    host.controller.set_input(5, True)
    assert host.phase == ("homing" if switch == "never" else "idle")


def test_power_on_homing_moves_when_the_supply_comes() -> None:
    host = Host(made(power_on_home=1))
    host.controller.power_cycle()
    assert host.phase == "homing"
    host.controller.set_input(5, True)
    assert host.controller.status()["homed"] is True


def test_unplugged_controller_is_silent_and_comes_back_at_rest() -> None:
    host = Host(made(project_loop=255))
    host.ask("start_project", 0.5, project=1)
    place = host.controller.position
    host.controller.unplug()
    assert host.ask("stop_motor") == []
    assert host.phase == "off"
    host.controller.plug()
    assert (host.phase, host.controller.position) == ("idle", place)
    assert host.ask("stop_motor") == [REPLIES["stop_motor"]]
    assert host.wait(10.0) == []


def test_clock_may_begin_anywhere_and_nothing_depends_on_how_often_it_is_looked_at() -> None:
    often, once = Host(made(), at=1e6), Host(made(), at=1e6)
    for host in (often, once):
        host.ask("start_project", 0.0, project=1)
    for _ in range(300):
        often.wait(0.01)
    once.wait(3.0)
    assert [data for _, data in often.came] == [data for _, data in once.came]
    assert [at for at, _ in often.came] == pytest.approx([at for at, _ in once.came], abs=1e-6)
    assert often.came[-1][1] == NOTICE


def test_due_is_the_moment_of_the_next_event() -> None:
    host = Host(made())
    assert host.line.due() is None
    host.line.receive(encode("start_project", project=1), 0.0)
    assert host.line.due() == pytest.approx(0.002)
    host.wait(0.01)
    due = host.line.due()
    assert due is not None
    assert host.wait(due - host.now - 1e-6) == []
    assert host.wait(1e-6 + 1e-9) == [NOTICE]


def test_notice_without_a_cause() -> None:
    host = Host()
    host.controller.notice()
    assert host.wait(0.0) == [NOTICE]


# -- options -----------------------------------------------------------------------------------------------------------


def test_options_are_checked() -> None:
    assert len(Quirks.__dataclass_fields__) == 11, (
        "8 quirks, the place of the switch, and two settings of the bus"
    )
    assert {option.name for option in OPTIONS} >= {"motor", "dump_order", "select"}
    for options in (
        {"select": "both"},
        {"speed": 3},
        {"motor": 14},
        {"motor": "x"},
        {"dump_order": "middle"},
    ):
        with pytest.raises(RequestError):
            simulate((1,), **options)
    for ids, model in (((2,), ""), ((1, 1), ""), ((1,), "servo")):
        with pytest.raises(RequestError):
            simulate(ids, model)
    assert FAMILY.simulator((1,), "Stepper", turnaround="0.5").nodes[1].quirks.turnaround == 0.5  # type: ignore[attr-defined]
