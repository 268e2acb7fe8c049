"""Out of an overload: torque off, a pause, the goal to where it stands, torque on; and the truth about the alarm.

A servo that was overloaded for too long falls to its protective torque and stays there. What clears that is not
documented: some get well when their torque is switched off and on, others only by a power cycle, and which is which
shows only afterwards. An alarm never keeps the torque from being switched off.
Source: STS3215 memory table V3.6 (registers 34 to 36); open-edge-platform/physical-ai-studio#955 (only a power cycle
helped); humancomputerlab/lelamp_runtime#9 (libraries that take an alarm for a failure cannot switch off).
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.family import State
from motorbus.core.register import RegisterMap
from motorbus.core.steps import Sleep, catch
from motorbus.errors import DeviceError, MotorbusError, RequestError
from motorbus.families.feetech.driver.alarm import alarms
from motorbus.families.feetech.driver.feedback import state_exchange
from motorbus.families.feetech.driver.identity import writable
from motorbus.families.feetech.driver.motion import enable_torque
from motorbus.families.feetech.driver.node import Node
from motorbus.families.feetech.driver.torque import disable_torque

TRIPS: Final = frozenset(("overload", "current"))
"""Alarms that stay after what raised them is over."""
REST: Final = 1.0
"""s without torque before it is switched on again."""
_LONGEST: Final = 3600.0
"""s; whoever asks for more has mistaken the unit."""


class Recovery(NamedTuple):
    """What there was to recover from, by the names of alarms (() when there was nothing, and nothing was done), and
    the alarms that remain, in words."""

    tripped: tuple[str, ...]
    remaining: tuple[str, ...]


async def recover_overload(node: Node, *, rest: float = REST) -> Recovery:
    """Bring a servo back whose overload (or over-current) protection has tripped; it holds where it stands then.

    Between the two it is limp for `rest` s, and an arm sags. Does nothing when neither alarm is set. Raises
    DeviceError, with the servo limp, when the alarm stays: then only a power cycle helps; what enable_torque()
    raises, after letting go once more, with a note when even that was not acknowledged; RequestError, with nothing
    sent, when `rest` is no finite number from 0 on.
    """
    _check(node, rest)
    table = await writable(node)
    tripped = tuple(name for name in (await state_exchange(node, table)).alarm if name in TRIPS)
    if tripped:
        await disable_torque(node)
        await Sleep(rest)
        try:
            await enable_torque(node)
            stays = await _tripped(node, table)
        except MotorbusError as error:
            await _let_go(node, error)
            raise
        if stays:
            await disable_torque(node)
            raise _stays(node, tripped)
    return Recovery(tripped, await alarms(node))


def _check(node: Node, rest: float) -> None:
    number = isinstance(rest, int | float) and not isinstance(rest, bool)
    if not (number and 0 <= rest <= _LONGEST):
        raise RequestError(
            f"node {node.node}: {rest!r} is no time to rest",
            expected=f"0 to {_LONGEST:.0f} s",
            advice="leave it out for one second; nothing was sent",
            node=node.node,
        )


async def _let_go(node: Node, error: MotorbusError) -> None:
    """Whatever came of switching its torque on, it ends limp."""
    failure = await catch(disable_torque(node))
    if failure is not None:
        error.add_note(
            f"node {node.node} may still hold: disable_torque() was not acknowledged ({failure.summary})"
        )


async def _tripped(node: Node, table: RegisterMap) -> bool:
    state: State = await state_exchange(node, table)
    return bool(TRIPS.intersection(state.alarm))


def _stays(node: Node, tripped: tuple[str, ...]) -> DeviceError:
    return DeviceError(
        f"node {node.node}: the alarm {' and '.join(tripped)} is still set after its torque was off and on again",
        cause="some servos forget an overload only when their supply goes; or it is overloaded again already",
        advice="take its load away, then switch its supply off and on; it is limp now",
        node=node.node,
    )
