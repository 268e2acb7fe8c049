"""When is a move over? In position, stalled, or out of time; judged by samples and by the link's clock alone.

The moving flag of these servos says only half: it also drops when the servo stands off its goal. So arrival needs
both a position within tolerance and standstill, and a stall is a position that no longer changes.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from motorbus.core.family import State
from motorbus.core.register import RegisterMap
from motorbus.core.steps import Sleep
from motorbus.errors import MotionError, Stalled
from motorbus.families.feetech.driver.blocked import Blocked, blocked
from motorbus.families.feetech.driver.feedback import state_exchange
from motorbus.families.feetech.driver.node import Node

POLL: Final = 0.02
"""s between two looks; leaves a bus at 1 Mbaud to others for nine tenths of the time and more."""
PATIENCE: Final = 0.5
"""s without progress after which a servo counts as stalled."""
PROGRESS: Final = 0.003
"""rad; a little less than two counts of an STS3215. Less than this is noise."""
UNHURRIED: Final = 2.0
"""rad/s that every servo surely reaches; the time allowed for a move is reckoned with it."""


class Move(NamedTuple):
    """A move that was ordered: goal in rad, bounds (None: the servo's own), tolerance in rad, timeout in s.

    `resolution` is one count of this servo in rad. `turn` is given where positions are told within a turn (rad) and
    goals go beyond: they are compared within a turn then. `start` is where a relative move began: the way is followed
    from there, turn by turn.
    """

    goal: float
    velocity: float | None
    acceleration: float | None
    tolerance: float
    timeout: float | None
    resolution: float = 0.0
    turn: float | None = None
    start: float | None = None

    @property
    def progress(self) -> float:
        """rad; less than this is noise."""
        return max(PROGRESS, 1.9 * self.resolution)

    @property
    def patience(self) -> float:
        """A slow move takes its time for two counts."""
        return PATIENCE + 2 * self.progress / (self.velocity or UNHURRIED)

    def allowance(self, way: float) -> float:
        """Seconds after which it should long have gone this way (rad)."""
        if self.timeout is not None:
            return self.timeout
        speed = min(self.velocity or UNHURRIED, UNHURRIED)
        ramps = speed / self.acceleration if self.acceleration else 0.0
        return 1.0 + 2.0 * (way / speed + ramps)


async def arrive(node: Node, table: RegisterMap, move: Move) -> None:
    """Poll until the move is over. Raises Stalled, or MotionError when the time is up."""
    look = state_exchange(node, table)
    if move.turn is not None:
        await Sleep(POLL)  # a goal that is whole turns away looks like this place until it moves
    state = await look
    begun = progressed = state.at
    mark = place = _place(state, move, move.start)
    allowance = move.allowance(abs(place - move.goal))
    while abs(place - move.goal) > move.tolerance or state.moving:
        if abs(place - mark) >= move.progress:
            mark, progressed = place, state.at
        elif state.at - progressed > move.patience:
            why = await blocked(node, table, state)
            raise _stalled(node, place, move, why)
        if state.at - begun > allowance:
            raise _late(node, place, move, allowance)
        await Sleep(POLL)
        state = await look
        place = _place(state, move, place if move.start is not None else None)


def _place(state: State, move: Move, last: float | None) -> float:
    """Where it is (rad): where positions are told within a turn, the one next to where it was last, or to the goal."""
    assert state.position is not None
    if move.turn is None:
        return state.position
    near = move.goal if last is None else last
    return near + math.remainder(state.position - near, move.turn)


def _stalled(node: Node, place: float, move: Move, why: Blocked) -> Stalled:
    alarm = f"; alarms: {'; '.join(why.alarms)}" if why.alarms else ""
    return Stalled(
        f"node {node.node} stands at {place:.4g} rad, {abs(place - move.goal):.4g} rad off its "
        f"goal {move.goal:.4g} rad{alarm}",
        expected=f"within {move.tolerance:.4g} rad",
        cause="; ".join(why.settings)
        or "something blocks it, the load is too heavy, or its torque limit is low",
        advice="clear the way, or give a wider tolerance; it still pushes towards its goal: stop() ends that",
        node=node.node,
    )


def _late(node: Node, place: float, move: Move, allowance: float) -> MotionError:
    return MotionError(
        f"node {node.node} is not in position after {allowance:.3g} s: it is at {place:.4g} rad on its "
        f"way to {move.goal:.4g} rad",
        expected=f"within {move.tolerance:.4g} rad and at rest",
        cause="the velocity is low for this way, or it swings about its goal",
        advice="give a longer timeout; it is still under way: stop() ends that",
        node=node.node,
    )
