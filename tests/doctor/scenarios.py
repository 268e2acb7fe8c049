"""Staged faults as data: what is simulated, what is done to it, the first finding that is expected.

`stage` holds orders to simulated devices, as `3 unplug; 4 write torque_limit 300`; "
"see `carry_out`. `machine` are the
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


HELD = {**LIMITS, "estop": '"hold"'}
KEYS = 'low = "-30 deg"\nhigh = "30 deg"\nmax_velocity = "90 deg/s"\n'
LEADER_GONE = '\n[bus.leader]\naddress = "feetech:/dev/ttyNOSUCH97"\n'
LEADER_GONE += f'[axis.leader_pan]\ndevice = "leader#1"\nzero = "180 deg"\nestop = "hold"\n{KEYS}'
HEAD_HALF = '\n[bus.head]\naddress = "kst:sim,ids=0x25,clock=virtual"\n'
HEAD_HALF += f'[axis.pan]\ndevice = "head#0x25"\n{KEYS}[axis.tilt]\ndevice = "head#0x26"\n{KEYS}'

# fmt: off
# Written by a reader who had not seen the checks.
STAGED = (
    feetech(
        "the 12 V brick of the other arm on a 7.4 V arm, and the gripper has tripped meanwhile",
        "supply-out-of-range", "all supply 12; 6 alarm 32",
    ),
    feetech(
        "a freshly charged two-cell pack: 8.4 V where the servos stop at 8.0 V", "supply-out-of-range",
        "all supply 8.4",
    ),
    feetech(
        "24 V servos on a 12 V bench supply", "supply-out-of-range", "all supply 12", ids="1-3",
        expect="1-3", options={"model": "sm40blhv"}, bus=",baud=115200",
    ),
    feetech(
        "a voltage alarm is kept though the supply measures 7.4 V now", "supply-sag", "3 alarm 1", "#3",
    ),
    feetech(
        "the end of the chain drops to 5 V while the wrist and gripper push", "supply-sag",
        "5 write goal_position 2048; 5 write torque_enable 1; 6 write goal_position 2048; "
        "6 write torque_enable 1; 5 load 60; 6 load 60; 5 supply 5.1; 6 supply 4.9",
    ),
    feetech("the switch of the power strip is off", "bus-silent", "all unplug"),
    feetech(
        "one new servo on the bench, its plug in the wrong socket", "bus-silent", "1 unplug", ids="1",
        expect="1",
    ),
    feetech(
        "the address was copied from an arm at 500000 bit/s, this one has a megabit", "wrong-rate",
        bus=",baud=500000",
    ),
    feetech(
        "SMS servos as shipped, at 115200, asked at the usual megabit", "wrong-rate", ids="11-14",
        expect="11-14", options={"model": "sm85blhv"}, bus=",baud=1000000",
    ),
    feetech(
        "only the elbow was set to 115200 by a tool that stopped halfway", "wrong-rate",
        "3 write baud_rate 4", "#3",
    ),
    feetech(
        "the cable between the third and the fourth joint has come out", "device-missing",
        "4 unplug; 5 unplug; 6 unplug", "#4",
    ),
    feetech(
        "an unshielded extension beside the spindle motor breaks every seventh reply", "line-noise",
        options={"faults": "seed 3; 15%: corrupt"},
    ),
    feetech(
        "the second servo has a crimp that fails when the arm is moved", "replies-lost", "2 loose", "#2",
    ),
    feetech(
        "an adapter that holds what it receives for 16 ms", "latency-timer",
        options={"faults": "100%: delay 0.016"},
    ),
    feetech("a home-made half-duplex board that hears itself", "adapter-echo", options={"echo": True}),
    feetech(
        "the USB plug slips out while the bus is examined", "port-lost",
        options={"faults": "exchange 15: unplug 600"},
    ),
    feetech(
        "the follower is there, the port of the leader is not", "port-missing",
        machine=axes(ALL, **HELD) + LEADER_GONE, where="leader",
    ),
    feetech(
        "two new servos straight from the box on one cable", "duplicate-id", "", "#1", ids="1", expect="",
        options={"duplicate": "1"},
    ),
    feetech(
        "a spare was numbered 3 like the elbow, and the shoulder has other firmware", "duplicate-id", "",
        "#3", options={"duplicate": "3", "firmware": "3.10+3.9+3.10+3.10+3.10+3.10"},
    ),
    feetech(
        "a hand with ids 11 to 15 and a fresh finger still at id 1", "factory-id", "", "#1", ids="1+11-15",
        expect="11-15",
    ),
    feetech(
        "big ids: 200 to 253, and a new servo was added without a number", "factory-id", "", "#1",
        ids="1+200-202+253", expect="200-202+253", options={"model": "hls3925"},
    ),
    feetech(
        "a gripper was added to the arm and not to the machine file", "device-unnamed", "", "#6",
        machine=axes("1+2+3+4+5", **HELD),
    ),
    feetech(
        "one board on the bus reports firmware 20.1", "model-unknown", "", "#3",
        options={"firmware": "3.10+3.10+20.1+3.10+3.10+3.10"},
    ),
    feetech(
        "a clone with firmware 9.1 in the middle of a mixed bus", "model-unknown", "3 write lock 0", "#12",
        ids="3+7+12", expect="3+7+12",
        options={"model": "hls3925+scs0009+sts3215", "firmware": "3.43+0.10+9.1"},
    ),
    feetech(
        "a replaced wrist has firmware 3.9, the rest 3.10, and LeRobot refuses", "firmware-mixed",
        options={"firmware": "3.10+3.10+3.10+3.9+3.10+3.10"},
    ),
    feetech(
        "mixed models whose firmware may differ, but two of the four STS3215 differ too", "firmware-mixed",
        options={"model": "sts3215+sts3215+sts3215+sts3215+hls3925+scs0009", "firmware": "3.10+3.9+3.10+3.9+3.43+0.10"},
    ),
    feetech("the program was killed while it renumbered the elbow", "change-unfinished", "3 unfinished"),
    feetech(
        "the supply went during a change of the id, and its servo is silent now", "change-unfinished",
        "2 unplug; 2 unfinished",
    ),
    feetech(
        "the arm answers, one of the two CAN servos of its head does not", "device-missing", "", "tilt",
        machine=axes(ALL, **HELD) + HEAD_HALF,
    ),
    feetech(
        "the gripper squeezed a block until its protection tripped", "overload-latched",
        "6 alarm 32; 6 heat 58", "#6",
    ),
    feetech(
        "a small SCS0009 of a gimbal has tripped", "overload-latched", "22 alarm 32", "#22", ids="21-23",
        expect="21-23", options={"model": "scs0009"},
    ),
    feetech(
        "the shoulder held a stretched arm all night: one degree above its limit", "too-hot", "2 heat 71",
        "#2",
    ),
    feetech(
        "an SCS15 beside STS servos is hot by its own limit of 80 degrees", "too-hot", "5 heat 86", "#5",
        options={"model": "sts3215+sts3215+sts3215+sts3215+scs15+sts3215"},
    ),
    feetech("the magnet of an encoder has come off", "alarm", "4 alarm 2", "#4"),
    feetech(
        "an over-current alarm on a bus that echoes as well", "alarm", "5 alarm 8", "#5",
        options={"echo": True},
    ),
    feetech(
        "the camera on the wrist is too heavy for the elbow", "load-high",
        "3 write goal_position 2048; 3 write torque_enable 1; 3 load 74", "#3",
    ),
    feetech(
        "an HLS that never trips leans against a stop with nine tenths of its torque", "load-high",
        "2 write goal_position 2048; 2 write torque_enable 1; 2 load 90", "#2", ids="1-3", expect="1-3",
        options={"model": "hls3925"},
    ),
    feetech(
        "the goal was acknowledged, the torque limit is 0", "motion-blocked",
        "3 write torque_limit 0; 3 write goal_position 3000; 3 write torque_enable 1", "#3",
    ),
    feetech(
        "an HLS with goal torque 0: everything is acknowledged and it stays limp", "motion-blocked",
        "2 write goal_torque 0; 2 write goal_position 1000; 2 write torque_enable 1", "#2", ids="1-2",
        expect="1-2", options={"model": "hls3955"},
    ),
    feetech(
        "a teleoperation script left the shoulder at 30 % torque, and the lock open", "settings-left",
        "2 write torque_limit 300; 2 write lock 0", "#2",
    ),
    feetech(
        "someone tuned the live gain of an HLS and went home", "settings-left", "2 write live_p 90", "#2",
        ids="1-3", expect="1-3", options={"model": "hls3606"},
    ),
    feetech(
        "a fast-write script switched off the acknowledgements of one servo", "no-acknowledgement",
        "2 write status_return_level 0", "#2",
    ),
    feetech(
        "all servos of a walking robot answer reads only", "no-acknowledgement",
        "all write status_return_level 0", ids="31-38", expect="31-38", options={"model": "sts3032"},
    ),
    feetech("one servo came with a return delay of 250", "return-delay", "4 write return_delay 250", "#4"),
    feetech(
        "SMS servos as shipped, at the right rate", "return-delay", ids="1-2", expect="1-2",
        options={"model": "sm30bl"}, bus=",baud=115200",
    ),
    feetech(
        "LeRobot was stopped with the torque off: every lock is open", "eeprom-open", "all write lock 0",
    ),
    feetech(
        "an SCS whose lock, at another address, was left open", "eeprom-open", "3 write lock 0", "#3",
        ids="2-4", expect="2-4", options={"model": "scs15"},
    ),
    feetech(
        "the elbow was replaced after LeRobot had calibrated the arm", "calibration-other",
        "1 write homing_offset 110; 2 write homing_offset -220; 3 write homing_offset 700; "
        "4 write homing_offset 441; 5 write homing_offset -550; 6 write homing_offset 660",
        "#3", saved={"robots/so_follower/arm": calibration("110 -220 330 440 -550 660")},
    ),
    feetech(
        "a new gripper with offset 0 in an arm whose leader has a file too", "calibration-other",
        "1 write homing_offset 1010; 2 write homing_offset 920; 3 write homing_offset -830; "
        "4 write homing_offset 740; 5 write homing_offset -650",
        "#6",
        saved={"robots/so_follower/blue": calibration("1010 920 -830 740 -650 560"),
        "teleoperators/so_leader/blue": calibration("-15 -25 -35 45 55 65")},
    ),
    feetech(
        "the wrist was turned over the seam: it stands at 25 counts, its travel is 2600 to 4095",
        "calibration-wrap",
        "5 write min_position_limit 2600; 5 write max_position_limit 4095; 5 position 25", "#5",
    ),
    feetech(
        "the offset of another servo was copied: the shoulder is far outside of its own limits",
        "calibration-wrap",
        "2 write homing_offset 1980; 2 write min_position_limit 800; 2 write max_position_limit 2400; "
        "2 position 3600",
        "#2",
    ),
    feetech(
        "the zero of the file lies 10 degrees before the seam and the axis swings 60 to both sides",
        "calibration-wrap", "all position 4000",
        machine=axes(ALL, zero='"350 deg"', low='"-60 deg"', high='"60 deg"', estop='"hold"'),
    ),
    feetech(
        "the elbow was swept again, shorter, after the file was written", "calibration-differs",
        "3 write min_position_limit 1500; 3 write max_position_limit 2600", "a3",
        machine=axes(ALL, **HELD),
    ),
    feetech(
        "only the upper end of the gripper moved at its new calibration", "calibration-differs",
        "6 write min_position_limit 900; 6 write max_position_limit 2500; 6 write lock 0", "a6",
        machine=axes(ALL, **HELD),
    ),
    feetech(
        "the arm was folded by hand: the wrist stands 46 degrees beyond its limit", "outside-limits",
        "4 position 3600", "a4", machine=axes(ALL, **HELD),
    ),
    feetech(
        "a little below the lower limit: five degrees", "outside-limits", "2 position 967", "a2",
        machine=axes("1+2+3", **HELD), ids="1-3", expect="1-3",
    ),
    feetech(
        "a joint was left in velocity mode by a wheel demo", "mode-differs",
        "3 write operating_mode 1; 5 write return_delay 250", "a3", machine=axes(ALL, **HELD),
    ),
    feetech(
        "LeRobot has put the wheels of a rover into position mode", "mode-differs",
        "7 write operating_mode 1; 8 write operating_mode 0; 9 write operating_mode 1", "a8", ids="7-9",
        expect="7-9", machine=axes("7+8+9", kind='"wheel"'),
    ),
    feetech(
        "an SCS joint whose two limits were set to 0 is a motor now", "mode-differs",
        "2 write min_position_limit 0; 2 write max_position_limit 0", "a2", ids="1-3", expect="1-3",
        options={"model": "scs0009"},
        machine=axes("1+2+3", zero='"150 deg"', low='"-60 deg"', high='"60 deg"', estop='"hold"'),
    ),
    feetech(
        "the file of an STS arm on SCS0009 servos, which have 300 degrees", "axis-mismatch",
        options={"model": "scs0009"},
        machine=axes(ALL, zero='"180 deg"', low='"-150 deg"', high='"150 deg"', estop='"hold"'),
    ),
    feetech(
        "a wheel that still has the limits of the joint it was copied from", "machine-file", ids="7-8",
        expect="7-8", machine=axes("7+8", kind='"wheel"', **LIMITS),
    ),
    feetech(
        "every axis parks at its end and there is no pose park", "machine-file",
        machine=axes(ALL, exit='"park"', **LIMITS),
    ),
    feetech(
        "an upright arm lets go at the end of each program", "exit-falls",
        machine=axes(ALL, exit='"torque_off"', **HELD),
    ),
    feetech(
        "an upright arm holds at the end, and lets go at an emergency stop", "estop-falls",
        machine=axes(ALL, exit='"hold"', estop='"torque_off"', **LIMITS),
    ),
    feetech(
        "a loop of 500 Hz over a line of 38400 bit/s", "loop-too-fast", options={"servo_baud": 38400},
        bus=",baud=38400", machine=axes(ALL, **HELD), rate=500.0,
    ),
    feetech(
        "1000 Hz wanted, and each of the six replies waits half a millisecond", "loop-too-fast",
        "all write return_delay 250", machine=axes(ALL, **HELD), rate=1000.0,
    ),
    feetech("a healthy arm at 50 Hz", "loop-rate", machine=axes(ALL, **HELD), rate=50.0),
    kst("the CAN cable ends in the air", "can-silent", "all unplug"),
    kst(
        "one servo alone on the bench, its supply forgotten, its id not known", "can-silent", "all unplug",
        ids="0x30", expect="", options={"profile": "kst-ext"}, bus=",profile=kst-ext",
    ),
    kst(
        "servos of a drone, set to 1 Mbit/s by its autopilot", "can-wrong-bitrate",
        options={"bit_rate": 1000000},
    ),
    kst(
        "the address says 1 Mbit/s, the servos have the 500 kbit/s of the factory", "can-wrong-bitrate",
        bus=",bitrate=1000000",
    ),
    kst(
        "a long bus at 125 kbit/s", "can-wrong-bitrate", ids="0x01-0x03", expect="0x01-0x03",
        options={"bit_rate": 125000},
    ),
    kst(
        "one node of another maker sends and never answers", "can-mute-node", "0x26 mute", "#0x26",
        options={"profile": "kst-ext"}, bus=",profile=kst-ext",
    ),
    kst(
        "the whole bus reports and answers no read", "can-mute-node", "all mute",
        options={"profile": "kst-ext"}, bus=",profile=kst-ext",
    ),
    kst("the last servo of the chain has lost its plug", "device-missing", "0x27 unplug", "#0x27"),
    kst(
        "no termination: one frame in seven is broken", "line-noise",
        options={"faults": "seed 5; 15%: corrupt"},
    ),
    kst("a CAN plug that is not pushed home", "replies-lost", "0x26 loose", "#0x26"),
    kst("two servos as shipped share 0x25", "duplicate-id", "", "#0x25", options={"duplicate": "0x25"}),
    kst(
        "the user numbered two servos, and a third is still at 0x25", "factory-id", "", "#0x25",
        ids="0x25+0x30+0x7f", expect="0x30+0x7f",
    ),
    kst(
        "a new id was written and the supply was not cut", "can-id-pending", "0x25 value node_id 48",
        "#0x25",
    ),
    kst(
        "the id that waits for the power cycle is that of a neighbour", "can-id-pending",
        "0x27 value node_id 38", "#0x27", options={"profile": "kst-ext"}, bus=",profile=kst-ext",
    ),
    kst(
        "a rudder servo in the sun, 92 degrees", "too-hot", "0x26 heat 92", "#0x26",
        options={"profile": "kst-ext"}, bus=",profile=kst-ext",
    ),
    kst("the adapter is lost in the middle", "port-lost", options={"faults": "exchange 8: unplug 600"}),
    kst(
        "a CAN adapter behind a slow network: 16 ms for each reply", "latency-timer",
        options={"faults": "100%: delay 0.016"},
    ),
    kst("the zero of an axis has no unit", "machine-file", machine=axes("0x25+0x26+0x27", zero='"90"')),
    kst(
        "the axes shall let go at the end, which a KST servo cannot", "axis-mismatch",
        machine=axes("0x25+0x26+0x27", low='"-40 deg"', high='"40 deg"', exit='"torque_off"'),
    ),
    kst(
        "a third servo that no axis names", "device-unnamed", "", "#0x27",
        machine=axes("0x25+0x26", low='"-40 deg"', high='"40 deg"'),
    ),
    kst(
        "a flap stands at 60 degrees, its axis ends at 30", "outside-limits", "0x26 position 600",
        machine=axes("0x25+0x26+0x27", low='"-30 deg"', high='"30 deg"'),
    ),
    kst(
        "three healthy servos at 20 Hz", "loop-rate",
        machine=axes("0x25+0x26+0x27", low='"-40 deg"', high='"40 deg"'), rate=20.0,
    ),
    stepper("the controller has no supply", "bus-silent", "1 unplug"),
    stepper(
        "the address says that the highest byte comes first, and the controller sends the lowest",
        "stepper-foreign", bus=",dump_order=big",
    ),
    stepper(
        "the step angle of project 1 is 0: the motor never turns", "project-error",
        "1 project step_angle 0",
    ),
    stepper(
        "the loop of project 1 goes from step 4 to step 2 of one", "project-error",
        "1 project loop_first 4; 1 project loop_last 2; 1 project loop_count 3",
    ),
    stepper(
        "it homes at power-on and the switch is not connected", "homing-not-seen",
        "1 project power_on_home 1", options={"home_switch": "never"},
    ),
    stepper("RX and TX of the level shifter are joined", "adapter-echo", options={"echo": True}),
    stepper("the plug of the controller is loose", "replies-lost", "1 loose"),
    stepper(
        "a missing ground: one reply in five is broken", "line-noise",
        options={"faults": "seed 9; 20%: corrupt"},
    ),
    stepper(
        "the motor shall be released at the end, which no command does", "axis-mismatch", "", "a1",
        machine=axes("1", exit='"torque_off"'),
    ),
)
MORE = (
    feetech("limp at the end", "exit-falls", machine=axes(ALL, exit='"torque_off"')),
    feetech("limp at an emergency stop", "estop-falls", machine=axes(ALL)),
    stepper(
        "dumps in the other order", "stepper-foreign", options={"dump_order": "big"},
        bus=",dump_order=little",
    ),
    stepper(
        "no home switch", "homing-not-seen", "1 project power_on_home 1", options={"home_switch": "never"},
    ),
)
# fmt: on
SCENARIOS = STAGED + MORE
ACCEPTED = {
    "the zero of the file lies 10 degrees before the seam and the axis swings 60 to both sides": "calibration-differs",
    "the file of an STS arm on SCS0009 servos, which have 300 degrees": "calibration-differs",
    "the supply went during a change of the id, and its servo is silent now": "device-missing",
}
"""First findings that are right as well, by title."""
