"""Checks of a FEETECH servo: supply, heat, overload, settings. Reads only.

Limits are those of the servo itself: kits of 7.4 V and 12 V look alike (lerobot#1010, physical-ai-studio#416).
"""

from __future__ import annotations

from collections.abc import Callable
from math import degrees
from typing import Final

from motorbus.core.family import State
from motorbus.core.findings import Check, Subject
from motorbus.families.feetech.driver import diagnosis, feedback
from motorbus.families.feetech.driver.requests import read_block
from motorbus.families.feetech.traits import Mode

FACTORY_ID: Final = 1
WARM: Final = 10  # °C below the limit at which the servo switches off
HIGH_LOAD: Final = 0.7  # duty at standstill: it pushes against something # assumption
SLACK: Final = 5.0  # deg outside its limits that play and a hand explain # assumption
LONG_DELAY: Final = 200  # µs; 250 in register 7 is 500 µs
LIMP: Final = "its torque is off"
AT_REST: Final = (LIMP, "its goal velocity is 0", "its duty is 0", "its goal current is 0")
"""Reasons of `why_not_moving` that hold for a healthy servo at rest."""
GAINS: Final = ("p", "i", "d")
Raw = Callable[[str], int]  # raw value of a row; 1 where the map has no such row


async def check(subject: Subject) -> None:
    """All checks of one servo."""
    node = subject.device
    state = await feedback.telemetry(node)
    data = await read_block(node, 0, diagnosis.REGISTERS, bytes)

    def raw(name: str) -> int:
        return feedback.raw_in(node.table, name, data, 0) if name in node.table else 1

    _check_supply(subject, state, raw)
    _check_heat_and_load(subject, state, raw)
    for name in state.alarm:
        if name == "overload":
            subject.add("overload-latched", "alarm overload is set")
        elif name not in ("voltage", "temperature"):
            subject.add("alarm", f"alarm {name} is set", diagnosis.MEANING.get(name, ""))
    _check_left_over(subject, raw)
    _check_settings(subject, raw)
    _check_range(subject, state)
    reasons = await diagnosis.why_not_moving(node)
    is_limp = any(reason.startswith(LIMP) for reason in reasons)
    at_rest = (*AT_REST, "goal_torque is 0") if is_limp else AT_REST
    for reason in reasons:
        text, _, fix = reason.partition(": ")
        if not text.startswith(at_rest) and text not in state.alarm:
            subject.add("motion-blocked", text, action=fix)


def _check_supply(subject: Subject, state: State, raw: Raw) -> None:
    supply, low, high = state.voltage or 0.0, raw("min_voltage") / 10, raw("max_voltage") / 10
    evidence = f"supply {supply:.1f} V, limits of the servo {low:.1f} to {high:.1f} V"
    if not low <= supply <= high:
        subject.add("supply-out-of-range", evidence)
    elif "voltage" in state.alarm:
        subject.add("supply-sag", f"{evidence}, voltage alarm set")


def _check_heat_and_load(subject: Subject, state: State, raw: Raw) -> None:
    limit, heat, load = raw("max_temperature"), state.temperature or 0.0, abs(state.load or 0.0)
    if heat > limit - WARM:
        evidence = f"{heat:.0f} °C, it switches off above {limit} °C"
        subject.add("too-hot", evidence, severity="error" if heat > limit else "warning")
    if load > HIGH_LOAD and not state.moving and "overload" not in state.alarm:
        subject.add("load-high", f"duty {load:.0%} at standstill, limit {HIGH_LOAD:.0%}")


def _check_left_over(subject: Subject, raw: Raw) -> None:
    """Settings in RAM that another program left."""
    node = subject.device
    limit = node.traits.limit
    if limit and 0 < raw(limit) < raw("max_torque"):
        evidence = f"{limit} {raw(limit) / 10:.0f} %, max_torque {raw('max_torque') / 10:.0f} %"
        subject.add("settings-left", evidence)
    speed = raw("goal_velocity")
    if node.known_mode is Mode.POSITION and node.settings.zero_is_maximum and speed:
        value = float(node.value(node.table["goal_velocity"], speed))
        subject.add("settings-left", f"goal_velocity {value:.3g} rad/s, power-up value 0 (maximum)")
    for gain in GAINS:
        now, saved = raw(f"live_{gain}"), raw(f"position_{gain}")
        if f"live_{gain}" in node.table and now != saved:
            subject.add("settings-left", f"live_{gain} {now}, position_{gain} {saved}")


def _check_settings(subject: Subject, raw: Raw) -> None:
    if raw("status_return_level") == 0:
        subject.add("no-acknowledgement", "status_return_level 0, expected 1")
    if (delay := 2 * raw("return_delay")) > LONG_DELAY:
        subject.add("return-delay", f"return_delay {delay} µs, limit {LONG_DELAY} µs")
    if raw("lock") == 0:
        subject.add("eeprom-open", "lock 0, expected 1")


def _check_range(subject: Subject, state: State) -> None:
    """A position far outside of the limits of a servo within one turn."""
    node = subject.device
    if node.known_mode is not Mode.POSITION or node.settings.many_turns or node.limits is None:
        return
    low, high = map(degrees, node.limits)
    here = degrees(state.position or 0.0)
    if low < high and not low - SLACK <= here <= high + SLACK:
        subject.add("calibration-wrap", f"position {here:.1f} deg, limits {low:.1f} to {high:.1f} deg")


CHECKS: Final[tuple[Check, ...]] = (check,)
