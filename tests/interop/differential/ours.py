"""How motorbus decodes a case: the receivers of `wire` and the rules of the bus, without a link and without a clock.

Only the first try is judged: other libraries do not wait for quiet, probe or retry either.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Coding
from motorbus.core.request import Expected, Request, Response, Step
from motorbus.core.steps import Exclusive
from motorbus.errors import DeviceError, MotorbusError
from motorbus.families.feetech import FAMILY as FEETECH
from motorbus.families.feetech import wire
from motorbus.families.kst import FAMILY as KST
from motorbus.families.kst import BusSettings, Node
from motorbus.families.kst.driver.requests import read_all_bytes, write_register
from tests.interop.differential.cases import Case, Outcome, SdoCase
from tests.support.world import Tries


def decoded(case: Case) -> Outcome:
    """A FEETECH stream. The value is shaped as the lines of `sdk_decoder.py` are."""
    request = case.request
    exchange: Request[Response] = Request(
        request.packet(), tuple(Expected(node, node, length) for node, length in request.due())
    )
    answer, fault = Tries(FEETECH, 1_000_000, echo=False).answered(exchange, [case.stream])
    if answer is None:
        return Outcome(None, fault)
    replies = [wire.decode_status(reply.data) for reply in answer.replies]
    if request.kind == "sync_read":
        found = {str(reply.id): list(reply.parameters) for reply in replies}
        return Outcome(found) if found else Outcome(None, fault)
    (reply,) = replies
    return Outcome([list(reply.parameters), reply.error] if request.kind == "read" else reply.error)


class Failed(Exception):
    """A try had no answer."""


def sdo_decoded(case: SdoCase) -> Outcome:
    """A transfer, as the driver carries it out. The value is the data in hexadecimal."""
    request, node = case.request, Node(case.request.node, BusSettings(sized=True))
    tries, steps = Tries(KST, 500_000), iter(case.steps)
    row = replace(node.table["present_position"], address=request.index, subindex=request.subindex)
    try:
        if request.kind == "upload":
            return Outcome(_run(read_all_bytes(node, row), tries, steps).hex())
        size = len(request.data)
        raw = int.from_bytes(request.data, "little")
        row = replace(row, size=size, low=0, high=(1 << 8 * size) - 1, coding=Coding.UNSIGNED)
        _run(write_register(node, row, raw), tries, steps)
    except Failed as failed:
        return Outcome(None, str(failed))
    except DeviceError as refusal:
        return Outcome(None, f"abort {refusal.code:08X}")
    except MotorbusError as error:
        return Outcome(None, type(error).__name__)
    return Outcome("")


def _run(steps: Any, tries: Tries, frames: Iterator[Sequence[tuple[int, bytes]]]) -> Any:
    """Carry out an operation, each request answered by what is due next. One that is said again has the same answer."""
    given: Any = None
    said: object = None
    come: Sequence[tuple[int, bytes]] = ()
    operation = steps.__await__() if isinstance(steps, Step) else steps
    while True:
        try:
            step = operation.send(given)
        except StopIteration as end:
            return end.value
        if isinstance(step, Exclusive):
            given = _run(step.runnable, tries, _again(come, frames))
            continue
        assert isinstance(step, Request)
        if step.wire != said:
            said, come = step.wire, next(frames, ())
        answer, fault = tries.answered(step, [CanFrame(identifier, data) for identifier, data in come])
        if answer is None:
            raise Failed(fault)
        given = answer if step.decode is None else step.decode(answer)


def _again(
    first: Sequence[tuple[int, bytes]], frames: Iterator[Sequence[tuple[int, bytes]]]
) -> Iterator[Sequence[tuple[int, bytes]]]:
    """The answer to the request that is said once more, and then the rest."""
    yield first
    yield from frames
