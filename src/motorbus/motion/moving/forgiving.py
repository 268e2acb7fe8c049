"""What may be lost on the wire while axes are led: the next cycle brings another one soon.

A reading that is missing, or an acknowledgement, does no harm by itself. Whoever leads counts them, and gives up when
nothing is heard for too long.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from motorbus.core.request import Request
from motorbus.core.steps import catch, gather
from motorbus.errors import MotorbusError, NoReply, OutcomeUnknown, WireError

LOST: Final = (NoReply, WireError, OutcomeUnknown)
"""The errors of an exchange that may be forgotten."""


async def forgiven(requests: Iterable[Request[Any]]) -> list[Any]:
    """What came of each; one that was lost is an error among the values, the first error of another kind is raised."""
    told = await gather(*[catch(one) for one in requests])
    for one in told:
        if isinstance(one, MotorbusError) and not isinstance(one, LOST):
            raise one
    return list(told)
