"""One axis of a machine: the capabilities of its device, in the units, the zero and the direction of the axis.

An axis has what its device has and lacks what it lacks: `hasattr(axis, "temperature")` tells, and no verb is there only
to raise. Here is what an axis is, and what it tells and is told without moving; the list of its verbs is in `axes`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, Final, ParamSpec, TypeVar

from motorbus.core.device import device_method
from motorbus.core.family import AxisDriver, Quality, State
from motorbus.core.steps import Runnable
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.command import Command
from motorbus.motion.machine import AxisSpec
from motorbus.motion.reckoning import Movement, Place, Reckoning, checked_place, is_reckoned
from motorbus.motion.safety import restarts
from motorbus.motion.safety.blame import blamed
from motorbus.motion.safety.restarts import RestartDetector
from motorbus.motion.safety.track import Track, believed
from motorbus.motion.safety.turning import Resting
from motorbus.motion.several import named, names

if TYPE_CHECKING:
    from enum import Enum

P = ParamSpec("P")
T = TypeVar("T")

FEEDBACK: Final = "feedback"
ESTIMATED: Final = "estimated"
"""Which of these is among the capabilities of an axis says whether its position is measured or reckoned."""


def _telling(
    function: Callable[Concatenate[Any, P], Runnable[T]],
) -> Callable[Concatenate[Any, P], Runnable[T]]:
    """The same, whose errors name the axis that they befell."""

    @wraps(function)
    async def told(axis: Any, /, *args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return await function(axis, *args, **kwargs)
        except MotorbusError as error:
            why = blamed(error, [axis.bus])
            found = why if names(why, axis.name) else named(axis.name, why)
            if found is error:
                raise
            raise found from error

    return told


class ability(device_method[P, T]):  # noqa: N801 - reads as a word in a list of verbs
    """A verb that an axis has only if its device has one of the capabilities that it `needs`, one or several names."""

    def __init__(
        self, needs: str | tuple[str, ...], function: Callable[Concatenate[Any, P], Runnable[T]]
    ) -> None:
        super().__init__(_telling(function))
        self.needs = (needs,) if isinstance(needs, str) else needs

    def there(self, axis: AxisVerbs) -> bool:
        """Whether this axis has it."""
        return any(one in axis.able for one in self.needs)

    if not TYPE_CHECKING:

        def __get__(self, axis: Any, owner: type) -> Any:
            if axis is not None and not self.there(axis):
                raise AttributeError(f"{axis.name} has no {self.name}: {axis.spec.device} cannot do that")
            return super().__get__(axis, owner)


class _Declare:
    """Say where it stands (rad, m), having seen it: from then on its position is reckoned from there.

    Nothing is sent. Raises RequestError for what is no finite number, or while it moves. An axis whose device measures
    its position does not have it.
    """

    def __get__(self, axis: Any, owner: type) -> Any:
        if axis is None:
            return self
        if axis.reckoning is None:
            raise AttributeError(f"{axis.name} has no declare: {axis.spec.device} measures where it is")
        return axis._declare


class AxisVerbs:
    """What an axis can do, blocking or async. Positions are in rad (m on a linear axis).

    `name` and `spec` are those of the machine file, `able` is what its device can do, `model` what that is. `engaged`
    is true once it was given torque or moved from here, until it is let go: then its exit policy counts. `under_way`
    is true from the beginning of a movement until that has come to its end; of what its device was ordered by itself
    nobody tells that, so it is until a stop was accepted. `reckoning` is there where the device does not tell where
    it is. `orders` counts what it was told from here, to move, to hold, to stop or to let go: by that whoever leads
    it sees whether somebody else has told it something since. `track` judges what is told of its position from here
    (rad of the device); the guard at the gate of its bus judges by what the bus has heard.
    """

    def __init__(self, bus: Any, name: str, spec: AxisSpec, device: Any, able: AxisDriver) -> None:
        self.bus = bus
        self.name = name
        self.spec = spec
        self.device = device
        self.model = ""
        self.engaged = False
        self.under_way = False
        self.orders = 0
        self._movement: Movement | None = None
        self.track = Track()
        self.restarts = RestartDetector()
        self.recognised(able)

    def recognised(self, able: AxisDriver, model: str = "") -> None:
        """It is known now what its device can do, and which model it is."""
        self.able: AxisDriver = able
        self.model = model or self.model
        self.reckoning = Reckoning() if is_reckoned(able.names) else None

    # -- what costs no frame -------------------------------------------------------------------------------------------

    @property
    def capabilities(self) -> frozenset[str]:
        """The names of its verbs, and `feedback` where its device measures its position, else `estimated`."""
        verbs = {name for name, one in self._verbs().items() if one.there(self)}
        tells = (
            {FEEDBACK} if "position" in self.able else {ESTIMATED} if self.reckoning is not None else set()
        )
        return frozenset(verbs | tells)

    def _verbs(self) -> dict[str, ability[..., Any]]:
        """All that an axis may have."""
        kinds = [vars(kind) for kind in type(self).__mro__]
        return {name: one for kind in kinds for name, one in kind.items() if isinstance(one, ability)}

    def __dir__(self) -> list[str]:
        absent = {name for name, one in self._verbs().items() if not one.there(self)}
        if self.reckoning is None:
            absent.add("declare")
        return sorted(set(super().__dir__()) - absent)

    @property
    def estimated(self) -> float | None:
        """Where it is by dead reckoning (rad, m); None while that is not known, and on every axis that measures."""
        return None if self.reckoning is None else self.reckoning.position

    def _declare(self, position: float) -> None:
        assert self.reckoning is not None
        place = checked_place(self.name, position)
        if self._moved():
            raise _is_moving(self.name)
        if self.under_way:
            raise RequestError(
                f"{self.name}: nobody knows that it rests",
                expected="an axis at rest",
                cause="a movement of it did not come to its end, or its device was ordered to move by itself",
                advice="stop it first; nothing was sent",
            )
        self.orders += 1
        self.reckoning.declare(place)

    if TYPE_CHECKING:

        def declare(self, position: float) -> None:
            """See `_Declare`."""
    else:
        declare = _Declare()

    def __repr__(self) -> str:
        what = f" {self.model}" if self.model else ""
        where = f", {self._shown()}" if self.reckoning is not None else ""
        return f"<{type(self).__name__} {self.name} {self.spec.device}{what}{where}>"

    def _shown(self) -> str:
        assert self.reckoning is not None
        at = self.reckoning.position
        return f"position {self.reckoning}" if at is None else f"estimated at {self.spec.show(at)}"

    # -- what movements tell -------------------------------------------------------------------------------------------

    def departs(self, movement: Movement | None = None) -> None:
        """A movement begins from here; whoever says later how it ended gives it here, and back then.

        Where the position is reckoned it is not known until `arrives`. Raises as `refuse_under_way`.
        """
        self.refuse_under_way()
        restarts.expected(self)
        self.orders += 1
        begun = Movement(accounted=False) if movement is None else movement
        begun.engaged, begun.under_way = self.engaged, self.under_way
        if self.reckoning is not None:
            begun.place = (self.reckoning.position, self.reckoning.why)
        self._movement = begun
        self.engaged = self.under_way = True
        if self.reckoning is not None:
            begun.place = self.reckoning.depart()

    def refuse_under_way(self) -> None:
        """Raise RequestError while a movement of a reckoned axis goes on: nobody knows from where another would begin.

        Once the axis has accepted a stop the next one may begin, and nobody knows where it is then.
        """
        if self._moved() and self._movement is not None and not self._movement.stopped:
            raise _is_moving(self.name)

    def arrives(self, movement: Movement | None = None, place: Place | None = None) -> None:
        """The movement came to its end; a reckoned axis is at this `place` now."""
        if movement is None or movement is self._movement:
            if self.reckoning is not None and place is not None:
                self.reckoning.arrive(place)
            self.under_way = False
            self._movement = None

    def stays(self, movement: Movement | None = None) -> None:
        """The movement was refused before anything was sent: all is as it was."""
        before = self._movement
        if before is not None and movement in (None, before):
            if self.reckoning is not None:
                self.reckoning.arrive(before.place)
            self.engaged, self.under_way = before.engaged, before.under_way
            self._movement = None

    def fails(self, why: str, movement: Movement | None = None) -> None:
        """The movement ended otherwise: unless stopped it may go on, and nobody knows where a reckoned axis is."""
        if movement is None or movement is self._movement:
            if self.reckoning is not None:
                self.reckoning.forget(why)
            self.under_way = self.under_way and not (movement is not None and movement.stopped)
            self._movement = None

    def accepted_stop(self) -> None:
        """It accepted a stop. Whoever moves a reckoned axis says when that has come to its end."""
        if self._movement is not None and self._moved():
            self._movement.stopped = True
        else:
            self.under_way = False

    def _moved(self) -> bool:
        """Whether somebody moves it, and is going to say how far a reckoned axis went."""
        return self.reckoning is not None and self._movement is not None and self._movement.accounted


def _is_moving(name: str) -> RequestError:
    return RequestError(
        f"{name} is moving",
        expected="an axis at rest",
        cause="where it is is reckoned from the end of one movement to the end of the next",
        advice="wait for it, or stop it first; nothing was sent",
    )


# -- what it tells -------------------------------------------------------------------------------------------------


async def state(axis: AxisVerbs) -> State:
    """One sample of all it tells, in its direction: rad, rad/s (m, m/s on a linear axis), fraction, A, V, °C.

    One whose position no motor can have come to so quickly is asked for again; `quality` says what came of that. An
    axis that has torque from here is looked at for a restart of its device, not too often: see `Robot.faults`.
    """
    found, quality = await _judged(axis)
    if quality is Quality.SUSPECT:
        found, quality = await _judged(axis)
    await restarts.looked_after(axis, found.at)
    spec = axis.spec
    return found._replace(
        quality=quality,
        position=None if found.position is None else spec.from_device(found.position),
        velocity=None if found.velocity is None else spec.rate_from_device(found.velocity),
        load=None if found.load is None else found.load * spec.sign,
        current=None if found.current is None else found.current * spec.sign,
    )


async def _judged(axis: AxisVerbs) -> tuple[State, Quality]:
    found: State = await axis.able.state(axis.device)
    if found.position is None:
        return found, found.quality
    return found, axis.track.take(found.position, found.at).quality


async def position(axis: AxisVerbs) -> float:
    """Where it is, as its device measures it (rad, m).

    A place to which no motor can have come so quickly is told only where a second reading agrees: see `believed`.
    """
    angle = await believed(axis.track, lambda: axis.able.position(axis.device))
    return axis.spec.from_device(angle)


async def velocity(axis: AxisVerbs) -> float:
    """How fast it moves, as its device tells (rad/s, m/s)."""
    return axis.spec.rate_from_device(await axis.able.velocity(axis.device))


async def load(axis: AxisVerbs) -> float:
    """What it pushes with: a fraction of the most that its device can, in the direction of the axis."""
    found: float = await axis.able.load(axis.device)
    return found * axis.spec.sign


async def current(axis: AxisVerbs) -> float:
    """The current of its motor (A), in the direction of the axis where the device gives it a sign."""
    found: float = await axis.able.current(axis.device)
    return found * axis.spec.sign


async def voltage(axis: AxisVerbs) -> float:
    """The supply of its device (V)."""
    found: float = await axis.able.voltage(axis.device)
    return found


async def temperature(axis: AxisVerbs) -> float:
    """The temperature of its device (°C)."""
    found: float = await axis.able.temperature(axis.device)
    return found


# -- torque and rest -----------------------------------------------------------------------------------------------


async def enable_torque(axis: AxisVerbs) -> None:
    """Torque on without a jump; the cap of the machine file, where there is one, is set before.

    Raises as the device's own verb: LimitExceeded, with the servo limp, where it stands beyond its limits; Interrupted
    when somebody lets it go, stops it or moves it meanwhile: then no torque comes behind that; Refused while it is at
    fault; Faulted where it had torque from here and its device has not kept it.
    """
    restarts.check(axis)
    axis.orders += 1
    command = Command([axis])
    await restarts.unbroken(axis)
    command.check()
    restarts.expected(axis)
    axis.engaged = True
    try:
        await command.watched(_given_torque(axis))
    except MotorbusError as error:
        if (lost := command.lost()) is not None:
            raise lost from error
        raise
    restarts.armed(axis)


async def _given_torque(axis: AxisVerbs) -> None:
    await cap(axis)
    await axis.able.enable_torque(axis.device)


async def cap(axis: AxisVerbs) -> None:
    """Bound what its device pushes with, as the machine file says; nothing is sent where it says nothing."""
    spec = axis.spec
    if spec.torque is not None:
        await axis.able.cap_torque(axis.device, spec.torque)
    if spec.current is not None:
        await axis.able.cap_current(axis.device, spec.current)


async def disable_torque(axis: AxisVerbs) -> None:
    """Limp, whatever alarms there are. Raises as the device's own verb when nobody knows whether it is."""
    axis.orders = order = axis.orders + 1
    resting = Resting(axis)
    await axis.able.disable_torque(axis.device)
    resting.certain()
    if axis.orders == order:  # else somebody has told it something since, and may have given it torque
        axis.engaged = axis.under_way = False


async def stop(axis: AxisVerbs) -> Enum:
    """Decelerate and stay; gives what the device promises. Raises as the device's own verb when it did not accept."""
    axis.orders = order = axis.orders + 1
    resting = Resting(axis)
    promise: Enum = await axis.able.stop(axis.device)
    resting.certain()
    if axis.orders == order:  # else it is the next movement already, which this was not said to
        axis.accepted_stop()
    return promise


async def hold(axis: AxisVerbs) -> None:
    """Stay here, with torque: torque on without a jump where there is a switch for it, else a stop.

    Raises Faulted where its device does not keep that torque; else as `enable_torque` and `stop`.
    """
    if "enable_torque" in axis.able:
        await enable_torque(axis)
        axis.under_way = False
        await restarts.kept(axis)
    else:
        await stop(axis)
