"""Every case of the golden traces, as data; `EXCLUDED` are public names without a case, each with a reason."""

from __future__ import annotations

from math import nan
from typing import Any

from motorbus import stepper
from motorbus.families.kst.profiles import SAVE
from motorbus.families.stepper.parameters import encode_image
from tests.golden.recording import Argument, Call, Case

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
        "note_reply": "called by the driver with a reply",
        "raw": "converts a value; sends nothing",
        "refusal": "makes an error; sends nothing",
        "row": "gives a table row; sends nothing",
        "value": "converts a value; sends nothing",
    },
    "kst": {
        "settings_of": "settings of an open bus; sends nothing",
        "raw": "converts a value; sends nothing",
    },
    "stepper": {
        "raw": "converts a value; sends nothing",
    },
}

DEVICES = Argument(lambda bench: list(bench.devices.values()))
SETTINGS = Argument(lambda bench: bench.family.settings_of(bench.bus))
NO_FACTS: dict[str, Any] = {}


def call(name: str, *args: Any, **kwargs: Any) -> Call:
    return Call(name, args, kwargs)


def shared(name: str, *args: Any, **kwargs: Any) -> Call:
    """A function of the family."""
    return Call(name, args, kwargs, on="family")


def grouped(name: str, *args: Any, **kwargs: Any) -> Call:
    """A method of a group of all devices."""
    return Call(name, args, kwargs, on="group")


# -- FEETECH ---------------------------------------------------------------------------------------------------------

PREPARED = (call("prepare"),)
TORQUE_ON = (call("prepare"), call("enable_torque"))
VELOCITY = (call("set_mode", "velocity"), call("enable_torque"))
PWM = (call("set_mode", "pwm"), call("enable_torque"))
STEP = (call("set_mode", "step"), call("enable_torque"))
CURRENT = (call("set_mode", "current"), call("enable_torque"))

FEETECH: list[tuple[Call, str, tuple[Call, ...]]] = [
    (call("ping"), "", ()),
    (call("identify"), "", ()),
    (call("prepare"), "", ()),
    (call("read"), "", PREPARED),
    (call("read", "present_position", "goal_position"), "two", PREPARED),
    (call("read_raw", "present_position", "id"), "", PREPARED),
    (call("position"), "", PREPARED),
    (call("position"), "unprepared", ()),
    (call("velocity"), "", PREPARED),
    (call("load"), "", PREPARED),
    (call("current"), "", PREPARED),
    (call("voltage"), "", PREPARED),
    (call("temperature"), "", PREPARED),
    (call("telemetry"), "", PREPARED),
    (call("alarms"), "", PREPARED),
    (call("why_not_moving"), "", PREPARED),
    (call("mode"), "", PREPARED),
    (call("zero"), "", PREPARED),
    (call("write", acceleration=10.0), "ram", PREPARED),
    (call("write", max_temperature=60.0), "eeprom", PREPARED),
    (call("write", goal_position=2.5), "goal", TORQUE_ON),
    (call("write", goal_position=99.0), "out_of_range", TORQUE_ON),
    (call("write", present_position=1.0), "read_only", PREPARED),
    (call("write", force=True, max_temperature=70.0), "force", PREPARED),
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
    (call("jog", 1.0, 0.2), "", VELOCITY),
    (call("jog", 1.0, 0.2), "wrong_mode", TORQUE_ON),
    (call("set_duty", 0.2), "", PWM),
    (call("set_current", 0.1), "", CURRENT),
    (call("step", 0.2, wait=False), "", STEP),
    (call("set_id", 7), "", PREPARED),
    (call("set_baud", 500_000), "", PREPARED),
    (call("recover", "set_id", NO_FACTS), "no_facts", PREPARED),
    (call("factory_restore"), "", PREPARED),
    (call("calibrate"), "", PREPARED),
    (call("calibrate", 1.0), "to", PREPARED),
    (call("clear_turns"), "", PREPARED),
    (call("set_multi_turn", True), "on", PREPARED),
    (call("cap_torque", 0.5), "", PREPARED),
    (call("cap_current", 0.5), "", PREPARED),
    (call("recover_overload"), "", TORQUE_ON),
    (shared("scan", (1, 2, 3)), "ids", ()),
    (shared("sync_read", ("present_position", "present_velocity"), DEVICES), "", ()),
    (shared("sync_read", ("present_position",), (1, 2, 3, 9)), "one_missing", ()),
]
FEETECH_GROUP: list[tuple[Call, str]] = [
    (shared("prepare_all", DEVICES), ""),
    (grouped("positions"), ""),
    (grouped("read", "present_position", "present_velocity"), "group"),
    (
        shared(
            "sync_write", {1: {"goal_position": 2.5}, 2: {"goal_position": 2.6}, 3: {"goal_position": 2.7}}
        ),
        "",
    ),
    (grouped("write", "goal_position", values=(2.5, 2.6, 2.7)), "group"),
    (grouped("write", "goal_position", "goal_velocity", values=[(2.5, 1.0)] * 3), "group_two"),
    (shared("reg_write_all", {1: {"goal_position": 2.5}, 2: {"goal_position": 2.6}}), ""),
    (shared("action_all", DEVICES), ""),
    (shared("disable_torque_all", (1, 2, 3)), ""),
]
"""On three prepared servos."""


NARROW = (call("write", min_position_limit=1.9, max_position_limit=3.0), call("enable_torque"))
AWAY = (call("write", min_position_limit=3.2, max_position_limit=3.5),)
"""Limits that the servo stands outside of."""
TURNED = (call("calibrate", 1.0),)

FEETECH_STATES: list[tuple[Call, str, tuple[Call, ...]]] = [
    (call("set_mode", "position"), "after_current", (*CURRENT, call("set_current", 0.1))),
    (call("move", 2.5, current=0.5, wait=False), "current", TORQUE_ON),
    (call("action"), "unprepared", ()),
    (call("reg_write", goal_position=2.5), "again", (*TORQUE_ON, call("reg_write", goal_position=2.4))),
    (call("enable_torque"), "velocity_mode", VELOCITY[:1]),
    (call("enable_torque"), "pwm_mode", PWM[:1]),
    (call("enable_torque"), "step_mode", STEP[:1]),
    (call("enable_torque"), "current_mode", CURRENT[:1]),
    (call("stop"), "velocity_mode", VELOCITY),
    (call("stop"), "pwm_mode", PWM),
    (call("stop"), "step_mode", STEP),
    (call("stop"), "current_mode", CURRENT),
    (call("stop"), "unprepared", ()),
    (call("stop"), "limp", PREPARED),
    (call("disable_torque"), "unprepared", ()),
    (call("position"), "offset", TURNED),
    (call("position"), "offset_in_velocity_mode", (*TURNED, *VELOCITY[:1])),
    (call("move", 8.0, wait=False), "many_turns", (call("set_multi_turn", True), call("enable_torque"))),
    (call("position"), "resolution", (call("write", angular_resolution=2),)),
    (
        call("move", 5.0, wait=False),
        "resolution",
        (call("write", angular_resolution=2), call("enable_torque")),
    ),
]
"""The same commands on a servo in another mode or with other settings."""
FEETECH_REFUSED: list[tuple[Call, str, tuple[Call, ...]]] = [
    (call("enable_torque"), "outside_limits", AWAY),
    (call("move", 3.2), "outside_limits", NARROW),
    (call("write", goal_position=3.2), "outside_limits", NARROW),
    (call("reg_write", goal_position=3.2), "outside_limits", NARROW),
    (call("move", nan), "nan", TORQUE_ON),
    (call("move", 2.5, velocity=0.0), "no_velocity", TORQUE_ON),
    (call("move", 2.5, velocity=-1.0), "negative_velocity", TORQUE_ON),
    (call("move", 2.5, velocity=1e-9, wait=False), "tiny_velocity", TORQUE_ON),
    (call("move", 2.5, velocity=1e9), "huge_velocity", TORQUE_ON),
    (call("move", 2.5, current=0.0), "no_current", TORQUE_ON),
    (call("move", 2.5), "wrong_mode", VELOCITY),
    (call("set_velocity", nan), "nan", VELOCITY),
    (call("set_velocity", 1e9), "huge", VELOCITY),
    (call("set_velocity", -1.0), "negative", VELOCITY),
    (call("set_duty", 1.5), "above_1", PWM),
    (call("set_duty", -0.2), "negative", PWM),
    (call("set_current", 1e9), "huge", CURRENT),
    (call("step", 1e6), "huge", STEP),
    (call("step", 0.2), "wrong_mode", TORQUE_ON),
    (call("write", goal_torque=0), "zero_torque", TORQUE_ON),
    (call("set_mode", "nonsense"), "unknown", PREPARED),
    (call("set_mode", "position"), "back", (call("set_mode", "pwm"),)),
    (call("set_mode", "position", limits=(1.0, 4.0)), "back_with_limits", (call("set_mode", "pwm"),)),
    (call("write", nonsense=1), "unknown", PREPARED),
    (call("write", id=7), "protected", PREPARED),
    (call("write", goal_position=nan), "nan", TORQUE_ON),
    (call("write", goal_position="2.5"), "text", TORQUE_ON),
    (call("write", goal_position=2.5, max_position_limit=3.0), "goal_and_limit", TORQUE_ON),
    (call("read", "nonsense"), "unknown", PREPARED),
    (call("reg_write", max_temperature=60.0), "eeprom", PREPARED),
    (call("set_id", 254), "everyone", PREPARED),
    (call("set_baud", 1234), "unknown", PREPARED),
]
"""What is refused, or must not be sent as it is asked."""
FEETECH_STRANGER: list[tuple[Call, str]] = [
    (call("identify"), "unknown_firmware"),
    (call("read"), "unknown_firmware"),
    (call("telemetry"), "unknown_firmware"),
    (call("voltage"), "unknown_firmware"),
    (call("alarms"), "unknown_firmware"),
    (call("position"), "unknown_firmware"),
    (call("write", acceleration=10.0), "unknown_firmware"),
    (call("enable_torque"), "unknown_firmware"),
    (call("disable_torque"), "unknown_firmware"),
    (call("move", 2.5), "unknown_firmware"),
    (call("set_id", 7), "unknown_firmware"),
]
"""On a servo whose firmware tells no register map."""
FEETECH_GROUP_REFUSED: list[tuple[Call, str]] = [
    (shared("sync_write", {1: {"goal_position": 2.5}, 9: {"goal_position": 2.5}}), "one_silent"),
    (shared("sync_write", {1: {"goal_position": 2.5}, 2: {"goal_position": nan}}), "nan"),
    (shared("sync_write", {1: {"goal_position": 2.5}, 2: {"goal_position": 99.0}}), "out_of_range"),
    (shared("sync_write", {1: {"max_temperature": 60.0}}), "eeprom"),
    (grouped("write", "goal_position", values=(2.5, 2.6)), "group_too_few"),
    (grouped("write", "goal_position", values=(2.5, 2.6, nan)), "group_nan"),
    (grouped("write", "goal_position", values={3: 2.5, 2: 2.6, 1: 2.7}), "group_no_order"),
    (shared("reg_write_all", {1: {"goal_position": 2.5}, 9: {"goal_position": 2.5}}), "one_silent"),
    (shared("sync_read", ("nonsense",), DEVICES), "unknown"),
    (shared("disable_torque_all", (1, 9)), "one_silent"),
]
FEETECH_UNPREPARED: list[Call] = [
    grouped("positions"),
    grouped("write", "goal_position", values=(2.5, 2.6, 2.7)),
]


def _feetech() -> list[Case]:
    cases = []
    for name, model in MODELS.items():
        options = {"model": model, "position": 400 if name.startswith("scs") else 1800}
        for one, label, before in (*FEETECH, *FEETECH_STATES, *FEETECH_REFUSED):
            ids = (1,) if one.on == "device" else (1, 2, 3)
            cases.append(Case("feetech", name, one, label, before, ids, options))
        prepared = (shared("prepare_all", DEVICES),)
        for one, label in (*FEETECH_GROUP, *FEETECH_GROUP_REFUSED):
            before = () if one.name == "prepare_all" else prepared
            cases.append(Case("feetech", name, one, label, before, (1, 2, 3), options))
        cases += [
            Case("feetech", name, one, "unprepared", (), (1, 2, 3), options) for one in FEETECH_UNPREPARED
        ]
    cases += [
        Case("feetech", "sts", one, label, options={"firmware": "9.99"}) for one, label in FEETECH_STRANGER
    ]
    mixed = {"model": "sts3215+scs0009+hls3925"}
    for one, label in (*FEETECH_GROUP, (shared("sync_read", ("present_position",), DEVICES), "")):
        before = () if one.name == "prepare_all" else (shared("prepare_all", DEVICES),)
        cases.append(Case("feetech", "mixed", one, label, before, (1, 2, 3), mixed))
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
    (call("move", nan), "nan", ()),
    (call("move", 0.15), "travel_limits", (call("write", negative_limit=-0.2, positive_limit=0.1),)),
    (
        call("write", goal_position=0.15),
        "travel_limits",
        (call("write", negative_limit=-0.2, positive_limit=0.1),),
    ),
    (call("write", negative_limit=0.1), "limit_above_zero", ()),
    (call("write", negative_limit=-9.0, positive_limit=9.0), "limits_huge", ()),
    (call("write", node_id=9), "protected", ()),
    (call("write", nonsense=1), "unknown", ()),
    (call("read", "nonsense"), "unknown", ()),
    (call("set_node_id", 0), "everyone", ()),
    (call("set_bit_rate", 1234), "unknown", ()),
    (call("stop"), "", ()),
    (call("version"), "", ()),
    (call("node_id"), "", ()),
    (call("set_node_id", 9), "", ()),
    (call("set_bit_rate", 250_000), "", ()),
    (call("save"), "", ()),
    (call("provision", new_id=9, new_rate=250_000), "", ()),
    (call("set_id", 9), "", ()),
    (call("set_baud", 250_000), "", ()),
    (call("set_mid_point"), "", ()),
    (call("read", "negative_limit", "positive_limit"), "limits", ()),
    (call("write", negative_limit=-0.5, positive_limit=0.5), "limits", ()),
    (call("reversed"), "", ()),
    (call("set_reversed", True), "", ()),
]
KST_GROUP: list[tuple[Call, str]] = [
    (shared("scan", SETTINGS, (1, 2, 3)), "ids"),
    (shared("broadcast_write", "goal_position", 0.2, SETTINGS, nodes=(1, 2)), "goal"),
    (shared("broadcast_write", "store", SAVE, SETTINGS), "save"),
    (shared("broadcast_write", "bit_rate_code", 4, SETTINGS), "bit_rate"),
    (shared("broadcast_write", "node_id", 9, SETTINGS), "node_id_refused"),
    (shared("broadcast_write", "node_id", 9, SETTINGS, force=True), "node_id_forced"),
]
"""On a bus of two servos."""


def _kst() -> list[Case]:
    cases = []
    for profile in PROFILES:
        options = {"profile": profile}
        for one, label, before in KST:
            restarts = one.name in ("provision", "set_id", "set_baud")
            cases.append(Case("kst", profile, one, label, before, (1,), options, power_cycle=restarts))
        for one, label in KST_GROUP:
            reports = profile == "xqpower" and label == "goal"  # the start rule starts reports too
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
    cases.append(Case("kst", "kst", shared("scan", SETTINGS), "all", ids=(1, 2), lanes=True))
    for one in (call("move", 0.2, wait=False), call("save"), call("set_node_id", 9)):
        for form, value in (("sized_only", "yes"), ("unsized_only", "no")):
            cases.append(Case("kst", "kst", one, form, options={"profile": "kst", "sized": value}))
    beyond = shared("broadcast_write", "goal_position", 99.0, SETTINGS, nodes=(1, 2))
    cases.append(Case("kst", "kst", beyond, "beyond_limits", ids=(1, 2), lanes=True))
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
BACKUP = stepper.Backup(dumps={2: bytes.fromhex("ffaa3e020000") + encode_image(PROGRAM.project)})
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
    (call("clear", 3), "", ALIVE),
    (call("save_project", 2), "", SELECTED),
    (call("clear_project", 3), "", ALIVE),
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
    (call("run_once"), "", ALIVE),
    (call("home", deadline=8.0), "", ALIVE),
    (call("home", deadline=8.0, velocity=12.0), "velocity", ALIVE),
    (call("recover", "jog", NO_FACTS), "no_facts", ALIVE),
    (call("select_project", 2, 3), "", ALIVE),
    (call("select_project", 5, 1), "impossible", ALIVE),
    (call("set_microstep_and_angle", 0, 180), "impossible", SELECTED),
    (call("set_turn_distance", 0), "impossible", SELECTED),
    (call("set_step_distance", 11, 1), "impossible", SELECTED),
    (call("set_step_accel_speed", 1, 100, 70_000), "impossible", SELECTED),
    (call("set_output", 6, True), "impossible", ALIVE),
    (call("jog", nan, 0.5), "nan", ALIVE),
    (call("jog", 3.0, 61.0), "too_long", ALIVE),
    (call("home", deadline=0.0), "no_deadline", ALIVE),
    (call("run", 3), "empty", ALIVE),
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
        cases.append(case)
    return cases


CASES = [*_feetech(), *_kst(), *_stepper()]
