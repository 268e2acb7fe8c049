"""The rounds of an emergency stop: stop frames are sent until every node has acknowledged, at most five times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, Protocol

from motorbus.bus.engine import MARGIN, Engine
from motorbus.bus.jobs import RateJob, RequestJob
from motorbus.bus.positions import GATED
from motorbus.bus.stop_socket import StopOutcome
from motorbus.core.operation import ANY, Answer, Due, Exchange, Timeout, Tune
from motorbus.errors import DeviceError, LinkLost

ROUNDS: Final = 5
ROUND_TIME: Final = 0.25
"""s for all frames of one round, beyond the time that they need."""
SHORTEST_ROUND: Final = 0.05
"""s of a round in which an acknowledgement is missing."""


class Wire(Protocol):
    """What the rounds need of a bus; the caller holds its turn."""

    engine: Engine

    def now(self) -> float: ...
    def send(self) -> None: ...
    def receive(self, until: float) -> None: ...


def run_rounds(wire: Wire) -> StopOutcome:
    """Send the stop frames of the family in rounds. The engine is latched."""
    engine = wire.engine
    positions = engine.positions
    _restore_rate(wire)
    stop = positions.frames(wire.now())
    acknowledged: list[int] = []
    frames: Sequence[Exchange[Answer]] = stop.exchanges
    rounds = 0
    while frames and rounds < ROUNDS and not engine.listening:
        if acknowledged and not any(one.replies for one in frames):
            break
        rounds += 1
        _run_round(wire, frames, acknowledged)
        missing = sorted(positions.nodes - set(acknowledged))
        if acknowledged and not missing:
            break
        frames = [
            one
            for one in _frames_for(wire, missing, frames)
            if not one.replies or not set(_nodes(one)) <= set(acknowledged)
        ]
    engine.stopped()
    silent = tuple(sorted(positions.nodes - set(acknowledged)))
    promise = "nothing: the bus only listens" if engine.listening else stop.promise
    return StopOutcome(tuple(acknowledged), silent, rounds, promise)


def _restore_rate(wire: Wire) -> None:
    """A scan may be trying another rate: the nodes are stopped at the rate at which they answered last."""
    engine = wire.engine
    there = engine.rate, engine.listening
    if there != (engine.positions.rate, engine.always_listening):
        engine.submit(RateJob(Tune(engine.positions.rate), urgent=True), wire.now())
        wire.send()


def _frames_for(
    wire: Wire, nodes: Sequence[int], before: Sequence[Exchange[Answer]]
) -> Sequence[Exchange[Answer]]:
    """The requests that stop these nodes as things are now."""
    engine = wire.engine
    fresh = engine.positions.fresh(wire.now())
    try:
        return engine.family.stop({node: fresh.get(node) for node in nodes}).exchanges
    except Exception:  # the stop must go out
        return before


def _run_round(wire: Wire, frames: Iterable[Exchange[Answer]], acknowledged: list[int]) -> None:
    """Send each request once, and those that become possible when a node has reported its position."""
    engine, begun = wire.engine, wire.now()
    jobs: list[RequestJob] = []
    limit = _submit(wire, frames, jobs, begun + ROUND_TIME)
    asking = [job for job in jobs if job.request.effect not in GATED]
    wire.send()
    while not all(job.done for job in jobs) and wire.now() < limit:
        wire.receive(limit)
        for job in [job for job in asking if job.done]:
            asking.remove(job)
            if job.error is None and (nodes := _nodes(job.request)):
                holds = [one for one in _frames_for(wire, nodes, ()) if one.effect in GATED and _nodes(one)]
                limit = _submit(wire, holds, jobs, limit)
        wire.send()
    failed = []
    for job in jobs:
        engine.cancel(job)
        if job.error is not None:
            failed.append(job)
    for node in _obeyed(jobs, failed):
        if node not in acknowledged:
            acknowledged.append(node)
            engine.positions.accepted(node)
    again = [
        job for job in failed if not isinstance(job.error, LinkLost | DeviceError) and job.request.replies
    ]
    while again and wire.now() < begun + SHORTEST_ROUND:  # a port that was full may have room then
        wire.receive(begun + SHORTEST_ROUND)


def _submit(wire: Wire, frames: Iterable[Exchange[Answer]], jobs: list[RequestJob], limit: float) -> float:
    """Queue these; the limit of the round, later by the time that they need."""
    engine = wire.engine
    for request in frames:
        jobs.append(RequestJob(request))
        engine.submit(jobs[-1], wire.now())
        limit += engine.air_time(request) + engine.family.turnaround(request) + engine.latency
        limit += MARGIN[Timeout.SCAN]
    return limit


def _nodes(request: Exchange[Answer]) -> list[int]:
    """The nodes that acknowledge this request."""
    return [] if request.replies is ANY else [due.node for due in request.replies]


def _obeyed(jobs: Iterable[RequestJob], failed: Sequence[RequestJob]) -> list[int]:
    """The nodes that gave every reply which stopping them calls for; a request that only asks stops no node."""
    wanted: dict[int, set[Due]] = {}
    given: set[Due] = set()
    for job in jobs:
        dues = job.request.replies
        if job.request.effect not in GATED or dues is ANY:
            continue
        given |= set(dues) if job not in failed else set()
        for due in dues:
            wanted.setdefault(due.node, set()).add(due)
    return [node for node, dues in wanted.items() if dues <= given]
