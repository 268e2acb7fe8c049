"""Why does it not move? The settings of a servo that keep it from obeying a goal, each with what to do about it.

"Velocity mode is dead" has been a wrong mode, a torque limit of 0, a goal torque of 0, limits without a way between
them, an alarm that lets the torque drop; all of them acknowledge every order. The EEPROM lock is not among them: it
decides what survives power-off, not what is obeyed (feetech-cli, measured on STS3215).
Source: FEETECH SDK hls.py and the HLS memory table for the goal torque; STS3215 memory table V3.6 for the masks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from motorbus.core.family import State
from motorbus.core.register import RegisterMap
from motorbus.core.steps import catch
from motorbus.errors import MotorbusError
from motorbus.families.feetech.driver.alarm import bounds_of, in_words
from motorbus.families.feetech.driver.identity import prepare, writable
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.registers import read_raw
from motorbus.families.feetech.table import CONTROL, Mode

_ASKED: Final = (
    *(
        "torque_enable",
        "max_torque",
        "torque_limit",
        "goal_torque",
        "min_position_limit",
        "max_position_limit",
    ),
    *("goal_velocity", "goal_time", "unload_mask", "hardware_error"),
)


class Blocked(NamedTuple):
    """Alarms in words, and settings that keep a servo from obeying."""

    alarms: tuple[str, ...]
    settings: tuple[str, ...]


async def blockers(node: Node) -> tuple[str, ...]:
    """What keeps this servo from obeying, in words; () when nothing does. Reads only.

    Judged by the mode it is in: in velocity mode a goal velocity of 0 is told, in position mode limits that leave no
    way. What is mechanical (blocked, too heavy a load) no register tells.
    """
    await prepare(node)
    table = await writable(node)
    raws = await read_raw(node, *(name for name in _ASKED if name in table))
    return (*_mode(node, raws), *_power(node, table, raws), *_alarms(table, raws))


async def blocked(node: Node, table: RegisterMap, state: State) -> Blocked:
    """What can be said about a servo that did not get where it should, of which this is the last sample.

    Never raises on account of the servo: what it does not answer is left out.
    """
    settings = await catch(blockers(node))
    told: tuple[str, ...] = state.alarm
    if told:
        bounds = await catch(bounds_of(node, table))
        told = told if isinstance(bounds, MotorbusError) else in_words(state, bounds)
    return Blocked(told, () if isinstance(settings, MotorbusError) else settings)


def _mode(node: Node, raws: Mapping[str, int]) -> Iterator[str]:
    mode, settings = node.known_mode, node.settings
    assert settings is not None
    if mode is None:
        yield f"its operating mode {settings.mode_code} is not documented: set_mode('position')"
    low, high = raws["min_position_limit"], raws["max_position_limit"]
    if mode is Mode.POSITION and low >= high and not settings.many_turns:
        yield f"its position limits ({low} to {high}, raw) leave no way between them: write limits that do"
    control = node.control
    if mode is Mode.VELOCITY and raws["goal_velocity"] == 0:
        yield "its goal velocity is 0: set_velocity() gives one"
    if mode is Mode.PWM and control.duty and raws[control.duty] == 0:
        yield "its duty is 0: set_duty() gives one"
    if control.current and raws[control.current] == 0:
        yield from _powerless(mode, control.current, settings.protection_current)


def _powerless(mode: Mode | None, name: str, protection: int) -> Iterator[str]:
    """What a goal torque of 0 does in this mode, and which order ends that; nothing where nobody has said."""
    if mode is Mode.CURRENT:
        yield f"{name}, its goal current, is 0: set_current() gives one"
    if mode not in (Mode.POSITION, Mode.VELOCITY):
        return
    orders = "move()" if mode is Mode.POSITION else "set_velocity()"
    what = f"{name} is 0: the current of its motor is bounded to 0 A, and nothing moves it"
    other = f"write({name}=…) sets a bound in A until power-off"
    if protection:
        yield f"{what}: enable_torque() and {orders} set it to its protection current; {other}"
    else:
        yield f"{what}, and its protection current is 0 as well: {other}, write(protection_current=…) one for good"


def _power(node: Node, table: RegisterMap, raws: Mapping[str, int]) -> Iterator[str]:
    if raws["torque_enable"] != 1:
        yield f"its torque is off (torque_enable {raws['torque_enable']}): enable_torque()"
    live = CONTROL[table.name].limit
    if live and raws[live] == 0:
        yield f"{live} is 0: write({live}=1.0)"
    if raws["max_torque"] == 0:
        later = " after the next power-up" if live else ""
        yield f"max_torque is 0, which bounds its torque{later}: write(max_torque=1.0)"


def _alarms(table: RegisterMap, raws: Mapping[str, int]) -> Iterator[str]:
    names = table["hardware_error"].bits
    for bit, name in names.items():
        if not raws["hardware_error"] >> bit & 1:
            continue
        if name == "overload":
            yield "the alarm overload has tripped: it pushes with its protective torque only: recover_overload()"
        elif raws["unload_mask"] >> bit & 1:
            yield f"the alarm {name} lets its torque drop (unload_mask): find what raises it"
