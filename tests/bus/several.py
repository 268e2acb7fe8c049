"""Several buses at once for tests, with clocks that have nothing to do with each other."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random
from typing import Any

from motorbus.bus.aio import AsyncBus
from motorbus.bus.concert import Concert
from motorbus.bus.concert_loop import LoopConcert
from motorbus.bus.face import BusFace
from motorbus.bus.pump import Bus
from motorbus.core.operation import Exchange, Operation, Pause, Report
from motorbus.families.feetech import FAMILY
from motorbus.link.memory import MemoryLink
from tests.bus.responder import LOCK, Responder, position
from tests.bus.script import admit_all


def links(virtual: tuple[bool, ...]) -> dict[str, tuple[MemoryLink, Responder]]:
    """One for each, "a" and so on; virtual clocks begin ten seconds apart."""
    found = {}
    for number, one in enumerate(virtual):
        responder = Responder()
        found["abcdefgh"[number]] = (
            MemoryLink(responder, virtual=one, start=10.0 * number),
            responder,
        )
    return found


class Several:
    """Blocking buses, their simulated devices, and who carries out work on them all."""

    def __init__(self, *virtual: bool) -> None:
        made = links(virtual)
        self.responders = {name: responder for name, (_, responder) in made.items()}
        self.buses = {name: Bus(link, FAMILY, admit=admit_all) for name, (link, _) in made.items()}
        self.origins = origins(self.buses)
        self.concert = Concert(self.buses, self.origins)

    def close(self) -> None:
        for bus in self.buses.values():
            bus.close()


class SeveralAsync:
    """The same on an event loop."""

    def __init__(self, *virtual: bool) -> None:
        made = links(virtual)
        self.responders = {name: responder for name, (_, responder) in made.items()}
        self.buses = {name: AsyncBus(link, FAMILY, admit=admit_all) for name, (link, _) in made.items()}
        self.origins = origins(self.buses)
        self.concert = LoopConcert(self.buses, self.origins)

    async def close(self) -> None:
        for bus in self.buses.values():
            await bus.close()


def origins(buses: Mapping[str, BusFace]) -> dict[str, float]:
    """What the clock of each shows now."""
    return {name: bus.link.now() for name, bus in buses.items()}


def left(buses: Mapping[str, BusFace], responders: Mapping[str, Responder]) -> list[str]:
    """What of a run that is over is still there, by bus. What has ended leaves the queue when the next is sent."""
    wrong = []
    for name, bus in buses.items():
        turns, relay = bus.turns, getattr(bus, "relay", None)
        found = {
            "the lock": turns.lock._is_owned(),  # type: ignore[attr-defined]
            "a claim": turns._claims.held or turns._claims.waiting,
            "something queued": any(not one.done for queue in turns._queues for one in queue),
            "a timer": turns._timers,
            "somebody who pumps": relay is not None and relay.pumper is not None,
            "a bell": relay is not None and relay.bells,
            "an open device": responders[name].memory[1][LOCK] != 1,
        }
        wrong += [f"{name}: {what}" for what, is_there in found.items() if is_there]
    return wrong


def single(node: int) -> Operation[int]:
    """A position, the long way."""
    return (yield from position(node))


def wander(seed: int, name: str, origin: float, log: list[tuple[float, str]]) -> Operation[int]:
    """Exchanges and pauses by chance; each time it comes back, the moment on the clock of all is noted."""
    chance = Random(seed)
    for _ in range(30):
        step: Exchange[int] | Pause = (
            position(chance.randint(1, 20)) if chance.random() < 0.6 else Pause(chance.uniform(0.0, 0.03))
        )
        yield from step
        log.append(((yield from Pause(0)) - origin, name))
    return seed


def telling(event: Any, operation: Operation[int]) -> Operation[int]:
    """Report that it has begun, then go on."""
    yield from Report(event)
    return (yield from operation)
