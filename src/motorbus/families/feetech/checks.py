"""Checks of a FEETECH servo: supply, heat, overload, settings. Reads only.

Limits are those of the servo itself: kits of 7.4 V and 12 V look alike (lerobot#1010, physical-ai-studio#416).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from motorbus.core.findings import Check, Subject
from motorbus.families.feetech.driver import diagnosis, feedback
from motorbus.families.feetech.driver.requests import read_block
from motorbus.families.feetech.traits import Mode

FACTORY_ID: Final = 1
WARM: Final = 10  # °C below the limit at which the servo switches off
HIGH_LOAD: Final = 0.8  # duty at standstill: it pushes against something # assumption
SLACK: Final = 5.0  # deg outside its limits that play and a hand explain # assumption
LONG_DELAY: Final = 200e-6  # s; 250 in register 7 is 500 µs
AT_REST: Final = (
    "its torque is off",
    "its goal velocity is 0",
    "its duty is 0",
    "its goal current is 0",
    "goal_torque is 0",
)
"""Reasons of `why_not_moving` that hold for a healthy servo at rest."""
Raw = Callable[[str], int]


async def check(subject: Subject) -> None:
    """All checks of one servo, by two reads."""
    node = subject.device
    state = await feedback.telemetry(node)
    data = await read_block(node, 0, diagnosis.REGISTERS, bytes)
    table = node.table

    def raw(name: str) -> int:
        return feedback.raw_in(table, name, data, 0)

    _check_supply(subject, state, raw)
    _check_heat_and_load(subject, state, raw)
    _check_alarms(subject)
    _check_left_over(subject, raw)
    _check_acknowledgement(subject, raw)
    _check_range(subject, state)
    for reason in await diagnosis.why_not_moving(node):
        text, _, fix = reason.partition(": ")
        if not text.startswith(AT_REST) and text not in node.alarm:
            subject.error("motion-blocked", text, "a goal is acknowledged and nothing moves", fix)


def _check_supply(subject: Subject, state: Any, raw: Raw) -> None:
    low, high, supply = raw("min_voltage") / 10, raw("max_voltage") / 10, state.voltage
    evidence = f"supply {supply:.1f} V, limits of the servo {low:.1f} to {high:.1f} V"
    if not supply:
        subject.warn(
            "supply-out-of-range", evidence, "the phase register of another model", "compare `phase`"
        )
    elif supply > high:
        cause = "a supply for another variant, as 12 V for a 7.4 V servo"
        subject.error("supply-out-of-range", evidence, cause, f"use a supply of at most {high:.1f} V")
    elif supply < low:
        cause = "a weak supply, a long or thin cable, or a supply for another variant"
        subject.error("supply-out-of-range", evidence, cause, f"use a supply of at least {low:.1f} V")
    elif "voltage" in subject.device.alarm:
        cause = "it dips below the limit while servos push"
        subject.error("supply-sag", f"{evidence}, alarm set", cause, "use a supply with more current")


def _check_heat_and_load(subject: Subject, state: Any, raw: Raw) -> None:
    limit, load = raw("max_temperature"), abs(state.load or 0.0)
    evidence = f"{state.temperature:.0f} °C, limit {limit} °C"
    if state.temperature > limit:
        cause = "it held or pushed for too long; it has switched off"
        subject.error("too-hot", evidence, cause, "switch torque off until it is cool")
    elif state.temperature > limit - WARM:
        subject.warn("too-hot", evidence, "it switches off above the limit", "let it rest, or lower the load")
    if load > HIGH_LOAD and not state.moving and "overload" not in state.alarm:
        cause = "its goal is beyond an obstacle, or the load is too heavy"
        evidence = f"duty {load:.0%} at standstill, limit {HIGH_LOAD:.0%}"
        subject.warn("load-high", evidence, cause, "move the goal back, or write a lower max_torque")


def _check_alarms(subject: Subject) -> None:
    for name in subject.device.alarm:
        if name == "overload":
            cause = diagnosis.MEANING[name].partition(":")[0]
            fix = f"free the joint, then `motorbus feetech recover-overload {subject.where}`"
            subject.error("overload-latched", "alarm overload is set", cause, fix)
        elif name not in ("voltage", "temperature"):
            cause = diagnosis.MEANING.get(name, "no source explains this bit")
            subject.error("alarm", f"alarm {name} is set", cause, "cut its supply for a moment")


def _check_left_over(subject: Subject, raw: Raw) -> None:
    """Settings in RAM that another program left; they last until the supply is cut."""
    node, cause = subject.device, "another program left it in RAM; it lasts until the supply is cut"
    table, limit = node.table, node.traits.limit
    if limit and 0 < raw(limit) < raw("max_torque"):
        evidence = f"{limit} {raw(limit) / 10:.0f} %, max_torque {raw('max_torque') / 10:.0f} %"
        subject.warn("settings-left", evidence, cause, f"`motorbus write {subject.where} {limit}=1`")
    speed = raw("goal_velocity")
    if node.known_mode is Mode.POSITION and node.settings.zero_is_maximum and speed:
        value = float(node.value(table["goal_velocity"], speed))
        fix = "cut its supply for a moment, or give each move a velocity"
        subject.warn("settings-left", f"goal_velocity {value:.3g} rad/s, power-up value 0", cause, fix)


def _check_acknowledgement(subject: Subject, raw: Raw) -> None:
    table, where = subject.device.table, subject.where
    if "status_return_level" in table and raw("status_return_level") == 0:
        cause = "writes are not acknowledged, so none can be confirmed"
        fix = f"`motorbus write {where} status_return_level=1`"
        subject.warn("no-acknowledgement", "status_return_level 0, expected 1", cause, fix)
    delay = raw("return_delay") * 2e-6 if "return_delay" in table else 0.0
    if delay > LONG_DELAY:
        evidence = f"return_delay {delay * 1e6:.0f} µs, limit {LONG_DELAY * 1e6:.0f} µs"
        fix = f"`motorbus write {where} return_delay=0`"
        subject.inform("return-delay", evidence, "each reply waits so long", fix)
    if "lock" in table and raw("lock") == 0:
        cause = "LeRobot opens it with each torque-off; a write to EEPROM now survives power-off"
        subject.inform("eeprom-open", "lock 0, expected 1", cause, f"`motorbus write {where} lock=1`")


def _check_range(subject: Subject, state: Any) -> None:
    """A position far outside of the limits of a servo within one turn: the seam lies inside the travel."""
    node = subject.device
    if node.known_mode is not Mode.POSITION or node.settings.many_turns or node.limits is None:
        return
    low, high = (angle * 57.2958 for angle in node.limits)
    here = state.position * 57.2958
    if low < high and not low - SLACK <= here <= high + SLACK:
        evidence = f"position {here:.1f} deg, limits {low:.1f} to {high:.1f} deg"
        cause = (
            "the seam of the encoder lies inside the travel, or the homing offset is of another calibration"
        )
        subject.error("calibration-wrap", evidence, cause, "`motorbus setup calibrate` of this joint")


CHECKS: Final[tuple[Check, ...]] = (check,)
