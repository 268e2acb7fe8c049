"""When is a move over? In position, stalled, or out of time; judged by positions and by the link's clock alone.

These servos have no flag that says whether they move, and no speed that anybody could set or read.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from motorbus.core.steps import Sleep
from motorbus.errors import MotionError, Stalled
from motorbus.families.kst.driver.exchanges import decided, upload_row
from motorbus.families.kst.driver.node import Node

POLL: Final = 0.02
"""s between two looks; at 500 kbit/s one servo that is waited for takes 2.5 % of the bus."""
PATIENCE: Final = 0.5
"""s without progress after which a servo counts as stalled."""
PROGRESS: Final = 0.003
"""rad; less than two counts of 0.1 degree. Less than this is noise."""
UNHURRIED: Final = 1.0
"""rad/s that every servo surely reaches; the time allowed for a move is reckoned with it."""


class Move(NamedTuple):
    """A move that was ordered: goal and tolerance in rad, timeout in s (None: from the way)."""

    goal: float
    tolerance: float
    timeout: float | None

    def allowance(self, way: float) -> float:
        """Seconds after which it should long have gone this way (rad)."""
        return self.timeout if self.timeout is not None else 1.0 + 2.0 * way / UNHURRIED


async def arrive(node: Node, move: Move) -> None:
    """Poll until the move is over. Raises Stalled, or MotionError when the time is up."""
    await decided(node)
    row = node.table["present_position"]
    look = upload_row(node, row, lambda raw: float(row.to_value(raw)), reports_position=True)
    here = mark = await look
    begun = progressed = node.at
    allowance = move.allowance(abs(here - move.goal))
    looks = _near(here, move)
    while looks < 2:
        if abs(here - mark) >= PROGRESS:
            mark, progressed = here, node.at
        elif node.at - progressed > PATIENCE and not looks:
            raise _stalled(node, here, move)
        if node.at - begun > allowance:
            raise _late(node, here, move, allowance)
        await Sleep(POLL)
        here = await look
        looks = looks + 1 if _near(here, move) else 0


def _near(here: float, move: Move) -> int:
    return int(abs(here - move.goal) <= move.tolerance)


def _stalled(node: Node, here: float, move: Move) -> Stalled:
    alarm = f"; alarms: {', '.join(node.alarm)}" if node.alarm else ""
    return Stalled(
        f"node {node.node} stands at {here:.4g} rad, {abs(here - move.goal):.4g} rad off its goal "
        f"{move.goal:.4g} rad{alarm}",
        expected=f"within {move.tolerance:.4g} rad",
        cause="something blocks it, the load is too heavy, its supply is weak, or its make must be started first",
        advice="clear the way, or give a wider tolerance; it still pushes towards its goal: stop() ends that. A servo "
        "that never moves may be of another make: profile=xqpower or nmt=standard starts it",
        node=node.node,
    )


def _late(node: Node, here: float, move: Move, allowance: float) -> MotionError:
    return MotionError(
        f"node {node.node} is not in position after {allowance:.3g} s: it is at {here:.4g} rad on its way to "
        f"{move.goal:.4g} rad",
        expected=f"within {move.tolerance:.4g} rad",
        cause="it is slow for this way, or it swings about its goal",
        advice="give a longer timeout; it is still under way: stop() ends that",
        node=node.node,
    )
