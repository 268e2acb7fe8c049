"""What is done for a request in trouble: probes of nodes that owe a reply, and further attempts."""

from __future__ import annotations

from typing import Any, Final

from motorbus.bus import failures
from motorbus.bus.attempt import Attempt
from motorbus.bus.engine import Engine
from motorbus.bus.sync import is_read, must_sync
from motorbus.core.request import ANY, Priority, Request, Response, TimeoutClass
from motorbus.core.steps import Sleep
from motorbus.errors import MotorbusError

RETRIES: Final = 2
"""Attempts of a repeatable request after the first."""


async def carry_out(engine: Engine, request: Request[Any], attempt: Attempt | None = None) -> Response:
    """The reply to this request. `attempt` is a first one that has failed. Raises when the last one fails.

    `Sleep(0)` reads the clock.
    """
    tries, sent = 0, False
    while True:
        if attempt is not None:
            sent = True
            if attempt.accepted is not None:
                return attempt.accepted
            if engine.stopping and not is_read(request) and request.priority is not Priority.STOP:
                raise failures.latched(engine.latched_by)
            tries += 1
            if not _may_repeat(request) or tries > RETRIES:
                raise _error(engine, request, attempt, tries, sent)
            for node in attempt.nodes:
                engine.statistics.of(node).retries += 1
        excluded: tuple[int, ...] = ()
        is_probed = False
        for node in engine.sync.doubtful(request) if must_sync(request) else ():
            if len(request.expected) > 1 and engine.sync.is_put_off(node, await Sleep(0)):  # type: ignore[arg-type]
                excluded += (node,)  # a group does not wait for a node that was silent lately
                continue
            failed, probes = await _resync(engine, node)
            is_probed = is_probed or failed is None
            if failed is None:
                continue
            if len(request.expected) == 1:  # type: ignore[arg-type]  # never ANY here
                raise _error(engine, request, failed, tries + probes, sent)
            excluded += (node,)
        if excluded and len(excluded) == len(request.expected):  # type: ignore[arg-type]
            return Response((), excluded, await Sleep(0))
        step = Attempt(request, excluded=excluded)
        step.is_probed = is_probed
        attempt = await step
        if attempt is None:  # a node came out of sync before it left
            tries += 1
            if tries > RETRIES:
                step.fault = "surplus"  # data that were not expected came before it, each time
                raise _error(engine, request, step, tries, sent)


def _may_repeat(request: Request[Any]) -> bool:
    """A scan is not repeated, for silence is its usual answer; nor is a stop, which has rounds of its own."""
    return (
        request.repeatable
        and request.priority is not Priority.STOP
        and request.expected is not ANY
        and request.reply_within is not TimeoutClass.SCAN
    )


async def _resync(engine: Engine, node: int) -> tuple[Attempt | None, int]:
    """Wait for the quiet time and probe this node: the probe that failed, None when it is in sync, and how many."""
    state, tries = engine.sync.of(node), 0
    for tries in range(1, RETRIES + 2):
        # Another request may have moved the quiet time, or probed the node, while this one slept.
        while (pause := state.quiet_until - await Sleep(0)) > 0:
            await Sleep(pause)
        if node not in engine.sync.out_of_sync:
            return None, tries
        attempt = await Attempt(engine.sync.next_probe(node), is_probe=True)
        assert attempt is not None
        if not attempt.fault:
            return None, tries
        if attempt.fault == "silence":
            break
    engine.sync.back_off(node, await Sleep(0), engine.quiet_time)
    return attempt, tries


def _error(engine: Engine, request: Request[Any], attempt: Attempt, tries: int, sent: bool) -> MotorbusError:
    return failures.no_answer(
        request, attempt.failure(), attempt.received(), tries=tries, sent=sent, diagnosis=engine.diagnosis()
    )
