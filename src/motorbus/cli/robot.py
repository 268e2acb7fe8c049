"""The machine of a command, open: its axes by name, what it reports as a bar, and what becomes of them at the end.

A command is one step of somebody's work, not the end of it. So when it has done what it was told, its axes stay as it
left them. When it ends in any other way, each axis ends as its `exit` in the machine file says; that is told.
"""

from __future__ import annotations

from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Any, cast

from msgspec import structs

from motorbus import families
from motorbus.cli import dry, faces
from motorbus.cli.exits import Unforeseeable
from motorbus.cli.machine import machine
from motorbus.cli.output import Bar
from motorbus.cli.target import face, said
from motorbus.cli.traced import traced
from motorbus.cli.wording import in_words_of_the_shell, shell_words
from motorbus.core.steps import Progress
from motorbus.errors import MotorbusError, RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output
    from motorbus.motion.clamping import Clamped
    from motorbus.motion.machine import Machine
    from motorbus.session.robot import Robot


class InHand:
    """An open `robot`, and where its events go."""

    def __init__(self, output: Output) -> None:
        self.output = output
        self.robot: Robot
        self._bar = Bar()

    @contextmanager
    def working(self, what: str) -> Iterator[None]:
        """Show a bar of this name while the robot works."""
        with self.output.progress(what) as self._bar:
            try:
                yield
            finally:
                self._bar = Bar()

    def heard(self, event: object) -> None:
        """An event of an operation on any of the buses."""
        if isinstance(event, Progress):
            self._bar.advance(event.done, event.total, event.what)
            return
        from motorbus.motion.clamping import Clamped

        if isinstance(event, Clamped):
            self.output.note(_clamped(event))
            return
        for family in (
            {bus.family.name for bus in self.robot.buses.values()} if hasattr(self, "robot") else ()
        ):
            say = faces.offer(family, "say")
            if say is not None and (text := say(event)):
                self.output.note(f"note: {text}")
                return


def _clamped(event: Clamped) -> str:
    """That an axis does not go where it was to go, and why."""
    spec = machine().axes[event.axis]
    why = {"limits": "its limits", "step": "max_step", "velocity": "max_velocity"}[event.reason]
    return (
        f"note: {event.axis} goes to {spec.show(event.given)} instead of {spec.show(event.asked)}, for {why}"
    )


def place(robot: Robot, name: str, at: float | None) -> str:
    """A position as people see this axis, and the word where it is none that was measured."""
    if at is None:
        return "a place that is not known"
    return robot.machine.axes[name].show(at) + (" (estimated)" if robot[name].estimated is not None else "")


@contextmanager
def robot(axes: Sequence[str], options: Mapping[str, str], output: Output) -> Iterator[InHand]:
    """These axes of the machine file, open; their buses with `options` beside those in the file.

    Raises RequestError for what is wrong with file or options, and what opening raises.
    """
    from motorbus.cli.left import opened

    wanted = with_options(machine(), axes, options)
    hand = InHand(output)
    try:
        with ExitStack() as told, opened(wanted, axes, output, report=hand.heard) as hand.robot:
            output.simulated = output.simulated or hand.robot.simulated
            for warning in hand.robot.warnings:
                output.note(f"note: {shell_words(warning, bus=warning.partition(':')[0])}")
            for bus in hand.robot.buses.values():
                told.enter_context(traced(bus))
            yield hand
            for axis in hand.robot.axes.values():
                axis.engaged = False
    except (MotorbusError, KeyboardInterrupt) as error:
        meant = _bus_meant(hand, wanted, axes)
        for family in {bus.address.partition(":")[0] for bus in wanted.buses.values()}:
            in_words_of_the_shell(error, families.load(family), meant)
        raise


def _bus_meant(hand: InHand, wanted: Machine, axes: Iterable[str]) -> str:
    """The bus that an error is about: the one where something is unfinished, or the only one; "" where nobody knows."""
    from motorbus.session import unfinished

    there = hand.robot.buses if hasattr(hand, "robot") else {}
    cut_off: list[str] = []
    with suppress(RequestError):  # a journal of a later version
        cut_off += [name for name, bus in there.items() if unfinished(cast("Bus", bus)) is not None]
    used = cut_off or list({wanted.axes[name].bus for name in axes})
    return used[0] if len(used) == 1 else ""


def with_options(known: Machine, axes: Sequence[str], options: Mapping[str, str]) -> Machine:
    """The machine with options of flags in the addresses of the buses that these axes need: a flag before the file.

    Raises RequestError for an option that such a bus does not have.
    """
    from motorbus.session import parse_address, prepare

    if not options:
        return known
    buses = dict(known.buses)
    for name in {known.axes[axis].bus for axis in axes}:
        spot = parse_address(buses[name].address)
        address = spot._replace(options={**spot.options, **said(options)}).bus
        prepare(address, {})
        buses[name] = structs.replace(buses[name], address=address)
    found = structs.replace(known, buses=buses)
    found.__dict__["file"] = known.file  # a copy of a machine is of no file, and this one still is
    return found


def rehearse(hand: InHand, names: Iterable[str], do: Callable[[Any], object], *, show: bool = True) -> None:
    """Do something to these axes on buses that carry questions only; show what was withheld, frame by frame.

    Raises what doing it would be refused for.
    """
    for bus_name, bus in hand.robot.buses.items():
        rehearsal = dry.DryBus(cast("Bus", bus))
        for name in names:
            axis = hand.robot[name]
            if axis.spec.bus != bus_name:
                continue
            carrier = rehearsal.apart()
            one = type(axis)(carrier, name, axis.spec, face(carrier, axis.spec.node), axis.able)
            try:
                do(one)
            except Unforeseeable as error:
                if show:
                    hand.output.note(f"note: {error.summary}; what is shown is as far as it can be foreseen")
        if show:
            dry.show(rehearsal, hand.output)


def able(hand: InHand, axis: str, verb: str) -> Any:
    """A verb of an axis. Raises RequestError when its device lacks it."""
    found = getattr(hand.robot[axis], verb, None)
    if found is None:
        what = "torque switch" if verb.endswith("able_torque") else verb.replace("_", " ")
        raise RequestError(
            f"{axis}: {hand.robot.machine.axes[axis].device} has no {what}", advice="nothing was sent"
        )
    return found
