"""Hearing what goes on at a bit rate before anything is said there.

A node that speaks at a wrong rate destroys the traffic of everybody else, so a bus whose rate is not known is
listened to first, by an adapter that does not even acknowledge. A frame that comes whole proves the rate; errors
disprove it; silence proves nothing. Some adapters (slcan) report no errors, so with them a wrong rate is silence.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

from motorbus.core.request import Notification
from motorbus.core.steps import SetBitrate, WaitFor, gather
from motorbus.families.kst.driver.dialect import Dialect

GLANCE: Final = 0.25
"""s to listen where the caller has named the rate; two periods of traffic at 10 Hz."""


class Heard(Enum):
    """What was heard at one rate."""

    TRAFFIC = "frames came whole: this is the rate of the bus"
    ERRORS = "errors only: the bus is in use at another rate"
    SILENCE = "silence: nobody spoke, or this adapter reports no errors"


async def heard(dialect: Dialect, rate: int, seconds: float) -> Heard:
    """Listen at this rate without sending anything. Raises LinkError when the adapter cannot.

    The link stays at that rate, listening, for the caller to tune again whatever happens.
    """
    await SetBitrate(rate, listen_only=True)
    memory = dialect.memory
    before = (memory.frames, memory.errors) if memory else (0, 0)
    whole, broken = await gather(WaitFor(_is_frame, seconds), WaitFor(_is_error, seconds))
    after = (memory.frames, memory.errors) if memory else (0, 0)
    if whole is not None or after[0] > before[0]:
        return Heard.TRAFFIC
    return Heard.ERRORS if broken is not None or after[1] > before[1] else Heard.SILENCE


def _is_frame(notice: Notification) -> bool:
    return not _is_error(notice)


def _is_error(notice: Notification) -> bool:
    return notice.kind == "bus error"
