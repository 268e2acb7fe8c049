"""What is guaranteed of a machine, and what is not: the same facts for people, for programs, and for the documentation.

Bounds are those of the machine file, what a device gives is what its family declares (`core.guarantees`), and what
holds for every machine stands here. Nothing is opened and nothing is asked: it is what may be relied on beforehand.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

from motorbus.core.guarantees import Guarantee, Guarantees, Level
from motorbus.motion.limits import shown_rate
from motorbus.motion.machine.model import VELOCITY
from motorbus.motion.moving.stream import USUAL
from motorbus.motion.safety.guard import LATE, NEAR
from motorbus.motion.safety.track import FRESH

if TYPE_CHECKING:
    from motorbus.core.family import Family
    from motorbus.motion.machine import AxisSpec, Machine

SCOPE: Final = (
    "motorbus is software on a host, over links to devices without a watchdog. It is not a safety function in the "
    "sense of ISO 13849 or IEC 61508. A hard-wired power cut is required wherever motion can hurt."
)
"""What is to be read first."""
NONE: Final = "none"
WHOLE: Final = "its move"


class Bounded(NamedTuple):
    """One axis as the gate bounds it, in words: `limits`, `step`, `velocity` ("none" where there is no bound).

    `left` is how far it may still go when its host dies while it is led ("its move": to the end of that), `exit` and
    `estop` what ends it otherwise. `guard` says whether load and heat end its movement, "on" or "none".
    """

    name: str
    device: str
    limits: str
    step: str
    velocity: str
    left: str
    exit: str
    estop: str
    guard: str


class Bus(NamedTuple):
    """What the devices of one bus give: `points` by what each is about; empty where their family does not say."""

    name: str
    address: str
    family: str
    axes: tuple[str, ...]
    points: Mapping[str, Guarantee]


class Assured(NamedTuple):
    """A machine: its axes, what its devices give by bus, and what holds for the whole of it."""

    axes: tuple[Bounded, ...]
    buses: tuple[Bus, ...]
    machine: Mapping[str, Guarantee]


def assured(machine: Machine, families: Mapping[str, Family]) -> Assured:
    """What is guaranteed of this machine, and what not. `families` by the names of its buses."""
    said = {bus: family.safety for bus, family in families.items()}
    axes = tuple(
        _bounded(name, spec, families[spec.bus], said[spec.bus]) for name, spec in machine.axes.items()
    )
    buses = tuple(
        Bus(name, bus.address, families[name].name, machine.axes_of(name), _points(said[name]))
        for name, bus in machine.buses.items()
        if machine.axes_of(name)
    )
    return Assured(axes, buses, MACHINE)


def _points(said: Guarantees | None) -> dict[str, Guarantee]:
    return {} if said is None else said.points()


def _bounded(name: str, spec: AxisSpec, family: Family, said: Guarantees | None) -> Bounded:
    stops = family.link.stops
    return Bounded(
        name,
        spec.device,
        _limits(spec, said),
        NONE if spec.max_step is None else spec.show(spec.max_step),
        shown_rate(spec, VELOCITY, spec.max_velocity),
        spec.show(spec.max_velocity / USUAL) if said is not None and said.led else WHOLE,
        spec.exit,
        spec.estop or (stops[0] if stops else "stop"),
        "on" if spec.guard and said is not None and said.strain.given is not Level.NO else NONE,
    )


def _limits(spec: AxisSpec, said: Guarantees | None) -> str:
    if spec.low is not None and spec.high is not None:
        low, unit = spec.show(spec.low).split(" ")
        return f"{float(low):g} to {float(spec.show(spec.high).split(' ')[0]):g} {unit}"
    return NONE if said is None or said.limits.given is Level.NO else "its device's"


def unbounded(found: Assured) -> list[str]:
    """What bounds some axes lack, each in a sentence, with what would set it where something can."""
    lacking = {
        "no limits of travel; low and high set them": [one.name for one in found.axes if one.limits == NONE],
        "one order may lead from one end to the other; max_step bounds it": [
            one.name for one in found.axes if one.step == NONE
        ],
        "neither load nor heat ends a movement": [one.name for one in found.axes if one.guard == NONE],
    }
    return [f"{', '.join(names)}: {what}" for what, names in lacking.items() if names]


MACHINE: Final[Mapping[str, Guarantee]] = {
    "one gate": Guarantee(
        Level.YES,
        "every order of this process passes it, raw ones and loops too: limits, step from the measured position, "
        "velocity, finite numbers. What is refused is not sent",
    ),
    "velocity": Guarantee(
        Level.PARTLY,
        "held by what is led and by orders that say one; an order without one runs at the device's own speed, and may "
        f"lead {LATE:g} s of its velocity and {NEAR:g} rad from where it is measured to be, no farther",
    ),
    "acceleration": Guarantee(
        Level.PARTLY,
        "held by moves, trajectories and loops that follow; a device that is ordered by itself has its own ramp",
    ),
    "stale positions": Guarantee(
        Level.YES,
        f"one older than {FRESH:g} s, or one that no motor can have come to, moves nothing; reckoned axes have none",
    ),
    "on connect": Guarantee(Level.YES, "opening, scanning and reading move nothing; torque on does not jump"),
    "endless motion": Guarantee(
        Level.PARTLY,
        "only while somebody attends, and stopped when he has ended or his lease is lost; but by the host alone",
    ),
    "all or nothing": Guarantee(
        Level.PARTLY,
        "a move of several axes is refused as a whole, or sent; what is lost on its way is not unsent",
    ),
    "exit policy": Guarantee(
        Level.PARTLY, "at the end, after an error, Ctrl-C, SIGTERM and a lost lease; not after SIGKILL"
    ),
    "emergency stop": Guarantee(
        Level.PARTLY,
        "on all buses at once, ahead of everything, latched; it needs this process alive, its interpreter, its cables",
    ),
    "the host dies": Guarantee(
        Level.NO,
        "SIGKILL, a crash, a power cut: nothing is sent any more, see each device for what it does then",
    ),
    "a cable breaks": Guarantee(
        Level.NO, "what cannot be reached cannot be stopped, and does as when the host dies"
    ),
    "several hosts": Guarantee(
        Level.NO,
        "a port has one owner on one computer; who else is on the wire is not seen, and passes no gate of ours",
    ),
}
"""What holds for every machine."""
