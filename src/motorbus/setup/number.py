"""Give each servo of an arm its id, one servo on the bus at a time.

Nothing is stored beside the servos: a servo that has the id of its joint is done, so an interrupted run continues by a
fresh look at the bus.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from motorbus.bus.blocking import Bus
from motorbus.core.family import Found
from motorbus.core.steps import SetBitrate
from motorbus.errors import MotorbusError
from motorbus.families import feetech
from motorbus.setup.engine import Note, Steps, ask
from motorbus.setup.presets import Joint, Preset

TRIES: Final = 3  # scans for a servo that is silent; a busy computer may miss a reply
IDS: Final = tuple(range(1, 21))  # where new servos and those of an arm are
FACTORY_RATES: Final = (1_000_000, 115_200, 500_000)  # bit/s: STS and HLS, SMS, some SCS


def number(bus: Bus, preset: Preset) -> Steps[tuple[int, ...]]:
    """Number the servos of an arm; gives the ids that were set. The servo of the highest id comes first."""
    if len(present(bus, preset)) == len(preset.joints):
        yield Note(f"all {len(preset.joints)} servos of the {preset.name} have their ids")
        return ()
    done: list[int] = []
    for joint in sorted(preset.joints, key=lambda joint: -joint.id):
        if (yield from number_one(bus, preset, joint, done)):
            done.append(joint.id)
    return tuple(done)


def present(bus: Bus, preset: Preset) -> set[int]:
    """The ids of the preset that answer at its rate; a silent one is asked three times."""
    found: set[int] = set()
    for _ in range(TRIES):
        if silent := [joint.id for joint in preset.joints if joint.id not in found]:
            found |= {one.node for one in bus.run(feetech.scan(silent))}
    return found


def number_one(bus: Bus, preset: Preset, joint: Joint, done: Iterable[int] = ()) -> Steps[bool]:
    """Give the one new servo on the bus the id of this joint, and its settings; False if the user skips it.

    `done` are the ids of servos that may stay connected.
    """
    text = f"connect the servo of {joint.name} alone, for id {joint.id}"
    while (yield from ask(text, "go", "skip")) == "go":
        found = [one for one in _search(bus, preset) if one.node == joint.id or one.node not in done]
        if problem := _judge(found, joint):
            yield Note(problem, warning=True)
            continue
        try:
            yield from _configure(bus, preset, joint, found[0])
        except MotorbusError as error:
            yield Note(f"{joint.name}: {error}", warning=True)
            continue
        return True
    return False


def _search(bus: Bus, preset: Preset) -> list[Found]:
    rates = tuple(dict.fromkeys((preset.rate, *FACTORY_RATES)))
    for rate in rates:
        if found := bus.run(feetech.scan(IDS, (rate,))):
            return found
    return []


def _judge(found: list[Found], joint: Joint) -> str:
    """Why the servo of this joint cannot be numbered now; "" if it can."""
    if not found:
        return "no servo answers: check its supply and its cable, then press Enter"
    if len(found) > 1:
        ids = ", ".join(str(one.node) for one in found)
        return f"{len(found)} servos answer, with the ids {ids}: connect the servo of {joint.name} alone"
    return ""


def _configure(bus: Bus, preset: Preset, joint: Joint, found: Found) -> Steps[None]:
    rate = bus.rate
    bus.run(SetBitrate(found.rate))
    try:
        servo = feetech.Servo(bus, found.node)
        if found.node != joint.id:
            servo.set_id(joint.id)
            servo = feetech.Servo(bus, joint.id)
        if found.rate != preset.rate:
            servo.set_baud(preset.rate)
            bus.run(SetBitrate(preset.rate))
            servo = feetech.Servo(bus, joint.id)
        settings: dict[str, Any] = {**preset.settings, **joint.settings}
        servo.write(**settings)
    finally:
        bus.run(SetBitrate(rate))
    was = f"was id {found.node}" if found.node != joint.id else "had it already"
    yield Note(f"{joint.name} is id {joint.id} ({was})")
