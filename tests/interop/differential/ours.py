"""How motorbus decodes a case: the receiver of the family and the rules of the bus, without a link and without a clock.

Only the first try is judged: other libraries do not wait for quiet, probe or retry either.
"""

from __future__ import annotations

from motorbus.core.request import Expected, Request, Response
from motorbus.families.feetech import FAMILY as FEETECH
from motorbus.families.feetech import protocol
from tests.interop.differential.cases import Case, Outcome
from tests.support.world import Tries


def decoded(case: Case) -> Outcome:
    """A FEETECH stream. The value is shaped as the lines of `sdk_decoder.py` are."""
    request = case.request
    exchange: Request[Response] = Request(
        request.packet(), tuple(Expected(node, node, length) for node, length in request.due())
    )
    answer, fault = Tries(FEETECH, 1_000_000).answered(exchange, [case.stream])
    if answer is None:
        return Outcome(None, fault)
    replies = [protocol.decode(reply.data) for reply in answer.replies]
    if request.kind == "sync_read":
        found = {str(reply.id): list(reply.parameters) for reply in replies}
        return Outcome(found) if found else Outcome(None, fault)
    (reply,) = replies
    return Outcome([list(reply.parameters), reply.code] if request.kind == "read" else reply.code)
