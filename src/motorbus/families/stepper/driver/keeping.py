"""Moving by an angle as long as others need, and beginning when they begin: what this controller can do for a pose.

It cannot be led. It makes a move by a profile of its own, which is said to it before; so the duration is agreed on
first, project 1 is edited for a move that takes so long, which needs a second or two on the line, and then everybody
waits until all are ready. The order leaves so much before the common start as it needs to be heard.

No position comes back. When it began is known from when the order left, and where it is from a model: all of it is
*estimated*.
"""

from __future__ import annotations

from fractions import Fraction
from math import tau
from typing import Final, NamedTuple, TypeVar

from motorbus.core.steps import Procedure, SetBitrate, Sleep, catch
from motorbus.core.timing import Timing, Turned
from motorbus.errors import MotorbusError, RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.driver import commands, goals
from motorbus.families.stepper.driver.borrowing import PROJECT, Accord, borrowed
from motorbus.families.stepper.driver.exchanges import timed
from motorbus.families.stepper.driver.jogging import grounded
from motorbus.families.stepper.driver.line import BITS, quiet_time
from motorbus.families.stepper.driver.node import Node
from motorbus.families.stepper.driver.pacing import (
    check,
    first_pulse,
    fitted,
    lasts,
    moved,
    nearest,
    quickest,
)
from motorbus.families.stepper.driver.reading import image, read_input
from motorbus.families.stepper.driver.turning import Watch, honest, longest, waited
from motorbus.families.stepper.table import Project, decode_image

T = TypeVar("T")

VERB: Final = "keep_time"
READS: Final = 2
"""How often something short is asked before, to know how fast the line is."""
DOUBTS: Final = 4
"""How often at most, where the bus has had to be quiet before each of them."""
HELD: Final = 0.02
"""s by which an acknowledgement may be late before it is taken for one of an order that left late."""
_INPUT: Final = 1
"""Which input is read for that; what it says is no matter."""


async def keep_time(
    node: Node, angle: float, timing: Timing, *, velocity: float, acceleration: float | None = None
) -> Turned:
    """Turn the motor by an angle (rad, forward positive) as long as others take, and begin with them.

    At most at `velocity` (rad/s, in whole RPM, not above it), and at most as steep as `acceleration` (rad/s²) in every
    reading of the controller's numbers, as far as these go: the number 1 is the gentlest, and from rest it jumps to the
    start frequency. None is the number of step 1. Journalled, alone on the bus and given back as `move_by`.

    First all is checked that can be, then it is agreed how long it takes, then project 1 is edited for a move that
    takes so long, or most nearly so long. Between slow speeds there are gaps, see `pacing`; and slower than about 0.7
    RPM it cannot be, so that a short way ends before the others do, as `Turned.duration` tells.

    The common start is its first pulse and the end its last; both are *estimated*, as is where the motor is meanwhile:
    with another reading of the ramp it takes longer. So it is waited for as long as the slowest reading says, then
    stopped. When this returns the motor has turned by `Turned.angle`, in whole pulses, unless steps were lost.

    An angle that is no pulse when it is rounded to whole ones is none to go: it begins and ends with the others, and
    nothing is sent that changes anything. So who is sent again to where it stands already holds nobody up.

    Raises RequestError, with nothing sent that changes anything and before anything is agreed, for an angle that is too
    far, a velocity below 1 RPM, an acceleration not above 0, and as `borrowed` for what it refuses;
    Interrupted when the others do not begin or somebody has said stop before, and project 1 is given back; all of
    these have moved nothing, and are `unmoved`. Interrupted when somebody stops it, OutcomeUnknown when the order was
    not acknowledged, and whatever else: where the motor stands is not known then. Once the others are asked they are
    told of each of these at once, before project 1 is given back.
    """
    check(angle, velocity, acceleration)
    watch = Watch(node)
    try:
        return await honest(watch, _kept(node, angle, timing, watch, velocity, acceleration))
    except _There:
        return await _told(timing, _stayed(node, timing))


async def _kept(
    node: Node, angle: float, timing: Timing, watch: Watch, velocity: float, acceleration: float | None
) -> Turned:
    tempo, true = Tempo(0.0, 0.0), Project()

    async def wanted(project: Project) -> Project:
        found = await grounded(node, project, VERB, 1)
        if not round(Fraction(abs(angle) / tau) * (found.pulses_per_turn or 0)):
            raise _There
        return quickest(found, angle, velocity, acceleration)

    async def settled(quick: Project) -> Project:
        nonlocal true
        true = quick
        await _on_guard(node, quick, watch)
        seconds = await timing.agreed(lasts(quick), lambda others: lasts(fitted(quick, others)))
        watch.check_before()
        return nearest(quick, seconds)

    async def ready(project: Project) -> None:
        nonlocal tempo
        tempo = await _tempo(node)
        watch.check_before()
        await timing.start(tempo.hears + first_pulse(project))

    async def motion(project: Project) -> Turned:
        return await _turned(node, project, true, watch, tempo)

    def told(work: Procedure[T]) -> Procedure[T]:
        return _told(timing, honest(watch, work))

    accord = Accord(lambda quick: told(settled(quick)), lambda project: told(ready(project)))
    return await borrowed(node, VERB, wanted, lambda project: told(motion(project)), accord=accord)


async def _told(timing: Timing, work: Procedure[T]) -> T:
    """Let the others know at once when it fails: giving project 1 back takes seconds, and they would move on."""
    try:
        return await work
    except BaseException as error:
        timing.fails(error)
        raise


class _There(RequestError):
    """It is where it is to go."""

    def __init__(self) -> None:
        super().__init__("this is no way to go")


async def _stayed(node: Node, timing: Timing) -> Turned:
    """It takes part and does not move."""
    await timing.agreed(0.0, lambda others: others)
    return Turned(node.node, 0.0, await timing.start(0.0), 0.0, lambda _: 0.0)


async def shortest(node: Node, angle: float, *, velocity: float, acceleration: float | None = None) -> float:
    """s that `keep_time` would take at least for this, *estimated*: project 1 is read, and nothing is written.

    Raises RequestError for what `keep_time` refuses of these numbers and of project 1; and as `dump`.
    """
    check(angle, velocity, acceleration)
    project = decode_image(await image(node, PROJECT), node.order)
    return lasts(quickest(await grounded(node, project, VERB, 1), angle, velocity, acceleration))


async def _on_guard(node: Node, project: Project, watch: Watch) -> None:
    """From here on every stop that leaves counts, also one of an emergency that is over when the order would leave.

    Only what moves may ask how many stops have left; so this is an order that never leaves.
    """
    told = await catch(commands.motion(node, "run_once", goals.of_move(node, project), watch.look))
    if isinstance(told, MotorbusError) and told is not watch.looked:
        raise told


class Tempo(NamedTuple):
    """How fast this line is: `hears` s from handing an order over to its being heard, `answers` s to its answer."""

    hears: float
    answers: float

    def heard(self, left: float, answered: float) -> float:
        """When an order was heard (s on the link's clock) that was handed over and answered then.

        One whose answer comes late has left late, behind a question of the bus. Nobody knows how late a line is that
        answers late; so that little is put down to the answer.
        """
        if answered - left > self.answers + HELD:
            return answered - (self.answers - self.hears)
        return left + self.hears


async def _tempo(node: Node) -> Tempo:
    """As it is now. Where an answer is there before it can be, bytes take no time: a socket, or no line at all.

    That a motion begins when the last byte of its order was heard is an assumption; an answer takes as much longer as
    the controller thinks, which on a line where the bus is quiet before each question nobody can tell.
    """
    rate = await SetBitrate(0)
    answers: list[float] = []
    while len(answers) < READS or (min(answers) > quiet_time(rate) and len(answers) < DOUBTS):
        left = await Sleep(0)
        answers.append(await timed(read_input(node, _INPUT)) - left)
    byte, quickest = BITS / rate, min(answers)
    air = byte * (wire.REQUEST_LENGTH + wire.REPLY_LENGTH)
    if quickest < air:
        return Tempo(0.0, quickest)
    return Tempo(byte * wire.REQUEST_LENGTH, quickest if quickest <= quiet_time(rate) else air)


async def _turned(node: Node, project: Project, true: Project, watch: Watch, tempo: Tempo) -> Turned:
    """The order, and the wait until the motion is over by the slowest reading; who calls it says stop.

    What `project` says of angles may be of another motor, see `pacing`; the `true` one has as many pulses.
    """
    move, sign = moved(project), project.step(1).sign
    pulse = tau / float(true.pulses_per_turn or 1)
    left = await Sleep(0)
    answered = await timed(commands.motion(node, "run_once", goals.of_move(node, true), watch.refusal))
    await waited(watch, longest(project, move.pulses), "moving")
    first = move.moment(1)

    def way(seconds: float) -> float:
        return sign * pulse * move.done(first + seconds) if seconds >= 0 else 0.0

    whole = sign * pulse * (move.pulses or 0)
    return Turned(node.node, whole, tempo.heard(left, answered) + first, lasts(project), way)
