"""What a blocking and an async bus have in common: their parts, their watchers, their emergency stop."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from threading import Condition
from typing import Any

from motorbus.bus.look import questions
from motorbus.bus.statistics import Statistics
from motorbus.bus.stop import Stopper
from motorbus.bus.stop_socket import StopOutcome, asked_by
from motorbus.bus.trace import Feed, TraceRecord
from motorbus.bus.turns import GATED, Admit, Turns
from motorbus.core.family import Family, Readdressed
from motorbus.core.operation import Answer, Exchange, Journal, Notice, Runnable
from motorbus.errors import RequestError
from motorbus.link.base import Link, Renewable

Notify = Callable[[object], None]


class BusFace:
    """An open bus: one link, one family, one set of turns.

    `interlock` is asked before anything that moves a motor or switches torque is sent; without it such exchanges are
    refused. `report` gets the events of operations (progress, early results, journal records). `journal` gets the
    journal records before anybody else, whoever listens. `stop_socket` is where another process can ask for an
    emergency stop. `warnings` are what the user ought to know about this bus. `readdressed`, where somebody has set it,
    hears before anybody else that a device is about to answer to another id. Where it `sleeps`, who asks the same
    again and again is not woken before the whole of the answer can be there.
    """

    def __init__(
        self,
        link: Link,
        family: Family,
        *,
        interlock: Admit | None = None,
        report: Notify | None = None,
        journal: Notify | None = None,
        stop_socket: Path | None = None,
    ) -> None:
        self.link = link
        self.family = family
        self.interlock = interlock
        self.report = report
        self.journal = journal
        self.readdressed: Callable[[Readdressed], None] | None = None
        self.warnings: tuple[str, ...] = tuple(link.warnings)
        self.turns = Turns(
            family,
            rate=link.rate,
            latency=link.latency,
            paced=link.paced or (None if family.link.kind == "frames" and _takes_time(link) else False),
            listen_only=bool(getattr(link, "listen_only", False)),
            admit=self._armed(interlock) if interlock is not None else None,
        )
        self.turns.trouble = getattr(link, "trouble", str)
        self.turns.renewal = link if isinstance(link, Renewable) else None
        self.sleeps = bool(getattr(link, "sleeps", False)) and not link.virtual
        self.changed = Condition(self.turns.lock)
        self.stopper = Stopper(link, self.turns, stop_socket)
        if stop_socket is not None:
            self.stopper.start()

    def _armed(self, admit: Admit) -> Admit:
        def admitted(exchange: Exchange[Any]) -> None:
            admit(exchange)
            if exchange.effect in GATED:
                self.stopper.start()
                self.turns.admit = admit  # it is ready now, and stays so
                self.turns.passes = getattr(admit, "passes", None)
                self.turns.lets_move = getattr(admit, "lets_move", None)

        return admitted

    def _hang_up(self) -> None:
        """End the stop thread, then give the port back; nobody looks for it any more."""
        self.stopper.close()
        self.turns.renewal = None
        self.link.close()

    def listener(self, report: Notify | None) -> Notify | None:
        """Who hears the events of an operation: `report`, or the bus's own listener; and the journal before them."""
        told, journal, readdressed = report or self.report, self.journal, self.readdressed
        if journal is None and readdressed is None:
            return told

        def tell(event: object) -> None:
            if readdressed is not None and isinstance(event, Readdressed):
                readdressed(event)
            if journal is not None and isinstance(event, Journal):
                journal(event)
            if told is not None:
                told(event)

        return tell

    @property
    def statistics(self) -> Statistics:
        """Counts and latencies per node."""
        return self.turns.statistics

    @property
    def trace(self) -> Feed[TraceRecord]:
        """Subscribe to every request and delivery."""
        return self.turns.trace

    @property
    def notices(self) -> Feed[Notice]:
        """Subscribe to what devices say on their own account."""
        return self.turns.notices

    @property
    def simulated(self) -> bool:
        """There is no real device behind this bus."""
        return self.link.simulated

    @property
    def rate(self) -> int:
        """Present bit rate (bit/s)."""
        return self.turns.rate

    @property
    def latency(self) -> float:
        """Time (s) that the adapter may hold data back; added to each reply deadline."""
        return self.turns.latency

    @latency.setter
    def latency(self, seconds: float) -> None:
        self.turns.latency = seconds

    @property
    def latched(self) -> bool:
        """An emergency stop is latched: motion and torque are refused until `reset`."""
        return self.turns.latched

    @property
    def lock(self) -> AbstractContextManager[object]:
        """Held while the state of this bus is read or changed as a whole. Keep it for microseconds only."""
        return self.turns.lock

    @property
    def positions(self) -> Mapping[int, tuple[Exchange[Any], Answer]]:
        """The last request that read a position and its reply, by node."""
        return self.turns.known.seen

    def stop_count(self, node: int | None = None) -> int:
        """Number of stops sent to this node, those for all nodes included; None: of all stops sent on this bus."""
        known = self.turns.known
        return known.stopping if node is None else known.stops(node)

    @property
    def loss_count(self) -> int:
        """Number of times the port was lost."""
        return self.turns.losses

    @property
    def reconnects(self) -> bool:
        """A lost port is reopened on the next call. Can be set to False only."""
        return self.turns.renewal is not None

    @reconnects.setter
    def reconnects(self, wanted: bool) -> None:
        if wanted:
            raise RequestError("a bus cannot begin to reconnect", advice="open it with reconnect=yes")
        self.turns.renewal = None

    def on_reconnect(self, function: Callable[[], None]) -> None:
        """Call this function, with `lock` held, each time the lost port has been reopened."""
        self.turns.anew += (function,)

    def required_reads(self, exchange: Exchange[Any]) -> Sequence[Runnable[Any]]:
        """The reads that the gate needs before it can check this request."""
        return questions(self.turns, exchange)

    def attach(self, gate: Any) -> None:
        """Let the gate see positions and stops of this bus, and ask it which reads a request requires first."""
        known = self.turns.known
        gate.watch(known.seen, self.link.now, known.stops, known.accepts, self.turns.tell)
        self.turns.look = gate.look
        self.on_reconnect(gate.forget)

    def expect_echo(self, test: Exchange[Any]) -> None:
        """Let the next reply to this request show whether the adapter echoes."""
        self.turns.expect_echo(test)

    @property
    def echoes(self) -> bool:
        """The adapter echoes what is sent."""
        return bool(self.turns.echo.present)

    def move_stop_socket(self, path: Path | None) -> None:
        """Accept emergency stops of other processes at this socket from now on."""
        self.stopper.move(path)

    def estop(self) -> StopOutcome:
        """Emergency stop: drop the queue, send the stop frames until acknowledged or five times, and latch.

        Afterwards motion and torque are refused with Interrupted until `reset()`. May be called from any thread,
        but not from a signal handler (see `trigger_estop`). Raises LinkLost when the bus is closed.
        """
        return self.stopper.estop()

    def trigger_estop(self) -> None:
        """Ask the stop thread for an emergency stop and return at once; made for signal handlers.

        Does nothing before the thread is there: on a simulated bus that is the first motion or torque command.
        """
        self.stopper.trigger()

    def latch(self) -> None:
        """Refuse motion and torque until `reset`, as an emergency stop that was given elsewhere; sends nothing."""
        with self.turns.lock:
            self.turns.latch(self.link.now(), asked_by())
            self.turns.stopped()

    def reset(self) -> None:
        """Take the latch of an emergency stop off. Nothing is sent and nothing moves."""
        with self.turns.lock:
            self.turns.reset()


def _takes_time(link: Link) -> bool:
    """Frames may need their time here; whether they do will show."""
    return not link.simulated and not getattr(link, "timeless", False)


if os.environ.get("MOTORBUS_ENGINE") == "new":  # until every part runs on it
    from motorbus.bus import base

    BusFace = base.BaseBus  # type: ignore[assignment, misc]
