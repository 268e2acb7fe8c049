"""The emergency stop of one bus: a thread that sleeps until a stop is requested.

It exists from the first motion or torque request on, or from `open` on where other processes can request a stop. It
needs neither the event loop nor the thread that uses the bus: a signal handler or another process wakes it by a
datagram. `estop` does the same work in the calling thread: it latches the engine, waits for the turn at most as long as
a reply is on the wire, writes the stop frames in any case, and then repeats them with the turn until all nodes
acknowledge. Decision record 0015.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import select
import socket
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Lock, Thread, current_thread
from typing import Any, Final
from weakref import ref

from motorbus.bus.engine import Engine
from motorbus.bus.nodes import GATED
from motorbus.bus.stop_socket import LONGEST, STOP_TIMEOUT, StopOutcome, asked_by, client_name, open_socket
from motorbus.bus.tasks import Tree
from motorbus.core.request import ANY, Priority, Request
from motorbus.core.steps import Sleep, catch, gather
from motorbus.errors import LinkError, LinkFull

ROUNDS_TIME: Final = 3.0
"""s for all rounds of a stop, less than `STOP_TIMEOUT`."""
ROUNDS: Final = 5
SHORTEST_ROUND: Final = 0.05
"""s of a round in which an acknowledgement is missing: a port that was full may have room after it."""
STOP, END = b"!", b"."


async def stop_nodes(engine: Engine, now: Callable[[], float]) -> StopOutcome:
    """Stop all known nodes, in at most five rounds: each until it has acknowledged. The engine is latched."""
    nodes = engine.nodes
    acknowledged: set[int] = set()
    rounds, promise = 0, "nothing: the bus only listens"
    while rounds < ROUNDS and not engine.listening:
        begun = now()
        requests, promise = nodes.stop_requests(begun, nodes.known - acknowledged)
        work: dict[int, list[Request[Any]]] = {}
        for one in requests:
            if node_of(one) not in acknowledged:
                work.setdefault(node_of(one), []).append(one)
        if not work:
            break
        rounds += 1
        found = await gather(*[_stop_node(engine, node, work[node], now) for node in work])
        acknowledged.update(node for node, is_stopped in zip(work, found, strict=True) if is_stopped)
        if acknowledged and acknowledged >= nodes.known:
            break
        await catch(Sleep(begun + SHORTEST_ROUND - now()))
    silent = tuple(sorted(nodes.known - acknowledged))
    return StopOutcome(tuple(sorted(acknowledged)), silent, rounds, promise)


async def _stop_node(
    engine: Engine, node: int, requests: Sequence[Request[Any]], now: Callable[[], float]
) -> bool:
    """Send each of these; True if the node has acknowledged. If one reads a position, hold the node there."""
    accepted = []
    for request in requests:
        try:
            await request
        except Exception:  # also of the driver: the rest is sent all the same
            accepted.append(False)
            continue
        if not request.expected:
            continue
        if request.effect in GATED:
            accepted.append(True)
            continue
        holds, _ = engine.nodes.stop_requests(now(), (node,))
        holds = tuple(one for one in holds if one.effect in GATED and node_of(one) == node)
        accepted.append(bool(holds) and await _stop_node(engine, node, holds, now))
    return bool(accepted) and all(accepted)


def node_of(request: Request[Any]) -> int:
    """The node that answers this request, -1 for none."""
    return -1 if request.expected is ANY or not request.expected else request.expected[0].node


class EmergencyStop:
    """The emergency stop of one bus (a `BaseBus`), which it keeps alive only while it stops."""

    def __init__(self, bus: Any, socket_path: Path | None = None) -> None:
        self._bus = ref(bus)
        self.socket_path = socket_path
        self._sockets: tuple[socket.socket, socket.socket] | None = None
        """The one that the thread reads, and one that sends to it."""
        self._starting = Lock()
        self._thread: Thread | None = None
        self._closed = False

    @property
    def bus(self) -> Any:
        """The bus; None when it was dropped, which ends the thread."""
        return self._bus()

    def start(self) -> None:
        """Start the thread, unless it runs or time is virtual.

        Raises LinkError where the system gives no more threads: what moves must be stoppable.
        """
        if self._thread is not None or self.bus.link.virtual:
            return
        with self._starting:
            if self._thread is not None or self._closed:
                return
            self._sockets = self._sockets or open_socket(self.socket_path)
            self._sockets[1].setblocking(False)
            thread = Thread(target=self._serve, args=self._sockets[:1], name="motorbus stop", daemon=True)
            try:
                thread.start()
            except RuntimeError as error:
                raise LinkError(
                    "the system gives no more threads, and what moves needs one that can stop it",
                    advice="end processes that hold many threads; nothing was sent",
                ) from error
            self._thread = thread
            atexit.register(self.close)

    def move(self, path: Path | None) -> None:
        """Serve this path from now on; None: a hidden one, for the old path belongs to another process now."""
        before = self.socket_path
        if before is None:
            return
        self.socket_path = path or before.with_name(f".{os.getpid()}-{before.name}")
        with contextlib.suppress(OSError):
            before.replace(self.socket_path)

    def trigger(self, word: bytes = STOP) -> None:
        """Request a stop and return at once; for signal handlers. Does nothing before `start`."""
        if self._sockets is not None:
            with contextlib.suppress(OSError):
                self._sockets[1].send(word)

    def stop(self, client: str = "") -> StopOutcome:
        """Latch the engine and send the stop frames, in the calling thread. Raises what the driver raises."""
        bus, engine, by = self.bus, self.bus.engine, asked_by(client)
        engine.announce_stop(by)
        try:
            if bus.turn.acquire(Priority.STOP, engine.stop_delay(bus.now())):
                return self._stop_with_turn(by)
            stop = engine.nodes.stop_requests(bus.now(), engine.nodes.known)
            disturbs_no_reply = [request for request in stop.requests if not request.expected]
            for request in disturbs_no_reply or stop.requests:
                engine.note_stop(request)
                self._write_blind(request)
            if bus.turn.acquire(Priority.STOP, STOP_TIMEOUT):
                return self._stop_with_turn(by)
            silent = tuple(sorted(engine.nodes.known))
            promise = f"{stop.promise}; sent once, no acknowledgement could be read"
            return StopOutcome((), silent, 1, promise)
        finally:
            engine.stop_sent()

    def _write_blind(self, request: Request[Any]) -> None:
        """Write a frame of a stop without the turn; while the link is full, again and again until its deadline."""
        link, engine = self.bus.link, self.bus.engine
        end = link.now() + engine.air_time(request) + engine.reply_timeout(request)
        with contextlib.suppress(LinkError):
            while True:
                try:
                    link.write(request.wire)
                    return
                except LinkFull:
                    if link.now() >= end:
                        return
                time.sleep(engine.air_time(request))

    def _stop_with_turn(self, by: str) -> StopOutcome:
        bus, engine = self.bus, self.bus.engine
        try:
            engine.latch(bus.now(), by)
            self._restore_rate()
            tree = Tree(engine, stop_nodes(engine, bus.now), now=bus.now)
            tree.deadline = bus.now() + ROUNDS_TIME
            while not tree.advance():
                moment = bus.send((tree,))
                if not tree.ready:
                    bus.receive(min(moment, tree.next_moment()), (tree,))
            return tree.result()
        finally:
            engine.stop_sent()  # before the turn is free
            bus.turn.release()

    def _restore_rate(self) -> None:
        """A scan may be trying another rate: the nodes are stopped at the rate at which they answered last."""
        engine = self.bus.engine
        rate = engine.nodes.rate
        if engine.rate != rate:
            with contextlib.suppress(LinkError):
                self.bus.link.tune(rate)
                engine.set_rate(rate)

    # -- the thread --------------------------------------------------------------------------------------------

    def _serve(self, server: socket.socket) -> None:
        """Stop whenever a datagram asks for it: once for all that ask now."""
        while True:
            with contextlib.suppress(OSError):  # the socket was closed
                received = [server.recvfrom(LONGEST)]
                while received[-1][0] and select.select((server,), (), (), 0.0)[0]:
                    received.append(server.recvfrom(LONGEST))
                clients = [one for one in received if one[0].startswith(b"estop")]
                if clients or any(STOP in data and not data.strip(STOP + END) for data, _ in received):
                    self._stop_for(server, clients)
            if self._closed:
                return

    def _stop_for(self, server: socket.socket, clients: Sequence[tuple[bytes, Any]]) -> None:
        client = client_name(clients[0][0].removeprefix(b"estop")) if clients else ""
        try:
            outcome = self.stop(client)
        except Exception as error:  # the thread must serve the next request
            outcome = StopOutcome((), (), 0, f"nothing: {error}")
        for _, address in clients:
            if address:
                with contextlib.suppress(OSError):  # the client is gone
                    server.sendto(json.dumps(outcome._asdict()).encode(), address)

    def close(self) -> None:
        """End the thread when a stop that has begun is over. Nothing else is sent."""
        self._closed = True
        if self._starting.acquire(timeout=STOP_TIMEOUT):
            self._starting.release()
        atexit.unregister(self.close)
        self.trigger(END)
        if self._thread is not None and self._thread is not current_thread():
            self._thread.join(STOP_TIMEOUT)
        for end in self._sockets or ():
            end.close()
        if self._sockets and self.socket_path is not None:
            self.socket_path.unlink(missing_ok=True)
        self._sockets = None
