"""Staged faults as data: what is simulated, what is done to it, the first finding that is expected.

`stage` holds orders to simulated devices, as `3 unplug; 4 write torque_limit 300`; see `carry_out`. `machine` are the
axes of a machine file; without it the bus is examined by its address with the ids of `expect`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

SIX = "1-6"


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One fault. `code` and `where` are those of the first finding; `where` is a part of its text."""

    title: str
    code: str
    where: str = ""
    family: str = "feetech"
    ids: str = SIX
    options: Mapping[str, Any] = field(default_factory=dict)
    bus: str = ""
    stage: str = ""
    expect: str = SIX
    machine: str = ""
    saved: Mapping[str, str] = field(default_factory=dict)
    rate: float = 0.0


def axes(ids: str, bus: str = "arm", **keys: str) -> str:
    """The axes a1 … of a machine file, all with these keys."""
    text = ""
    for number in ids.split("+"):
        name = f"a{int(number, 0)}"
        values = {"device": f'"{bus}#{number}"', "max_velocity": '"90 deg/s"'} | keys
        text += f"[axis.{name}]\n" + "".join(f"{key} = {value}\n" for key, value in values.items())
    return text


def calibration(offsets: str) -> str:
    """A calibration file of LeRobot for the joints a1 …, with these homing offsets."""
    joints = [
        f'"a{id}": {{"id": {id}, "drive_mode": 0, "homing_offset": {offset}, "range_min": 0, "range_max": 4095}}'
        for id, offset in enumerate(offsets.split(), 1)
    ]
    return "{" + ", ".join(joints) + "}"


ALL = "1+2+3+4+5+6"
LIMITS = {"zero": '"180 deg"', "low": '"-90 deg"', "high": '"90 deg"'}
OFFSETS = "".join(f"{id} write homing_offset {id * 10}; " for id in range(1, 7))
BLUE, GREEN = calibration("10 20 30 40 50 60"), calibration("-70 -60 -50 -40 -30 -20")


def feetech(title: str, code: str, stage: str = "", where: str = "", **more: Any) -> Scenario:
    return Scenario(title=title, code=code, stage=stage, where=where, **more)


def kst(title: str, code: str, stage: str = "", where: str = "", **more: Any) -> Scenario:
    usual = {"family": "kst", "ids": "0x25-0x27", "expect": "0x25-0x27"}
    return Scenario(title=title, code=code, stage=stage, where=where, **usual | more)


def stepper(title: str, code: str, stage: str = "", where: str = "", **more: Any) -> Scenario:
    usual = {"family": "stepper", "ids": "1", "expect": ""}
    return Scenario(title=title, code=code, stage=stage, where=where, **usual | more)


SCENARIOS = (
    # -- chain
    feetech("one servo is unplugged", "device-missing", "3 unplug", "#3"),
    feetech("the cable after the fourth", "device-missing", "5 unplug; 6 unplug", "#5, "),
    feetech("the first is unplugged", "device-missing", "1 unplug", "#1"),
    feetech("no supply", "bus-silent", "all unplug"),
    feetech("no supply, no ids known", "bus-silent", "all unplug", expect=""),
    feetech("all at another rate", "wrong-rate", options={"servo_baud": 500_000}, bus=",baud=1000000"),
    feetech("SMS at its own rate", "wrong-rate", options={"model": "sm24bl"}, bus=",baud=1000000"),
    feetech("one at another rate", "wrong-rate", "4 write baud_rate 3", "#4"),
    feetech("lost replies", "replies-lost", options={"faults": "10%: drop"}),
    feetech("noise", "line-noise", options={"faults": "10%: corrupt"}),
    feetech("one loose plug", "replies-lost", "2 loose", "#2"),
    # -- adapter
    feetech("an adapter that echoes", "adapter-echo", options={"echo": True}),
    feetech("a silent bus behind an echo", "bus-silent", "all unplug", options={"echo": True}),
    feetech("a latency of 16 ms", "latency-timer", options={"faults": "100%: delay 0.016"}),
    feetech("the port goes away", "port-lost", options={"faults": "at 0.01 s: unplug 60"}),
    # -- power
    feetech("12 V for one servo of 7.4 V", "supply-out-of-range", "2 supply 12", "#2"),
    feetech("12 V for all", "supply-out-of-range", "all supply 12", "#1, "),
    feetech("a weak supply", "supply-out-of-range", "all supply 3.8"),
    feetech("7.4 V for a servo of 12 V", "supply-out-of-range", "1 supply 7.4", options={"model": "sm24bl"}),
    feetech("SCS at 12 V", "supply-out-of-range", "3 supply 12", options={"model": "scs0009"}),
    feetech("HLS at 3 V", "supply-out-of-range", "3 supply 3", options={"model": "hls3925"}),
    feetech("the supply dips", "supply-sag", "5 alarm 1", "#5"),
    feetech("wrong supply and an overload", "supply-out-of-range", "all supply 12; 3 alarm 32"),
    # -- ids
    feetech("two servos with id 3", "duplicate-id", "", "#3", options={"duplicate": "3"}),
    feetech("two new servos", "duplicate-id", "", "#1", ids="1", expect="1", options={"duplicate": "1"}),
    feetech("a new servo beside the arm", "factory-id", "", "#1", machine=axes("2+3+4+5+6")),
    feetech("a new servo in the place of another", "device-missing", "4 unplug", "a4", machine=axes("2+3+4+5+6")),
    feetech("a servo without an axis", "device-unnamed", "", "#7", ids="1-7", machine=axes(ALL)),
    # -- model
    feetech("unknown firmware", "model-unknown", "", "#1", ids="1", expect="1", options={"firmware": "9.9"}),
    feetech("two firmware versions", "firmware-mixed", ids="1-2", expect="1-2", options={"firmware": "3.9+3.10"}),
    # -- state and settings
    feetech("overheated", "too-hot", "4 heat 85", "#4"),
    feetech("nearly too hot", "too-hot", "4 heat 65", "#4"),
    feetech("SCS overheated", "too-hot", "4 heat 95", "#4", options={"model": "scs0009"}),
    feetech("overload latched", "overload-latched", "6 alarm 32", "#6"),
    feetech("position sensor", "alarm", "2 alarm 2", "#2"),
    feetech("over-current", "alarm", "2 alarm 8", "#2"),
    feetech("pushes against a stop", "load-high", "3 write goal_position 2048; 3 write torque_enable 1; 3 load 90"),
    feetech("closed limits", "motion-blocked", "3 write min_position_limit 3000; 3 write max_position_limit 900", "#3"),
    feetech("torque limit 0", "motion-blocked", "2 write torque_limit 0", "#2"),
    feetech("max_torque 0", "motion-blocked", "2 write max_torque 0", "#2"),
    feetech("unknown mode", "motion-blocked", "1 write operating_mode 9", "#1"),
    feetech("SCS with max_torque 0", "motion-blocked", "2 write max_torque 0", "#2", options={"model": "scs0009"}),
    feetech("torque limit left by a program", "settings-left", "6 write torque_limit 300", "#6"),
    feetech("goal velocity left by a program", "settings-left", "6 write goal_velocity 100", "#6"),
    feetech("no acknowledgement", "no-acknowledgement", "3 write status_return_level 0", "#3"),
    feetech("return delay as shipped", "return-delay", "3 write return_delay 250", "#3"),
    feetech("lock left open by LeRobot", "eeprom-open", "3 write lock 0", "#3"),
    feetech(
        "the seam inside the travel",
        "calibration-wrap",
        "3 write min_position_limit 1000; 3 write max_position_limit 3000; 3 position 4000",
        "#3",
    ),
    feetech("velocity mode for an axis", "mode-differs", "2 write operating_mode 1", "a2", machine=axes(ALL)),
    feetech("position mode, the axis is a wheel", "mode-differs", machine=axes(ALL, kind='"wheel"')),
    feetech("an interrupted change of an id", "change-unfinished", "3 unfinished", "#3"),
    # -- machine
    feetech("no TOML", "machine-file", machine="[axis.a1\n"),
    feetech("an unknown key", "machine-file", machine=axes("1", speed="3")),
    feetech("an axis without velocity", "machine-file", machine='[axis.a1]\ndevice = "arm#1"\n'),
    feetech("torque cap for SCS", "axis-mismatch", machine=axes(ALL, max_torque="0.5"), options={"model": "scs0009"}),
    feetech(
        "limits of another calibration",
        "calibration-differs",
        "2 write min_position_limit 1500; 2 write max_position_limit 2500",
        "a2",
        machine=axes(ALL, **LIMITS),
    ),
    feetech("resting outside its limits", "outside-limits", "4 position 3500", "a4", machine=axes(ALL, **LIMITS)),
    feetech(
        "leader and follower swapped",
        "calibration-other",
        OFFSETS,
        "arm",
        machine=axes(ALL),
        saved={"robots/so_follower/arm": GREEN, "teleoperators/so_leader/leader": BLUE},
    ),
    feetech(
        "one servo was replaced",
        "calibration-other",
        OFFSETS + "5 write homing_offset 0",
        "arm",
        machine=axes(ALL),
        saved={"robots/so_follower/arm": BLUE},
    ),
    feetech("limp at the end", "exit-falls", machine=axes(ALL, exit='"torque_off"')),
    feetech("limp at an emergency stop", "estop-falls", machine=axes(ALL)),
    feetech("a loop that is too fast", "loop-too-fast", rate=4000),
    feetech("a loop that fits", "loop-rate", rate=50),
    # -- kst
    kst("one KST is unplugged", "device-missing", "0x26 unplug", "#0x26"),
    kst("no KST answers", "can-silent", "all unplug"),
    kst("another bit rate", "can-wrong-bitrate", options={"bit_rate": 125_000}),
    kst("29-bit identifiers", "can-silent", options={"id_format": "ext"}, bus=",id_format=std"),
    kst("another node sends reports only", "can-mute-node", "all mute"),
    kst("an id that waits for a restart", "can-id-pending", "0x25 value node_id 0x30", "#0x25"),
    kst("two KST with one id", "duplicate-id", "", "#0x26", options={"duplicate": "0x26"}),
    kst("KST is hot", "too-hot", "0x26 heat 95", "#0x26", options={"profile": "kst-ext"}),
    kst("another profile", "model-unknown", bus=",profile=kst-ext"),
    kst("lost frames", "replies-lost", options={"faults": "10%: drop"}),
    kst("damaged frames", "replies-lost", options={"faults": "15%: corrupt"}),
    kst("a new KST beside the others", "factory-id", "", "#0x25", machine=axes("0x26+0x27")),
    kst("no torque switch", "axis-mismatch", "", "a38", machine=axes("0x25+0x26+0x27", exit='"torque_off"')),
    kst("no such emergency stop", "axis-mismatch", machine=axes("0x25+0x26", estop='"torque_off"')),
    # -- stepper
    stepper("no controller", "bus-silent", "1 unplug"),
    stepper("the line echoes", "adapter-echo", options={"echo": True}),
    stepper("dumps in the other order", "stepper-foreign", options={"dump_order": "big"}, bus=",dump_order=little"),
    stepper("a project that cannot move", "project-error", "1 project microsteps 0", "#1"),
    stepper("no home switch", "homing-not-seen", "1 project power_on_home 1", options={"home_switch": "never"}),
    stepper("replies are lost", "replies-lost", options={"faults": "30%: drop"}),
)  # fmt: skip
