"""Every case of the golden traces, as data; `EXCLUDED` are public names without a case, each with a reason."""

from __future__ import annotations

from math import tau
from typing import Any

from motorbus import stepper
from tests.support.golden import Argument, Call, Case

MODELS = {
    "sts": "sts3215",
    "smbl": "sm85blhv",
    "smcl": "sm60-360m",
    "scs": "scs0009",
    "scs2": "scs215-2",
    "hls": "hls3925",
}
"""Register map of a FEETECH servo -> a model that has it."""
PROFILES = ("kst", "kst-ext", "kingmax", "xqpower")
VARIANTS = {"feetech": tuple(MODELS), "kst": PROFILES, "stepper": ("",)}
"""Family -> what each command has a case for."""

EXCLUDED = {
    "feetech": {
        "copyable": "lists table rows; sends nothing",
        "forget_settings": "memory of the driver; sends nothing",
        "heard": "called by the driver with a reply",
        "raw": "converts a value; sends nothing",
        "value": "converts a value; sends nothing",
    },
    "kst": {
        "dialect_of": "settings of an open bus; sends nothing",
        "raw": "converts a value; sends nothing",
        "value": "converts a value; sends nothing",
    },
    "stepper": {
        "raw": "converts a value; sends nothing",
        "value": "converts a value; sends nothing",
    },
}

DEVICES = Argument(lambda bench: list(bench.devices.values()))
DIALECT = Argument(lambda bench: bench.family.dialect_of(bench.bus.family))
NO_FACTS: dict[str, Any] = {}


def call(name: str, *args: Any, **kwargs: Any) -> Call:
    return Call(name, args, kwargs)


def shared(name: str, *args: Any, **kwargs: Any) -> Call:
    """A function of the family."""
    return Call(name, args, kwargs, on="family")


# -- FEETECH ---------------------------------------------------------------------------------------------------------

PREPARED = (call("prepare"),)
TORQUE_ON = (call("prepare"), call("enable_torque"))
VELOCITY = (call("set_mode", "velocity"), call("enable_torque"))
PWM = (call("set_mode", "pwm"), call("enable_torque"))
STEP = (call("set_mode", "step"), call("enable_torque"))
CURRENT = (call("set_mode", "current"), call("enable_torque"))
FEW_POLLS = 10

FEETECH: list[tuple[Call, str, tuple[Call, ...]]] = [
    (call("ping"), "", ()),
    (call("identify"), "", ()),
    (call("prepare"), "", ()),
    (call("read"), "", PREPARED),
    (call("read", "present_position", "goal_position"), "two", PREPARED),
    (call("read_raw", "present_position", "id"), "", PREPARED),
    (call("position"), "", PREPARED),
    (call("position"), "unprepared", ()),
    (call("position", confirmed=True), "confirmed", PREPARED),
    (call("velocity"), "", PREPARED),
    (call("load"), "", PREPARED),
    (call("current"), "", PREPARED),
    (call("voltage"), "", PREPARED),
    (call("temperature"), "", PREPARED),
    (call("telemetry"), "", PREPARED),
    (call("alarms"), "", PREPARED),
    (call("blockers"), "", PREPARED),
    (call("mode"), "", PREPARED),
    (call("zero"), "", PREPARED),
    (call("many_turns"), "", PREPARED),
    (call("second_id"), "", PREPARED),
    (call("torque_limit"), "", PREPARED),
    (call("gains"), "", PREPARED),
    (call("protection"), "", PREPARED),
    (call("write", acceleration=10.0), "ram", PREPARED),
    (call("write", max_temperature=60.0), "eeprom", PREPARED),
    (call("write", goal_position=2.5), "goal", TORQUE_ON),
    (call("write", goal_position=99.0), "out_of_range", TORQUE_ON),
    (call("write", present_position=1.0), "read_only", PREPARED),
    (call("rewrite", max_temperature=70.0), "", PREPARED),
    (call("reg_write", goal_position=2.5), "", TORQUE_ON),
    (call("action"), "", (*TORQUE_ON, call("reg_write", goal_position=2.5))),
    (call("enable_torque"), "", PREPARED),
    (call("disable_torque"), "", TORQUE_ON),
    (call("move", 2.5), "", TORQUE_ON),
    (call("move", 2.5, velocity=1.0, acceleration=5.0, wait=False), "no_wait", TORQUE_ON),
    (call("move", 99.0), "beyond_limits", TORQUE_ON),
    (call("stop"), "", TORQUE_ON),
    (call("set_mode", "velocity"), "velocity", PREPARED),
    (call("set_mode", "pwm"), "pwm", PREPARED),
    (call("set_mode", "step"), "step", PREPARED),
    (call("set_mode", "current"), "current", PREPARED),
    (call("set_velocity", 1.0, acceleration=5.0), "", VELOCITY),
    (call("set_velocity", 1.0), "wrong_mode", TORQUE_ON),
    (call("set_duty", 0.2), "", PWM),
    (call("set_current", 0.1), "", CURRENT),
    (call("step", 0.2, wait=False), "", STEP),
    (call("duplicates", FEW_POLLS), "", PREPARED),
    (call("set_id", 7, among=(1, 2, 3)), "", PREPARED),
    (call("set_baud", 500_000, among=(1, 2, 3)), "", PREPARED),
    (call("set_second_id", 7, among=(1, 2, 3)), "", PREPARED),
    (call("recover", "set_id", NO_FACTS), "no_facts", PREPARED),
    (call("factory_restore"), "", PREPARED),
    (call("calibrate"), "", PREPARED),
    (call("calibrate", 1.0), "to", PREPARED),
    (call("clear_turns"), "", PREPARED),
    (call("set_many_turns", True), "on", PREPARED),
    (call("set_torque_limit", 0.5), "", PREPARED),
    (call("set_torque_limit", 0.5, persistent=True), "persistent", PREPARED),
    (call("set_gains", p=20), "", PREPARED),
    (call("set_protection", torque=0.3, max_temperature=60.0), "", PREPARED),
    (call("recover_overload"), "", TORQUE_ON),
    (shared("scan", (1, 2, 3)), "ids", ()),
    (shared("sync_read", ("present_position", "present_velocity"), DEVICES), "", ()),
    (shared("sync_read", ("present_position",), (1, 2, 3, 9)), "one_missing", ()),
]
FEETECH_GROUP: list[tuple[Call, str]] = [
    (shared("prepare_all", DEVICES), ""),
    (shared("read_positions", DEVICES), ""),
    (shared("sync_read_positions", DEVICES), ""),
    (shared("sync_read_states", DEVICES), ""),
    (shared("sync_read_raw", 40, 2, DEVICES), ""),
    (
        shared(
            "sync_write", {1: {"goal_position": 2.5}, 2: {"goal_position": 2.6}, 3: {"goal_position": 2.7}}
        ),
        "",
    ),
    (Call("sync_writer", (DEVICES, "goal_position"), {"values": (2.5, 2.6, 2.7)}, on="kept"), ""),
    (shared("sync_write_positions", DEVICES, (2.5, 2.6, 2.7)), ""),
    (shared("reg_write_all", {1: {"goal_position": 2.5}, 2: {"goal_position": 2.6}}), ""),
    (shared("action_all"), ""),
    (shared("disable_torque_all", (1, 2, 3)), ""),
]
"""On three prepared servos."""


def _feetech() -> list[Case]:
    cases = []
    for name, model in MODELS.items():
        options = {"model": model, "position": 400 if name.startswith("scs") else 1800}
        for one, label, before in FEETECH:
            ids = (1,) if one.on == "device" else (1, 2, 3)
            cases.append(Case("feetech", name, one, label, before, ids, options))
        prepared = (shared("prepare_all", DEVICES),)
        for one, label in FEETECH_GROUP:
            before = () if one.name == "prepare_all" else prepared
            cases.append(Case("feetech", name, one, label, before, (1, 2, 3), options))
    cases.append(Case("feetech", "sts", shared("scan"), "all", ids=(1, 2, 200)))
    cases.append(Case("feetech", "sts", shared("scan", (1, 2), (1_000_000, 500_000)), "rates", ids=(1, 2)))
    return cases


# -- KST -------------------------------------------------------------------------------------------------------------

KST: list[tuple[Call, str, tuple[Call, ...]]] = [
    (call("ping"), "", ()),
    (call("identify"), "", ()),
    (call("read"), "", ()),
    (call("read", "present_position"), "one", ()),
    (call("read_raw", "present_position", "node_id"), "", ()),
    (call("write", goal_position=0.2), "goal", ()),
    (call("write", goal_position=99.0), "out_of_range", ()),
    (call("write", present_position=1.0), "read_only", ()),
    (call("position"), "", ()),
    (call("telemetry"), "", ()),
    (call("status"), "", ()),
    (call("current"), "", ()),
    (call("temperature"), "", ()),
    (call("move", 0.2), "", ()),
    (call("move", 0.2, wait=False), "no_wait", ()),
    (call("move", 99.0), "beyond_limits", ()),
    (call("stop"), "", ()),
    (call("version"), "", ()),
    (call("node_id"), "", ()),
    (call("set_node_id", 9), "", ()),
    (call("bit_rate"), "", ()),
    (call("set_bit_rate", 250_000), "", ()),
    (call("save"), "", ()),
    (call("provision", new_id=9, new_rate=250_000), "", ()),
    (call("set_id", 9), "", ()),
    (call("set_baud", 250_000), "", ()),
    (call("start_reports", 0.02), "", ()),
    (call("stop_reports"), "", (call("start_reports", 0.02),)),
    (call("set_mid_point"), "", ()),
    (call("travel_limits"), "", ()),
    (call("set_travel_limits", -0.5, 0.5), "", ()),
    (call("reversed"), "", ()),
    (call("set_reversed", True), "", ()),
]
KST_GROUP: list[tuple[Call, str]] = [
    (shared("scan", (1, 2, 3), (), DIALECT), "ids"),
    (shared("scan_bit_rates", DIALECT, rates=(500_000, 250_000)), "listen"),
    (shared("scan_bit_rates", DIALECT, rates=(250_000, 500_000), isolated=True), "isolated"),
    (shared("broadcast_read", "node_id", DIALECT), ""),
    (shared("broadcast_position", 0.2, (1, 2), DIALECT), ""),
    (shared("broadcast_save", DIALECT), ""),
    (shared("broadcast_bit_rate", 250_000, DIALECT), ""),
    (shared("broadcast_node_id", 9, DIALECT), "refused"),
    (shared("broadcast_node_id", 9, DIALECT, force=True), "forced"),
]
"""On a bus of two servos."""


def _kst() -> list[Case]:
    cases = []
    for profile in PROFILES:
        options = {"profile": profile, "position": 50}
        for one, label, before in KST:
            restarts = one.name in ("provision", "set_id", "set_baud")
            cases.append(Case("kst", profile, one, label, before, (1,), options, power_cycle=restarts))
        for one, label in KST_GROUP:
            reports = (
                profile == "xqpower" and one.name == "broadcast_position"
            )  # the start rule starts reports too
            cases.append(
                Case(
                    "kst",
                    profile,
                    one,
                    label,
                    (),
                    (1, 2),
                    options,
                    lanes=True,
                    keep="requests" if reports else "all",
                )
            )
    cases.append(Case("kst", "kst", shared("scan", (), (), DIALECT), "all", ids=(1, 2), lanes=True))
    extended = {"profile": "kst-ext", "id_format": "ext"}
    cases.append(Case("kst", "kst-ext", call("position"), "extended_id", options=extended))
    return cases


# -- stepper ---------------------------------------------------------------------------------------------------------

PROGRAM = stepper.Program.parse(
    """format = 1
name = "golden"
project = 2

[motor]
microsteps = 8
step_angle = "1.8 deg"
turn_distance = 1600

[[step]]
move = "1 turns"
speed = "60 rpm"
acceleration = "100 Hz"
start = "400 Hz"
output = "output 1 on"
delay = "200 ms"

[[step]]
move = "-0.5 turns"
speed = "90 rpm"
acceleration = "100 Hz"
start = "400 Hz"
"""
)
ALIVE = (call("ping"),)
SELECTED = (call("ping"), call("select_project", 2, 2))
WRITTEN = (call("write_project", PROGRAM),)
BACKUP = stepper.Backup(dumps={2: PROGRAM.dump()})
SWITCH_AT_HOME = {"home_switch": "wired", "home_at": -800}

STEPPER: list[tuple[Call, str, tuple[Call, ...]]] = [
    (call("ping"), "", ()),
    (call("identify"), "", ()),
    (call("read"), "", ALIVE),
    (call("read", "microsteps", "step_1_speed"), "two", ALIVE),
    (call("read_raw", "microsteps"), "", ALIVE),
    (call("read_project", 1), "", ALIVE),
    (call("read_input", 5), "", ALIVE),
    (call("read_input", 6), "impossible", ALIVE),
    (call("dump", 2), "", ALIVE),
    (call("backup"), "", ALIVE),
    (call("restore", BACKUP), "", ALIVE),
    (call("difference", PROGRAM), "", ALIVE),
    (call("write_project", PROGRAM), "", ALIVE),
    (call("write_project", PROGRAM, save=False), "unsaved", ALIVE),
    (call("write", project=1, step_1_delay=0.5), "", ALIVE),
    (call("select", 1), "", ALIVE),
    (call("save", 2), "", (call("write_project", PROGRAM, save=False),)),
    (call("clear", 3), "", ALIVE),
    (call("start_project", 2), "", WRITTEN),
    (call("run", 2), "", WRITTEN),
    (call("stop"), "", ALIVE),
    (call("stop"), "while_running", (*WRITTEN, call("start_project", 2))),
    (call("set_output", 1, True), "", ALIVE),
    (call("set_output", 4, False), "all_off", ALIVE),
    (call("inputs"), "", ALIVE),
    (call("watch_inputs", (1, 5), 1.0), "", ALIVE),
    (call("jog", 3.0, 0.5), "", ALIVE),
    (call("jog_forward", 0.5), "", ALIVE),
    (call("jog_reverse", 0.5), "", ALIVE),
    (call("move_by", 3.0, velocity=6.0), "", ALIVE),
    (call("move_by", -tau, wait=False), "no_wait", ALIVE),
    (call("move_by", 3.0, wait=False), "borrow_no_wait", ALIVE),
    (call("run_once"), "", ALIVE),
    (call("home", deadline=8.0), "", ALIVE),
    (call("home", deadline=8.0, velocity=12.0), "velocity", ALIVE),
    (call("characterise"), "", ALIVE),
    (call("recover", "jog", NO_FACTS), "no_facts", ALIVE),
    (call("select_project", 2, 3), "", ALIVE),
    (call("set_microstep_and_angle", 8, 180), "", SELECTED),
    (call("set_turn_distance", 5000), "", SELECTED),
    (call("set_step_distance", 1, 1600), "", SELECTED),
    (call("set_step_direction_start", 1, 1, 400), "", SELECTED),
    (call("set_step_accel_speed", 1, 100, 60), "", SELECTED),
    (call("set_step_output", 1, 2), "", SELECTED),
    (call("set_step_delay", 1, 500), "", SELECTED),
    (call("set_step_start_input", 1, 5), "", SELECTED),
    (call("set_step_stop_input", 1, 2), "", SELECTED),
    (call("set_step_stop_input", 1, 4), "impossible", SELECTED),
    (call("set_segment_loop", 1, 2, 3), "", SELECTED),
    (call("set_project_loop", 3), "", SELECTED),
    (call("stop_project"), "", ALIVE),
    (call("stop_motor"), "", ALIVE),
    (call("set_stop_mode", 1), "", SELECTED),
    (call("set_mode4", 1), "", SELECTED),
    (call("set_power_on_home", 0), "", SELECTED),
]


def _stepper() -> list[Case]:
    cases = []
    for one, label, before in STEPPER:
        options = SWITCH_AT_HOME if one.name == "home" else {}
        case = Case("stepper", "", one, label, before, options=options, timed=("seconds", "measured"))
        if one.name == "watch_inputs":
            case = case._replace(polls=True)
        if one.name == "characterise":
            case = case._replace(keep="none")  # about 1,700 frames whose number depends on timing
        cases.append(case)
    return cases


CASES = [*_feetech(), *_kst(), *_stepper()]
