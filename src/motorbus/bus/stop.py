"""The emergency stop, which goes through whatever happens.

Every bus has one sleeping stop thread, from its first motion or torque command on, and where another process can
ask for a stop from the moment it is opened (decision record 0015). `estop()` wakes it by one byte through a socket
pair, so a signal handler may do the same; it latches the turns, writes the stop frames and repeats them until every
node has acknowledged, or five times. Where devices must be told a position to hold at, one whose position is not
fresh is asked for it, and the frame that holds it there follows in the same round. The thread needs neither the event
loop nor the thread that pumps; it does need this process and its interpreter lock. Another process asks for a stop
over a local socket beside the lock file. Over a link with virtual time there is no thread: the caller turns the crank.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import socket
from collections.abc import Iterable
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from threading import Event, Lock, Thread

from motorbus.bus import obedience
from motorbus.bus.crank import crank, retune
from motorbus.bus.pace import MARGIN
from motorbus.bus.stop_socket import PATIENCE, StopOutcome, asked_by, client_name, listening
from motorbus.bus.ticket import Flight, Retune
from motorbus.bus.turns import GATED, Turns
from motorbus.core.family import Stop
from motorbus.core.operation import Answer, Exchange, Timeout, Tune
from motorbus.errors import LinkError, LinkLost
from motorbus.link.base import Link

ROUNDS = 5
TRIES = 3  # of a stop that is interrupted
ROUND_TIME = 0.25  # s for all frames of one round, beyond what they need
BREATH = 0.05  # s; the shortest round after which something is missing
CLIENT_TIME = 0.05  # s; a client that is ready has its request ready too
STOP, END = b"!", b"."  # what wakes the thread


class Wish:
    """Somebody who waits for a stop: several may at the same time, and each is told what came of one."""

    def __init__(self) -> None:
        self.outcome: StopOutcome | None = None
        self.fulfilled = Event()


def _no_thread() -> LinkError:
    return LinkError(
        "the system gives no more threads, and what moves needs one that can stop it",
        advice="end what holds so many threads; nothing was sent",
    )


class Stopper:
    """The emergency stop of one bus."""

    def __init__(self, link: Link, turns: Turns, socket_path: Path | None = None) -> None:
        self.link = link
        self.turns = turns
        self.socket_path = socket_path
        self.outcome: StopOutcome | None = None
        self._pair: tuple[socket.socket, socket.socket] | None = None
        self._wishes: list[Wish] = []
        self._ready = Event()
        self._starting = Lock()
        self._thread: Thread | None = None
        self._closed = False

    def start(self) -> None:
        """Have the stop thread ready; does nothing when it is, or where time is virtual.

        Raises LinkError where the system gives no more threads: nothing is sent then that might have to be stopped.
        """
        if self._thread is not None or self.link.virtual:
            return
        with self._starting:
            if self._thread is None and not self._closed:
                self._pair = self._pair or socket.socketpair()
                thread = Thread(target=self._serve, name="motorbus stop", daemon=True)
                try:
                    thread.start()
                except RuntimeError as none:
                    raise _no_thread() from none
                self._thread = thread
                self._ready.wait(PATIENCE)
                atexit.register(self.close)  # a process that ends lets a stop that has begun come to its end

    def move(self, path: Path | None) -> None:
        """Other processes reach it by this path from now on; None: by none, for the old one is somebody else's."""
        before = self.socket_path
        if before is None:
            return
        self.socket_path = path or before.with_name(f".{os.getpid()}-{before.name}")
        with contextlib.suppress(OSError):  # nobody listens there, as where the disk is full
            before.replace(self.socket_path)

    def trigger(self) -> None:
        """Ask for the stop and return at once; safe in a signal handler. Does nothing before `start`."""
        self._wake(STOP)

    def _wake(self, word: bytes) -> None:
        if self._pair is not None:
            with contextlib.suppress(OSError):
                self._pair[1].send(word)

    def estop(self) -> StopOutcome:
        """Stop, and wait for the outcome. Raises LinkLost when the bus is closed: nothing can be sent then."""
        if self._closed:
            raise LinkLost("the bus is closed: no stop was sent", advice="open it again, or cut the power")
        if self.link.virtual:
            return self.stop()
        try:
            self.start()
        except LinkError:  # no thread is to be had: whoever calls does the work
            return self.stop()
        wish = Wish()
        self._wishes.append(wish)
        self.trigger()
        wish.fulfilled.wait(PATIENCE)
        return wish.outcome or self._nothing("nothing: the stop thread gave no sign")

    def stop(self) -> StopOutcome:
        """Latch and send the stop frames, whatever interrupts it: from the beginning then, and only then it is raised.

        It runs in the stop thread, or in the caller's where time is virtual.
        """
        outcome, interruption = self._insist()
        if interruption is not None:
            raise interruption
        return outcome

    def _insist(self, client: str = "") -> tuple[StopOutcome, BaseException | None]:
        caught: BaseException | None = None
        for _ in range(TRIES):
            try:
                if caught is not None:
                    self._let_go()
                return self._stop(asked_by(client)), caught
            except BaseException as interruption:  # dealt with above, where another one is caught too
                caught = interruption
        self._let_go()
        return self._nothing("nothing: it was cut short again and again"), caught

    def _let_go(self) -> None:
        """After an interruption: let go of the lock as often as it is held, and of the bus."""
        with contextlib.suppress(RuntimeError):  # not held (any more)
            while True:
                self.turns.lock.release()
        with self.turns.lock:
            self.turns.stopped()

    def _nothing(self, promise: str) -> StopOutcome:
        return StopOutcome((), tuple(self.turns.known), 0, promise)

    def _stop(self, by: str) -> StopOutcome:
        with self.turns.lock:
            frames = self.turns.latch(self.link.now(), by)
        self._back_to_known_rate()
        acknowledged: list[int] = []
        rounds = 0
        wanting = frames.exchanges
        while (
            rounds < ROUNDS and not self.turns.listening and (not acknowledged or obedience.answered(wanting))
        ):
            rounds += 1
            self._round(wanting, acknowledged)
            wanting = self._wanting(wanting, acknowledged)
        with self.turns.lock:
            self.turns.stopped()
        silent = tuple(node for node in list(self.turns.known) if node not in acknowledged)
        promise = "nothing: the bus only listens" if self.turns.listening else frames.promise
        return StopOutcome(tuple(acknowledged), silent, rounds, promise)

    def _back_to_known_rate(self) -> None:
        """A scan may be trying another rate, or only listening; whoever is to stop was last heard at its own."""
        turns = self.turns
        with turns.lock:
            if (turns.known.rate, turns.listen_only) != (turns.rate, turns.listening):
                retune(self.link, turns, Retune(Tune(turns.known.rate), None, None))

    def _frames(self, nodes: Iterable[int]) -> tuple[Exchange[Answer], ...]:
        """What stops these nodes as things are now."""
        with self.turns.lock:
            fresh = self.turns.known.fresh(self.link.now())
            stop: Stop = self.turns.family.stop({node: fresh[node] for node in nodes if node in fresh})
        return stop.exchanges

    def _wanting(
        self, before: tuple[Exchange[Answer], ...], acknowledged: list[int]
    ) -> tuple[Exchange[Answer], ...]:
        """What the next round sends: the frames for those who have not acknowledged, and those for everyone."""
        missing = [node for node in list(self.turns.known) if node not in acknowledged]  # others may add some
        if acknowledged and not missing:
            return ()
        try:
            frames = self._frames(missing)
        except Exception:  # the family's own; the frames it made before do
            frames = before
        return tuple(
            one for one in frames if not one.replies or not set(obedience.nodes(one)) <= set(acknowledged)
        )

    def _round(self, exchanges: Iterable[Exchange[Answer]], acknowledged: list[int]) -> None:
        """Send each once, and whatever can be sent once a node has said where it is."""
        begun = self.link.now()
        flights: list[Flight] = []
        limit = self._submit(exchanges, flights, begun + ROUND_TIME)
        asking = {flight for flight in flights if flight.exchange.effect not in GATED}
        while not all(flight.done for flight in flights) and self.link.now() < limit:
            crank(self.link, self.turns, limit)
            for flight in [flight for flight in asking if flight.done]:
                asking.remove(flight)
                limit = self._submit(self._following(flight), flights, limit)
        missing = [flight for flight in flights if not self._settled(flight)]
        obeyed = obedience.obeyed(flights, missing, acknowledged)
        acknowledged += obeyed
        with self.turns.lock:
            for node in obeyed:
                self.turns.known.accepted(node)
        again = [flight.exchange for flight in missing if self._may_come(flight)]
        while obedience.answered(again) and self.link.now() < begun + BREATH:
            crank(self.link, self.turns, begun + BREATH)  # a port that was full may have room then

    def _may_come(self, flight: Flight) -> bool:
        """Whether it is worth sending this once more: a link that is lost may be there again in a moment, or never."""
        return not isinstance(flight.error, LinkLost) or self.turns.gone is not None

    def _submit(self, exchanges: Iterable[Exchange[Answer]], flights: list[Flight], limit: float) -> float:
        """Queue them; returns the limit of the round, later by the time they take."""
        with self.turns.lock:
            for exchange in exchanges:
                flights.append(Flight(exchange))
                limit += self._time(exchange)
                self.turns.submit(flights[-1], self.link.now())
        return limit

    def _following(self, asked: Flight) -> list[Exchange[Answer]]:
        """This node has said where it is: the frames that hold it there."""
        nodes = obedience.nodes(asked.exchange)
        if asked.error is not None or not nodes:
            return []
        with contextlib.suppress(Exception):  # the family's own; the next round asks again
            return [one for one in self._frames(nodes) if one.effect in GATED and obedience.nodes(one)]
        return []

    def _time(self, exchange: Exchange[Answer]) -> float:
        turns = self.turns
        air = turns.family.air_time(exchange, turns.rate) + turns.family.turnaround(exchange)
        return air + turns.latency + MARGIN[Timeout.SCAN]

    def _settled(self, flight: Flight) -> bool:
        """Whether it was answered, by everyone it asks, and not refused."""
        with self.turns.lock:
            if not flight.done:
                self.turns.abandon(flight)
        return (
            flight.error is None and bool(obedience.nodes(flight.exchange)) and not obedience.refused(flight)
        )

    # -- the thread -----------------------------------------------------------------------------------------

    def _serve(self) -> None:
        assert self._pair is not None
        wish = self._pair[0]
        with listening(self.socket_path, lambda: self.socket_path) as listener, DefaultSelector() as ready:
            if listener is not None:
                ready.register(listener, EVENT_READ)
            try:
                ready.register(wish, EVENT_READ)
            except ValueError:  # it was closed in the moment in which it was started
                return
            finally:
                self._ready.set()
            ended = False
            while not ended:
                try:
                    ended = self._look(ready, wish, listener)
                except Exception:  # whatever goes wrong, the next wish must be heard
                    ended = self._closed
            for key in list(ready.get_map().values()):
                if key.fileobj not in (wish, listener) and isinstance(key.fileobj, socket.socket):
                    key.fileobj.close()

    def _look(self, ready: DefaultSelector, wish: socket.socket, listener: socket.socket | None) -> bool:
        """Wait for a wish from this process first, then for clients; a mute one holds up nobody. True at the end."""
        ends = [key.fileobj for key, _ in ready.select()]
        if wish in ends and self._wished(wish):
            return True
        for end in ends:
            if end is listener and listener is not None:
                with contextlib.suppress(OSError):
                    ready.register(listener.accept()[0], EVENT_READ)
            elif end is not wish and isinstance(end, socket.socket):
                ready.unregister(end)
                self._asked(end)
        return False

    def _wished(self, wish: socket.socket) -> bool:
        """Stop if that is wished, also just before the end; True when the end is."""
        words = wish.recv(4096)
        if STOP in words:
            self._stop_and_tell()
        return END in words

    def _stop_and_tell(self, client: str = "") -> StopOutcome:
        wishes, self._wishes = self._wishes, []
        self.outcome = outcome = self._insist(client)[0]
        for wish in wishes:  # who asked after that has woken the thread once more
            wish.outcome = outcome
            wish.fulfilled.set()
        return outcome

    def _asked(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError), client:
            client.settimeout(CLIENT_TIME)
            word, _, about = client.recv(4096).strip().partition(b" ")
            if word == b"estop":
                outcome = self._stop_and_tell(client_name(about))
                client.sendall(json.dumps(outcome._asdict()).encode() + b"\n")

    def close(self) -> None:
        """End the thread, once a stop that has begun is over. Nothing else is sent."""
        self._closed = True
        if self._starting.acquire(timeout=PATIENCE):  # whoever is starting the thread has it all there then
            self._starting.release()
        atexit.unregister(self.close)
        self._wake(END)
        if self._thread is not None:
            self._thread.join(PATIENCE)
        for end in self._pair or ():
            end.close()
