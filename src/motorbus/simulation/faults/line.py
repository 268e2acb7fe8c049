"""A wire that does harm by script: this byte of that exchange, this way, and a record of it by position.

It stands between a simulator and whatever serves it. There is no way to put it in front of a real device. Whatever
chance has decided is in the record as a place, so what was found by chance can be had again without it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, Side
from motorbus.simulation.faults.fault import SOMEWHERE, Fault
from motorbus.simulation.faults.harm import INSTANT, Piece, Strike, harmed, whole
from motorbus.simulation.faults.luck import Luck, chance
from motorbus.simulation.faults.script import Script, as_script

if TYPE_CHECKING:
    from motorbus.simulation.faults.world import World

BROKEN: Final = CanFrame(ERROR_FLAG | 0x88, bytes(8))
"""What an adapter tells of a frame that broke on the wire: protocol violation and bus error, as SocketCAN classes."""
_LONGEST: Final = 8


class Fired(NamedTuple):
    """A fault that happened: when (s), which (the option's name), toward whom, and what was to be delivered."""

    at: float
    fault: str
    to: Side
    data: Data


class _Way:
    """What is under way to one side."""

    def __init__(self) -> None:
        self.luck: list[Luck] = []
        self.moments: list[tuple[int, Fault]] = []
        self.floor = -inf  # nothing comes before this moment: whoever was sent first arrives first
        self.begin()

    def begin(self) -> None:
        """Another exchange."""
        self.packet = self.passed = 0
        self.later = 0.0
        self.lost = False


class FaultyLine:
    """A `Line` that carries, and does harm where its script says so.

    `script`   what it was told, with the seed that it uses
    `fired`    what has happened, in order, each with the fault by position as text
    `record`   the same as a script by position: the same traffic suffers the same again
    `pending`  what has a place or a moment and has not happened
    `never`    what stands there by chance and has not happened once
    `exchange` how many things the host has sent
    `most`     how many of the latest are kept; None: all

    The same script and the same traffic give the same bytes at the same moments. What happens to the bus and its
    devices needs a `world`, which forgets what another line has wanted of it; RequestError without one, or when these
    devices cannot do it.
    """

    def __init__(
        self,
        script: Script | str | Iterable[Fault] = (),
        world: World | None = None,
        *,
        most: int | None = None,
    ) -> None:
        given = as_script(script)
        self.faults = given.faults
        self.script = given.seeded(0) if given.by_chance else given
        self.fired: list[Fired] = []
        self.exchange = 0
        self.count = 0
        self._record: list[Fault] = []
        self._most = most
        self._world = world
        self._echoes = True
        self._ways = {Side.HOST: _Way(), Side.DEVICE: _Way()}
        self._waiting: dict[int, list[tuple[int, Fault]]] = {}
        self._timed: set[int] = set()
        self._lucky: set[int] = set()
        self._began = world.now if world is not None else 0.0
        for fault in self.faults:
            self._check(fault)
        if world is not None:
            world.forget()
        equal: Counter[Fault] = Counter()
        for index, fault in enumerate(self.faults):
            self._place(index, fault, twin=equal[fault])
            equal[fault] += 1

    def __str__(self) -> str:
        return str(self.script)

    @property
    def record(self) -> Script:
        """What has happened, by position."""
        return Script(tuple(self._record))

    @property
    def pending(self) -> tuple[Fault, ...]:
        """What has a place or a moment and has not happened yet."""
        left = [pair for waiting in self._waiting.values() for pair in waiting]
        left += [pair for way in self._ways.values() for pair in way.moments]
        left += [(index, self.faults[index]) for index in self._timed]
        armed = self._world.armed if self._world is not None else ()
        return (*armed, *(fault for _, fault in sorted(left, key=lambda pair: pair[0])))

    @property
    def never(self) -> tuple[Fault, ...]:
        """What stands there by chance and has not happened once."""
        return tuple(
            fault for index, fault in enumerate(self.faults) if fault.percent and index not in self._lucky
        )

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        """What arrives of this, and when."""
        to = Side.HOST
        if sender is Side.HOST:
            to = Side.DEVICE
            self.exchange += 1
            for way in self._ways.values():
                way.begin()
        way = self._ways[to]
        size = len(data.data) if isinstance(data, CanFrame) else len(data)
        way.packet += 1
        calm = way.floor <= at and not (way.later or way.lost)
        strikes = self._strikes(to, way, size, at, data)
        way.passed += size
        if calm and not strikes:
            return [Delivery(at, to, data)]
        return self._harmed(to, way, data, at, strikes)

    def carry_unechoed(self, data: Data, at: float) -> list[Delivery]:
        """As `carry`, of what the host sends where no echo of it could be heard: so there is none."""
        self._echoes = False
        try:
            return self.carry(Side.HOST, data, at)
        finally:
            self._echoes = True

    # -- which faults strike ------------------------------------------------------------------------------------------

    def _check(self, fault: Fault) -> None:
        if fault.word.world:
            if self._world is None:
                raise RequestError(
                    f"fault {fault}: {fault.action} happens to a simulated bus, and there is none",
                    advice="give it to motorbus.simulate or `motorbus simulate --faults`",
                )
            self._world.check(fault)

    def _place(self, index: int, fault: Fault, twin: int) -> None:
        if fault.percent:
            seed = self.script.seed or 0
            self._ways[fault.to].luck.append(Luck(fault, seed, index=index, twin=twin))
        elif fault.moment is not None and fault.word.world and self._world is not None:
            self._timed.add(index)
            self._world.at(self._began + fault.moment, partial(self._in_time, index, fault))
        elif fault.moment is not None:
            self._ways[fault.to].moments.append((index, fault))
        else:
            self._waiting.setdefault(fault.exchange or 0, []).append((index, fault))

    def _in_time(self, index: int, fault: Fault, moment: float) -> None:
        if self._world is not None and not self._is_moot(fault, self._ways[fault.to], b""):
            self._timed.discard(index)
            self._note(fault, moment, fault.to, b"")
            self._happen(fault, moment)

    def _strikes(self, to: Side, way: _Way, size: int, at: float, data: Data) -> list[Strike]:
        found: list[Strike] = []
        waiting = self._waiting.get(self.exchange)
        if waiting:
            found += self._scripted(waiting, to, way, size, data)
        for luck in way.luck:
            for place in luck.strikes(size if luck.fault.per_byte else 1):
                found += self._loose(luck.index, luck.fault, luck, place, way, data)
        for one in tuple(way.moments):
            if self._began + (one[1].moment or 0) <= at and not self._is_moot(one[1], way, data):
                way.moments.remove(one)
                found += self._loose(*one, None, 0, way, data)
        return sorted(found, key=lambda strike: strike[:2]) if len(found) > 1 else found

    def _scripted(
        self, waiting: list[tuple[int, Fault]], to: Side, way: _Way, size: int, data: Data
    ) -> list[Strike]:
        """Those of this exchange that strike this packet; they wait no more."""
        found: list[Strike] = []
        for pair in tuple(waiting):
            index, fault = pair
            place = -1 if fault.byte is None else fault.byte - way.passed
            here = (
                fault.packet == way.packet
                if fault.byte is None
                else 0 <= place < size + (fault.action == "insert")
            )
            if fault.to is not to or not here or self._is_moot(fault, way, data):
                continue
            waiting.remove(pair)
            found.append(Strike(place, index, fault))
        return found

    def _loose(
        self, index: int, fault: Fault, luck: Luck | None, place: int, way: _Way, data: Data
    ) -> list[Strike]:
        """What chance or the clock has brought, by position."""
        random = luck.random if luck else chance(fault, self.script.seed or 0, index)
        if self._is_moot(fault, way, data):
            return []
        if not fault.per_byte:
            return [Strike(-1, index, fault.settled(self.exchange, way.packet, None, random))]
        if _is_behind(fault, place, way.passed):
            return []
        return [Strike(place, index, fault.settled(self.exchange, way.packet, way.passed + place, random))]

    def _is_moot(self, fault: Fault, way: _Way, data: Data) -> bool:
        """Whether it would change nothing: then it does not happen, and what has a place stays pending."""
        if fault.word.world:
            # its id may be another one by now
            return fault.node is not None and self._world is not None and fault.node not in self._world.nodes
        if fault.action == "echo" and not self._echoes:
            return True
        if fault.action == "split" and fault.byte is None and not fault.per_byte:
            return isinstance(data, CanFrame) or len(data) < 2
        return way.lost and fault.action != "echo"

    def _somewhere(self, strike: Strike, way: _Way, passed: int, size: int) -> list[Strike]:
        """At a byte by chance, for what needs one."""
        random = chance(strike.fault, self.script.seed or 0, strike.rank)
        place = random.randrange(size)
        if _is_behind(strike.fault, place, passed):
            return []
        fault = strike.fault.settled(self.exchange, way.packet, passed + place, random)
        return [Strike(place, strike.rank, fault)]

    # -- what becomes of a packet -------------------------------------------------------------------------------------

    def _harmed(self, to: Side, way: _Way, data: Data, at: float, strikes: list[Strike]) -> list[Delivery]:
        body = data.data if isinstance(data, CanFrame) else data
        passed = way.passed - len(body)
        if not isinstance(data, CanFrame):
            needy = [one for one in strikes if one.place < 0 and one.fault.action in SOMEWHERE]
            if needy and body:
                strikes = [one for one in strikes if one not in needy]
                strikes += [found for one in needy for found in self._somewhere(one, way, passed, len(body))]
                strikes.sort(key=lambda strike: strike[:2])
        for strike in strikes:
            self._lucky.add(strike.rank)
            self._note(strike.fault, at, to, data)
        pieces = self._at_bytes(way, data, body, at, [one for one in strikes if one.place >= 0])
        packet = [one.fault for one in strikes if one.place < 0]
        return self._at_packet(to, way, data, at, pieces, packet)

    def _at_bytes(self, way: _Way, data: Data, body: bytes, at: float, strikes: list[Strike]) -> list[Piece]:
        if not strikes and (way.lost or isinstance(data, CanFrame)):
            return [] if way.lost else [(way.later, data)]
        found = harmed(
            body, strikes, way.later, way.lost, lambda fault, later: self._happen(fault, at + later)
        )
        way.later, way.lost = found.later, way.lost or found.lost
        if not isinstance(data, CanFrame):
            return [*found.pieces]
        shift = found.pieces[-1][0] if found.pieces else way.later
        left = b"".join(piece for _, piece in found.pieces)[:_LONGEST]
        return [(shift, data._replace(data=left))]

    def _at_packet(
        self,
        to: Side,
        way: _Way,
        data: Data,
        at: float,
        pieces: list[Piece],
        faults: list[Fault],
    ) -> list[Delivery]:
        sent: list[Delivery] = []
        for fault in faults:
            action = fault.action
            if fault.word.world:
                self._happen(fault, at)
                pause = 0.0 if fault.word.waits else INSTANT
                pieces = [(shift + pause, piece) for shift, piece in pieces]
            elif action == "echo":
                sent += self._echoed(data, at, fault.value)
            elif isinstance(data, CanFrame) and action in SOMEWHERE:
                pieces = []
                sent += self._delivered(Side.HOST, at, [(0.0, BROKEN)])
            else:
                pieces = whole(fault, pieces)
        return sent + self._delivered(to, at, pieces)

    def _echoed(self, data: Data, at: float, count: int) -> list[Delivery]:
        heard = data if isinstance(data, CanFrame) or not count else data[:count]
        return self._delivered(Side.HOST, at, [(0.0, heard)])

    def _delivered(self, to: Side, at: float, pieces: list[Piece]) -> list[Delivery]:
        """Whoever was sent first arrives first."""
        way, sent = self._ways[to], []
        for shift, piece in pieces:
            way.floor = max(at + shift, way.floor)
            sent.append(Delivery(way.floor, to, piece))
        return sent

    # -- keeping books ------------------------------------------------------------------------------------------------

    def _happen(self, fault: Fault, at: float) -> None:
        if self._world is not None:
            self._world.happen(fault, at, lambda moment: self._note(fault, moment, fault.to, b"", torn=True))

    def _note(self, fault: Fault, at: float, to: Side, data: Data, *, torn: bool = False) -> None:
        if fault.word.waits and not torn:
            return  # it has happened when something was stored and torn
        self.count += 1
        self._record.append(fault)
        self.fired.append(Fired(at, str(fault), to, data))
        if self._most is not None and len(self.fired) >= 2 * self._most:
            del self.fired[: -self._most], self._record[: -self._most]

    @property
    def counts(self) -> Counter[str]:
        """How often each word has happened, of those that are kept."""
        return Counter(fault.action for fault in self._record)


def _is_behind(fault: Fault, place: int, passed: int) -> bool:
    """Whether this byte would, by its place, stand behind the packet before it: chance leaves that out."""
    return fault.action == "insert" and place == 0 and passed > 0
