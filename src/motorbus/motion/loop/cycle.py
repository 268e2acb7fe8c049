"""One cycle of a loop on one bus: goals out, positions in. This is the hot path; whatever can be known before is.

The requests are those of the family's `PositionStream`, and the bus decides how to send them: on one lane they follow
each other, on several they are all in flight at once. A device that does not answer costs its own reading and no other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isfinite, nan
from typing import TYPE_CHECKING, Any, Final

from motorbus.bus.base import BaseBus
from motorbus.bus.blocking import Bus
from motorbus.core.family import Positions, PositionStream, Quality
from motorbus.core.request import Request
from motorbus.core.steps import Sleep, catch, gather
from motorbus.errors import (
    Faulted,
    LimitExceeded,
    MotionError,
    MotorbusError,
    Overloaded,
)
from motorbus.motion import capabilities as single
from motorbus.motion.capabilities import AxisVerbs, cap
from motorbus.motion.command import Command
from motorbus.motion.loop.errors import stopped
from motorbus.motion.loop.place import Place
from motorbus.motion.moving.forgiving import LOST
from motorbus.motion.safety import restarts
from motorbus.motion.safety.track import FASTEST, MARGIN, TREMBLING

if TYPE_CHECKING:
    from motorbus.motion.safety.watch import Watch

HALF: Final = 0.5
"""Of a period; after a hitch two readings may be closer together than that, and it is no matter."""
SPIN: Final = 0.0002
"""s before a slot from which on a blocking loop looks at the clock without a pause: no system wakes it that exactly."""


class Part:
    """What a loop does on one bus. `began` and `ended` are those of the last cycle, in s of robot time.

    `origin` is what the clock of its link showed when that of the robot was at 0. Those who wait `exactly` burn the
    processor for the last bit. `command` is over those who are led; `refused` are those of the last orders that could
    not be given, and stay where they are; `to` are the angles of the last orders (rad), by node. While `unsure`, it may
    be that nobody knows where one of them is: `left_out` are those whom the last orders left out for that, `doubts` has
    by name how far the last reading of those can be believed for whom that is in question. A `watch` asks now and then,
    where there is time, how those fare who are led.
    """

    def __init__(
        self,
        bus: BaseBus,
        origin: float,
        places: Sequence[Place],
        train: PositionStream,
        watch: Watch | None = None,
    ) -> None:
        self.bus: Final = bus
        self.link: Final = bus.link
        self.origin: Final = origin
        self.places: Final = {place.node: place for place in places}
        self.train: Final = train
        self.reads: Final = tuple(train.positions)
        self.exactly = False
        self.began = self.ended = 0.0
        self.overlaps: Final = len({request.lane for request in self.reads}) > 1
        self.command = Command(())
        self.refused: list[LimitExceeded] = []
        self.watch = watch
        self.unsure = False
        self.left_out: list[str] = []
        self.to: dict[int, float] = {}
        self.doubts: dict[str, Quality] = {}
        self._sure: Final = TREMBLING + FASTEST * MARGIN * HALF * (places[0].period if places else 0.0)

    @property
    def now(self) -> float:
        """Robot time by the clock of this bus (s)."""
        return self.link.now() - self.origin

    # -- a cycle -------------------------------------------------------------------------------------------------------

    def orders(self, periods: int) -> Sequence[Request[Any]]:
        """The exchanges that order the next small goal of all who are led; see `refused`.

        Raises RequestError when one of them was set up anew, and takes goals of another kind now.
        """
        if self.unsure:
            to = self._of_some(periods)
        else:
            to = {}
            for node, place in self.places.items():
                if place.begun:
                    try:
                        to[node] = place.step(periods)
                    except LimitExceeded as error:
                        to[node] = place.stay()
                        self.refused.append(error)
        self.to = to
        return self.ordering(to)

    def ordering(self, to: Mapping[int, float]) -> Sequence[Request[Any]]:
        """The exchanges that order these angles (rad), by node. Raises RequestError as `orders`."""
        if not to:
            return ()
        guarded = self.command.guarded
        return [guarded(request) for request in self.train.goals(to)]

    def withheld(self) -> list[str]:
        """Take out of the last orders, which have not left, who cannot be believed since; their names.

        They have made their step, and so have not to make it good, whenever it is known again where they are.
        """
        lost = [place for node, place in self.places.items() if place.unsure and node in self.to]
        for place in lost:
            del self.to[place.node]
        return [place.name for place in lost]

    def _of_some(self, periods: int) -> dict[int, float]:
        """The same while it may be that nobody knows where one is: those are left out, and the others go on."""
        to: dict[int, float] = {}
        self.left_out.clear()
        for node, place in self.places.items():
            if not place.begun:
                continue
            if place.unsure:
                place.left += 1
                self.left_out.append(place.name)
                continue
            since, place.left = periods + place.left, 0
            try:
                to[node] = place.step(since)
            except LimitExceeded as error:
                to[node] = place.stay()
                self.refused.append(error)
        self.unsure = bool(self.left_out)
        return to

    async def cycle(self, orders: Sequence[Request[Any]], moment: float) -> list[Any]:
        """Send these from a moment of robot time on, then ask for all positions; what came of each exchange.

        Raises Faulted and Overloaded as `Watch.take`, before anything of this has left.
        """
        if (watch := self.watch) is not None:
            now = self.link.now()
            if watch.due(now, moment + self.origin - now) is not None:
                await self._asked(watch, moment)
        for pause in self._wait(moment + self.origin):
            await pause
        self.began = self.link.now() - self.origin
        told: list[Any] = []
        wanted = (*orders, *self.reads)
        if self.overlaps:
            told = list(await gather(*[_kept(request) for request in wanted]))
        else:
            for request in wanted:
                try:
                    told.append(await request)
                except LOST as error:
                    told.append(error)
        self.ended = self.link.now() - self.origin
        return told

    def await_slot(self, bus: Bus, moment: float) -> None:
        """Look how those fare who are due, where there is time, and wait for this moment: a cycle has `began` then."""
        link, begins = self.link, moment + self.origin
        if (watch := self.watch) is not None:
            now = link.now()
            if watch.due(now, begins - now) is not None:
                bus.run(self._asked(watch, moment))
        now = link.now()
        if now < begins:  # else there is nothing to wait for
            for pause in self._wait(begins):
                bus.run(pause)
            now = link.now()
        self.began = now - self.origin

    def _wait(self, moment: float) -> Iterator[Sleep]:
        link = self.link
        pause = moment - link.now() - (SPIN if self.exactly else 0.0)
        if pause > 0:
            yield Sleep(pause)
        if self.exactly:
            while link.now() < moment:
                pass

    async def _asked(self, watch: Watch, moment: float) -> None:
        """Ask who is due how he fares, while the wire is free anyway before a slot that begins at this moment.

        Who pushes too hard is told to stay where he is.
        """
        led = [place for place in self.places.values() if place.begun]
        goals = {place.node: place.stay() for place in led}
        places = {place.node: place.zero + place.position * place.ratio for place in led}
        try:
            await watch.asking(moment - self.now, goals, places)
        except Overloaded as error:
            for place in led:
                if place.node == error.node:
                    failure = await catch(single.stop(place.axis))
                    if isinstance(failure, MotorbusError):
                        error.add_note(f"and it did not accept the stop that followed: {failure}")
            raise

    def take(self, told: Sequence[Any]) -> list[str]:
        """Note where they are, by what came of a cycle; the names of those who were not heard.

        A reading is taken as it is where any motor can have come there since the last one; else see `_judged`.
        """
        places = self.places
        sure = self._sure
        heard = 0
        at = 0.0
        if self.doubts:
            self.doubts = {}
        for found in told:
            if type(found) is Positions:
                at = found.at - self.origin
                for node, angle in found.values.items():
                    place = places[node]
                    if -sure <= angle - place.angle <= sure:
                        place.angle = angle
                        place.position = (angle - place.zero) / place.ratio
                        place.heard = at
                        place.silent = 0
                    else:
                        self._judged(place, angle, found.at)
                    heard += 1
        return [] if heard == len(places) else self._unheard(told)

    def _judged(self, place: Place, angle: float, at: float) -> None:
        """Judge a reading that is far from the last one, or has none before it, by the track of its axis."""
        track = place.axis.track
        if isfinite(place.angle):
            track.take(place.angle, place.heard + self.origin)
        quality = track.take(angle, at).quality
        if quality is Quality.SUSPECT:
            place.doubt()
            self.unsure = True
        else:
            anew = place.silent > place.endures or quality is Quality.CONFIRMED
            place.hear(angle, at - self.origin)
            if anew and place.begun:
                place.resume()
        if quality in (Quality.SUSPECT, Quality.CONFIRMED):
            self.doubts[place.name] = quality

    def heard(self, told: Sequence[Any]) -> dict[str, float]:
        """When each was heard (s of robot time) of whom there is a reading among what came of a cycle, by name."""
        return {
            self.places[node].name: found.at - self.origin
            for found in told
            if isinstance(found, Positions)
            for node in found.values
        }

    def _unheard(self, told: Sequence[Any]) -> list[str]:
        heard = {node for found in told if isinstance(found, Positions) for node in found.values}
        missing = [place for node, place in self.places.items() if node not in heard]
        for place in missing:
            place.silent += 1
            if place.silent > place.endures:
                self.unsure = True
                if isfinite(place.angle):
                    place.axis.track.take(place.angle, place.heard + self.origin)
                    place.angle = nan
        return [place.name for place in missing]

    # -- the beginning -------------------------------------------------------------------------------------------------

    async def begin(self, fresh: Sequence[Place]) -> None:
        """Give these torque without a jump, with the caps of the machine file, and see where they stand.

        Raises Interrupted when somebody else has told one of them something since its goal was set: nothing of this
        leaves any more then, so whoever has let an axis go finds it limp. Raises Faulted and Overloaded as
        `Watch.begin`.
        """
        axes = [place.axis for place in fresh]
        for axis in axes:
            restarts.check(axis)
        command = _claimed(fresh)
        train = await train_of(self.bus, axes)
        try:
            for axis in axes:
                await restarts.unbroken(axis)
            command.depart()
            angles = await _begun(train, command, self.watch)
        except Faulted:
            raise
        except MotionError as error:
            if lost := set(axes).difference(command.held()):
                raise stopped([axis.name for axis in axes if axis in lost]) from error
            raise
        self.command = self.command.joined(command)
        for place, angle in zip(fresh, angles, strict=True):
            place.begin(place.axis.spec.from_device(angle))

    def brakes(self) -> bool:
        """Whether one of those who follow a goal is not there yet."""
        return any(place.begun and not place.arrived for place in self.places.values())

    def release_lost(self) -> list[str]:
        """Who was told something from elsewhere is led no more; their names. After an emergency stop all of them."""
        self.command = command = Command(()) if self.bus.latched else self.command.rest()
        lost = [place for place in self.places.values() if place.begun and place.axis not in command.axes]
        return self._release(lost)

    def release_unbegun(self) -> None:
        """Who has got no torque here is to get none."""
        self._release([place for place in self.places.values() if not place.begun])

    def release_claimed(self) -> list[str]:
        """Who was told something from elsewhere since its first goal was set is not to be led; their names."""
        waiting = [place for place in self.places.values() if place.asked is not None and not place.begun]
        return self._release([one for one in waiting if one.claim is not None and one.claim.lost()])

    def release_gone(self) -> None:
        """The port is gone: nobody is led any more, and no goal that was set before is given when it is there again."""
        self.command = Command(())
        self._release([place for place in self.places.values() if place.begun or place.asked is not None])

    def release_silent(self) -> None:
        """Who has not been heard for too long to be ordered is left at the last goal that he was told."""
        self._release(
            [place for place in self.places.values() if place.begun and place.silent > place.endures]
        )

    def _release(self, places: Iterable[Place]) -> list[str]:
        names = []
        for place in places:
            place.release()
            names.append(place.name)
            if self.watch is not None:
                self.watch.dismiss(place.node)
        return names


def _claimed(fresh: Iterable[Place]) -> Command:
    """The command over these, each from when its goal was set."""
    command = Command(())
    for place in fresh:
        command = command.joined(place.claim or Command((place.axis,)))
    return command


async def _begun(train: PositionStream, command: Command, watch: Watch | None) -> list[float]:
    """Torque on, and as quick in following as the axis may be; where the device of each stands then (rad)."""

    async def ready() -> None:
        for axis in command.axes:
            await cap(axis)
        speeds = {axis.spec.node: axis.spec.rate_to_device(axis.spec.max_velocity) for axis in command.axes}
        await train.start({node: abs(speed) for node, speed in speeds.items()})

    try:
        await command.watched(ready())
        if watch is not None:
            await watch.begin(command.axes)
        return list(await gather(*[axis.able.position(axis.device) for axis in command.axes]))
    except BaseException:
        for axis in command.held():  # they may have torque, and go nowhere
            axis.arrives()
        raise


def divided(axes: Mapping[str, AxisVerbs]) -> tuple[dict[str, AxisVerbs], tuple[str, ...]]:
    """Those that can be led in a loop, and the names of those that cannot."""
    led = {name: axis for name, axis in axes.items() if "stream" in axis.able}
    return led, tuple(name for name in axes if name not in led)


async def train_of(bus: BaseBus, axes: Sequence[AxisVerbs]) -> PositionStream:
    """These axes of one bus, ready to be asked and told in a loop; nothing is written."""
    train: PositionStream = await axes[0].able.stream([axis.device for axis in axes], rate=bus.rate)
    return train


async def _kept(request: Request[Any]) -> Any:
    """Its value, or the error by which it was lost; every other error is raised when all have ended."""
    found = await catch(request)
    if isinstance(found, MotorbusError) and not isinstance(found, LOST):
        raise found
    return found
