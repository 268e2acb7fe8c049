"""What motorbus makes of a case: the receivers of `wire` and the rules of the bus, without a link and without a clock.

One try is judged, so what the bus would do next (wait for quiet, probe, ask again) is left out, as it is for others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

from motorbus.bus import verdict
from motorbus.bus.ticket import Flight
from motorbus.bus.turns import Turns
from motorbus.core.operation import Alone, Answer, CanFrame, Data, Due, Exchange
from motorbus.errors import DeviceError, MotorbusError
from motorbus.families.feetech import FAMILY as FEETECH
from motorbus.families.feetech import wire
from motorbus.families.kst import FAMILY as KST
from motorbus.families.kst.driver.exchanges import download, whole
from motorbus.families.kst.driver.node import Node
from tests.interop.differential.cases import Case, Outcome, SdoCase

SOON: Final = 0.001  # s after the request


def decoded(case: Case) -> Outcome:
    """A FEETECH stream. The value is shaped as the lines of `sdk_decoder.py` are."""
    request = case.request
    turns = Turns(FEETECH, rate=1_000_000)
    turns.echo.excluded()
    exchange: Exchange[Answer] = Exchange(
        request.packet(), tuple(Due(node, node, length) for node, length in request.due())
    )
    flight = _flown(turns, exchange, [case.stream])
    if not flight.done or flight.error is not None:
        return Outcome(None, verdict.fault(flight))
    replies = [wire.decode_status(reply.data) for reply in flight.value.replies]
    if request.kind == "sync_read":
        found = {str(reply.id): list(reply.parameters) for reply in replies}
        return Outcome(found) if found else Outcome(None, verdict.fault(flight))
    (reply,) = replies
    return Outcome([list(reply.parameters), reply.error] if request.kind == "read" else reply.error)


def _flown(turns: Turns, exchange: Exchange[Any], stream: Sequence[Data]) -> Flight:
    """One try of it, with all of this in answer, and then silence."""
    flight = Flight(exchange)
    if turns.short(flight, 0.0) is not None:
        turns.feed(list(stream), SOON)
        turns.expire(flight.deadline)
    return flight


class Failed(Exception):
    """A try had no answer."""


def sdo_decoded(case: SdoCase) -> Outcome:
    """A transfer, as the driver carries it out. The value is the data in hexadecimal."""
    request, node = case.request, Node(case.request.node)
    turns, steps = Turns(KST.configured(), rate=500_000), iter(case.steps)
    row = replace(node.table["present_position"], address=request.index, subindex=request.subindex)
    try:
        if request.kind == "upload":
            return Outcome(_run(whole(node, row), turns, steps).hex())
        _run(iter(download(node, row, request.data, states_length=True)), turns, steps)
    except Failed as failed:
        return Outcome(None, str(failed))
    except DeviceError as refusal:
        return Outcome(None, f"abort {refusal.code:08X}")
    except MotorbusError as error:
        return Outcome(None, type(error).__name__)
    return Outcome("")


def _run(steps: Any, turns: Turns, frames: Iterator[Sequence[tuple[int, bytes]]]) -> Any:
    """Carry out an operation, each request answered by what is due next. One that is said again has the same answer."""
    given: Any = None
    said: object = None
    come: Sequence[tuple[int, bytes]] = ()
    operation = iter(steps)
    while True:
        try:
            step = operation.send(given)
        except StopIteration as end:
            return end.value
        if isinstance(step, Alone):
            given = _run(step.operation, turns, _again(come, frames))
            continue
        assert isinstance(step, Exchange)
        if step.request != said:
            said, come = step.request, next(frames, ())
        flight = _flown(turns, step, [CanFrame(identifier, data) for identifier, data in come])
        if not flight.done or flight.error is not None:
            raise Failed(verdict.fault(flight))
        given = flight.value if step.read is None else step.read(flight.value)


def _again(
    first: Sequence[tuple[int, bytes]], frames: Iterator[Sequence[tuple[int, bytes]]]
) -> Iterator[Sequence[tuple[int, bytes]]]:
    """The answer to the request that is said once more, and then the rest."""
    yield first
    yield from frames
