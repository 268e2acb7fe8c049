"""Find the port of an arm: the one whose joint the user swings by hand. Reads only."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Final

from motorbus import session
from motorbus.bus.blocking import Bus
from motorbus.core.steps import Sleep
from motorbus.errors import LinkError, MotorbusError, NoReply
from motorbus.families import feetech
from motorbus.setup.calibrate import RATE, Sweep, group_of, read_counts
from motorbus.setup.engine import Live, Note, Row, Steps
from motorbus.setup.presets import Preset

SWING: Final = 120  # counts to both sides: a bump or a drift goes to one side


def find_port(ports: list[str], preset: Preset) -> Steps[str]:
    """The port of the arm whose first joint is swung to both sides. Raises NoReply without an arm."""
    joint = preset.joints[0]
    with ExitStack() as stack:
        buses: dict[str, Bus] = {}
        for port in ports:
            try:
                bus = stack.enter_context(session.open(f"feetech:{port}"))
                if bus.run(feetech.scan((joint.id,))):
                    buses[port] = bus
            except MotorbusError as error:
                yield Note(f"{port}: {error.summary}", warning=not isinstance(error, LinkError))
        if not buses:
            raise NoReply(
                f"no servo with id {joint.id} answers on {', '.join(ports) or 'any port'}",
                advice="check the supply; `motorbus setup number` gives new servos their ids",
            )
        if len(buses) == 1:
            return next(iter(buses))
        return (yield from _swung(buses, preset))


def _swung(buses: dict[str, Bus], preset: Preset) -> Steps[str]:
    joint = preset.joints[0]
    groups = {port: group_of(bus, (joint,)) for port, bus in buses.items()}
    swings: dict[str, Sweep] = {}
    while True:
        for port, bus in buses.items():
            for count in read_counts(bus, groups[port]).values():
                swings.setdefault(port, Sweep(count)).take(count)
        for port, swing in swings.items():
            if min(swing.start - swing.low, swing.high - swing.start) >= SWING:
                yield Note(f"the arm is at {port}")
                return port
        rows = tuple(
            Row(port, (str(swing.low - swing.start), str(swing.high - swing.start)))
            for port, swing in swings.items()
        )
        text = f"swing {joint.name} of the arm to both sides by hand"
        yield Live(text, ("port", "left", "right"), rows)
        next(iter(buses.values())).run(Sleep(1 / RATE))
