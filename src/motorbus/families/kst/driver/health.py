"""How a servo fares: its current and temperature in one exchange, where its make tells them, and whether it restarted.

There is no torque switch to look at and no voltage to read. That a servo starts anew it can only say itself: a node of
CiA 301 does, by a heartbeat of state 0, and a bus that keeps a memory has counted these. The manual does not mention
them, so of a servo that says nothing nobody can know; and then a restart shows as silence, or as a servo that does not
follow.
"""

from __future__ import annotations

from motorbus.core.family import Health, State
from motorbus.core.request import Request
from motorbus.core.steps import Runnable
from motorbus.families.kst import table
from motorbus.families.kst.driver.exchanges import ready, upload_row
from motorbus.families.kst.driver.node import Node


def health(node: Node) -> Runnable[Health]:
    """Current (A) and temperature (°C); by a profile without a status object the position (rad). Alarms heard lately.

    `restarts` counts the boot notices that this bus has heard of the node; None on a bus that keeps no memory.
    """
    if node.dialect.undecided(node.node):
        return ready(node, _asked)
    return _asked(node)


def _asked(node: Node) -> Request[Health]:
    row = node.profile.status_row
    return upload_row(
        node,
        node.table["present_position"] if row is None else row,
        lambda raw: _health(node, raw),
        reports_position=row is None,
    )


def _health(node: Node, raw: int) -> Health:
    profile, memory = node.profile, node.dialect.memory
    restarts = None if memory is None else memory.boots[node.node]
    if profile.status_row is None:
        here = float(node.table["present_position"].to_value(raw))
        return Health(State(at=node.at, position=here, alarm=node.alarm), restarts=restarts)
    state = State(
        at=node.at,
        current=table.current(profile, raw),
        temperature=float(table.temperature(profile, raw)),
        alarm=node.alarm,
    )
    return Health(state, restarts=restarts)
