"""What is done for one request: resynchronise its nodes, send it, try again or fail."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, Protocol

from motorbus.bus import failures
from motorbus.bus.jobs import Attempt, Policy, Wait
from motorbus.bus.statistics import Statistics
from motorbus.bus.sync import SyncTable
from motorbus.core.request import ANY, Priority, Request, TimeoutClass
from motorbus.errors import MotorbusError

RETRIES = 2
"""Attempts of a repeatable request after the first."""


class Context(Protocol):
    """What a policy sees of the engine."""

    sync: SyncTable
    statistics: Statistics
    time: float
    stopping: bool
    latched_by: str
    diagnosis: Callable[[], str]

    @property
    def quiet_time(self) -> float: ...

    def alternate(self, request: Request[Any], /) -> Request[Any]: ...


def carry_out(engine: Context, request: Request[Any]) -> Policy:
    """The reply to this request. Raises MotorbusError when the last attempt fails."""
    tries, sent, fault = 0, False, ""
    while True:
        excluded: tuple[int, ...] = ()
        if request.priority is not Priority.STOP and (
            request.reply_within is not TimeoutClass.SCAN or fault == "echo"
        ):
            for node in engine.sync.doubtful(request):
                failed, probes = yield from _resync(engine, request, node)
                tries += probes
                if failed is None:
                    continue
                if len(request.expected) == 1:  # type: ignore[arg-type]  # never ANY here
                    raise _error(engine, request, failed, tries, sent)
                excluded += (node,)
        attempt: Attempt | None = yield Attempt(
            engine.alternate(request), excluded=excluded, after_echo=fault == "echo"
        )
        if attempt is None:  # a node has come out of sync before this could be sent
            continue
        sent = True
        fault = attempt.fault
        if attempt.accepted is not None:
            return attempt.accepted
        if engine.stopping and request.priority is not Priority.STOP:
            raise failures.latched(engine.latched_by)
        tries += 1
        if not _may_repeat(request, fault) or tries > RETRIES:
            raise _error(engine, request, attempt, tries, sent)
        engine.statistics.retried(request.expected)


def _may_repeat(request: Request[Any], fault: str) -> bool:
    """A scan is not repeated, for silence is its usual answer; nor is a stop, which has rounds of its own."""
    patient = request.reply_within is not TimeoutClass.SCAN or fault == "echo"
    return (
        request.repeatable
        and request.priority is not Priority.STOP
        and request.expected is not ANY
        and patient
    )


def _resync(
    engine: Context, request: Request[Any], node: int
) -> Generator[Attempt | Wait, Attempt | None, tuple[Attempt | None, int]]:
    """Wait for the quiet time and probe this node; the probe that failed, None when the node is in sync, and how many.

    A group does not wait for a node that was silent lately.
    """
    state, group = engine.sync.of(node), len(request.expected) > 1  # type: ignore[arg-type]
    if group and state.silences and engine.time < state.probe_at:
        return Attempt(request), 0
    for tries in range(1, RETRIES + 2):
        while engine.time < state.quiet_until:  # another request may have moved it meanwhile
            yield Wait(state.quiet_until)
        if node not in engine.sync.out_of_sync:  # another request has probed it meanwhile
            return None, tries - 1
        attempt = yield Attempt(engine.sync.next_probe(node), is_probe=True)
        assert attempt is not None
        if not attempt.fault:
            return None, 0
        if attempt.fault == "silence":
            break
    engine.sync.back_off(node, engine.time, engine.quiet_time)
    return attempt, tries


def _error(engine: Context, request: Request[Any], attempt: Attempt, tries: int, sent: bool) -> MotorbusError:
    return failures.no_answer(
        request, attempt.failure(), attempt.received(), tries=tries, sent=sent, diagnosis=engine.diagnosis()
    )
