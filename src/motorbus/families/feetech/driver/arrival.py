"""When is a move over? In position, stalled, or out of time; judged by samples and by the link's clock alone.

The moving flag of these servos says only half: it also drops when the servo stands off its goal. So arrival needs
both a position within tolerance and standstill, and a stall is a position that no longer changes.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.entry import Table
from motorbus.core.family import State
from motorbus.core.operation import Operation, Pause
from motorbus.errors import MotionError, Stalled
from motorbus.families.feetech.driver.feedback import state_exchange
from motorbus.families.feetech.driver.node import Node

POLL: Final = 0.02
"""s between two looks; leaves a bus at 1 Mbaud to others for nine tenths of the time and more."""
PATIENCE: Final = 0.5
"""s without progress after which a servo counts as stalled."""
PROGRESS: Final = 0.003
"""rad; a little less than two counts. Less than this is noise."""
UNHURRIED: Final = 2.0
"""rad/s that every servo surely reaches; the time allowed for a move is reckoned with it."""


class Move(NamedTuple):
    """A move that was ordered: goal in rad, bounds (None: the servo's own), tolerance in rad, timeout in s."""

    goal: float
    velocity: float | None
    acceleration: float | None
    tolerance: float
    timeout: float | None

    @property
    def patience(self) -> float:
        """A slow move takes its time for two counts."""
        return PATIENCE + 2 * PROGRESS / (self.velocity or UNHURRIED)

    def allowance(self, way: float) -> float:
        """Seconds after which it should long have gone this way (rad)."""
        if self.timeout is not None:
            return self.timeout
        speed = min(self.velocity or UNHURRIED, UNHURRIED)
        ramps = speed / self.acceleration if self.acceleration else 0.0
        return 1.0 + 2.0 * (way / speed + ramps)


def arrive(node: Node, table: Table, move: Move) -> Operation[None]:
    """Poll until the move is over. Raises Stalled, or MotionError when the time is up."""
    look = state_exchange(node, table)
    state = yield from look
    begun = progressed = state.at
    mark = _place(state)
    allowance = move.allowance(abs(mark - move.goal))
    while not _in_position(state, move):
        if abs(_place(state) - mark) >= PROGRESS:
            mark, progressed = _place(state), state.at
        elif state.at - progressed > move.patience:
            raise _stalled(node, state, move)
        if state.at - begun > allowance:
            raise _late(node, state, move, allowance)
        yield from Pause(POLL)
        state = yield from look


def _place(state: State) -> float:
    assert state.position is not None
    return state.position


def _in_position(state: State, move: Move) -> bool:
    return abs(_place(state) - move.goal) <= move.tolerance and not state.moving


def _stalled(node: Node, state: State, move: Move) -> Stalled:
    alarm = f"; alarms: {', '.join(state.alarm)}" if state.alarm else ""
    return Stalled(
        f"node {node.node} stands at {_place(state):.4g} rad, {abs(_place(state) - move.goal):.4g} rad off its "
        f"goal {move.goal:.4g} rad{alarm}",
        expected=f"within {move.tolerance:.4g} rad",
        cause="something blocks it, the load is too heavy, its torque limit is low, or its torque is off",
        advice="clear the way, or give a wider tolerance; it still pushes towards its goal: stop() ends that",
        node=node.node,
    )


def _late(node: Node, state: State, move: Move, allowance: float) -> MotionError:
    return MotionError(
        f"node {node.node} is not in position after {allowance:.3g} s: it is at {_place(state):.4g} rad on its "
        f"way to {move.goal:.4g} rad",
        expected=f"within {move.tolerance:.4g} rad and at rest",
        cause="the velocity is low for this way, or it swings about its goal",
        advice="give a longer timeout; it is still under way: stop() ends that",
        node=node.node,
    )
