"""The rounds of an emergency stop: stop frames are sent until every node has acknowledged, at most five times."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

from motorbus.bus.engine import Engine
from motorbus.bus.nodes import GATED
from motorbus.bus.stop_socket import StopOutcome
from motorbus.core.request import ANY, Request, Response
from motorbus.core.steps import Sleep, catch, gather
from motorbus.errors import DeviceError, LinkLost, MotorbusError

ROUNDS: Final = 5
SHORTEST_ROUND: Final = 0.05
"""s of a round in which an acknowledgement is missing: a port that was full may have room after it."""


async def stop_in_rounds(engine: Engine, now: Callable[[], float]) -> StopOutcome:
    """Stop all known nodes. The engine is latched."""
    nodes = engine.nodes
    nodes.forget_stop_replies()
    before = {node: nodes.accepted_count(node) for node in nodes.known}
    stop = nodes.stop_requests(now())
    frames: Sequence[Request[Any]] = stop.requests
    acknowledged: list[int] = []
    rounds = 0
    while frames and rounds < ROUNDS and not engine.listening:
        if acknowledged and not any(one.expected for one in frames):
            break
        rounds += 1
        begun = now()
        found = await gather(*[catch(_stop_by(engine, one, now)) for one in frames])
        errors = [error for error in found if isinstance(error, MotorbusError)]
        acknowledged = sorted(
            node for node in nodes.known if nodes.accepted_count(node) > before.get(node, 0)
        )
        missing = sorted(nodes.known.difference(acknowledged))
        if acknowledged and not missing:
            break
        if not all(isinstance(error, LinkLost | DeviceError) for error in errors):
            await catch(Sleep(begun + SHORTEST_ROUND - now()))
        frames = [
            one
            for one in _frames_for(engine, missing, now(), frames)
            if not one.expected or not set(nodes_of(one)) <= set(acknowledged)
        ]
    silent = tuple(sorted(nodes.known.difference(acknowledged)))
    promise = "nothing: the bus only listens" if engine.listening else stop.promise
    return StopOutcome(tuple(acknowledged), silent, rounds, promise)


async def _stop_by(engine: Engine, request: Request[Response], now: Callable[[], float]) -> Any:
    """Send this request of a stop. If it reads a position, hold the node there."""
    try:
        await request
    except MotorbusError:
        raise
    except Exception as error:  # of the driver: the other nodes are stopped all the same
        raise MotorbusError(f"a request of the stop failed: {error}") from error
    if request.effect not in GATED and (read := nodes_of(request)):
        frames = _frames_for(engine, read, now(), ())
        await gather(*[one for one in frames if one.effect in GATED and nodes_of(one)])


def _frames_for(
    engine: Engine, nodes: Iterable[int], now: float, before: Sequence[Request[Response]]
) -> Sequence[Request[Response]]:
    """The requests that stop these nodes as things are now."""
    fresh = engine.nodes.fresh(now)
    try:
        return engine.driver.stop({node: fresh.get(node) for node in nodes}).requests
    except Exception:  # the stop must go out
        return before


def nodes_of(request: Request[Any]) -> tuple[int, ...]:
    """The nodes that answer this request."""
    return () if request.expected is ANY else tuple(due.node for due in request.expected)
