"""What events of operations on these servos say to people; `motorbus.cli.faces` says what that is for."""

from __future__ import annotations

from motorbus.families.feetech import driver


def say(event: object) -> str:
    """What an event of a scan, a change or a move says, in words; "" for one that says nothing to people."""
    if isinstance(event, driver.Powerless):
        return str(event)
    if isinstance(event, driver.Suspicion):
        return (
            f"#{event.node} at {event.rate} bit/s: two servos seem to have this id ({event.evidence}); "
            "connect them one at a time"
        )
    if isinstance(event, driver.Skipped):
        return f"nothing was asked at {event.rate} bit/s: {event.why}"
    return ""
