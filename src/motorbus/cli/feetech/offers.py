"""What events of operations on these servos say to people; `motorbus.cli.faces` says what that is for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motorbus.families.feetech import driver

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motorbus.core.register import Value


def say(event: object) -> str:
    """What an event of a scan, a change or a move says, in words; "" for one that says nothing to people."""
    if isinstance(event, driver.Powerless | driver.TorqueAfterWrite):
        return str(event)
    if isinstance(event, driver.ScanWarning):
        return (
            f"#{event.node} at {event.rate} bit/s: two servos seem to have this id ({event.evidence}); "
            "connect them one at a time"
        )
    if isinstance(event, driver.Skipped):
        return f"nothing was asked at {event.rate} bit/s: {event.why}"
    return ""


def torque_after_write(one: Any, values: Mapping[str, Value]) -> str:
    """What a write of these registers does to the torque of this servo; "" where it has none, or keeps it."""
    why = one.bus.run(driver.torque_after_write(one, **values))
    if why is None:
        return ""
    if why:
        return f"its torque goes off and stays off ({why})"
    return "its torque goes off meanwhile, then it holds where it is"


def torque_told(event: object) -> dict[str, Any] | None:
    """The torque after a write, where the servo had torque before."""
    if not isinstance(event, driver.TorqueAfterWrite):
        return None
    return {"on": event.on, "why": event.why, "text": str(event)}
