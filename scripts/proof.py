"""What the coverage page says of a row is found out here: its own frames go to the simulated device and the decoder.

Nothing is taken from a list. Who reads a row and gets no answer, who writes one and sees nothing come of it, and whose
frames the decoder does not name, has no proof, and `scripts/coverage.py` then makes no page.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import motorbus
from motorbus.core.entry import Entry, Storage, Value
from motorbus.core.family import Family
from motorbus.core.operation import CanFrame, Data, Effect
from motorbus.errors import MotorbusError
from motorbus.link.can_log import parse_word
from motorbus.simulation.named import Simulation

PATIENCE: Final = 1.0
"""s in which a device must have answered."""
LATER: Final = 10.0
"""s on the simulator's clock when the frame itself is sent; what must come before it is long done."""


class Device(NamedTuple):
    """Simulated devices of a family: their ids, and the options that give them one register map."""

    family: Family
    ids: str
    options: Mapping[str, str]

    def made(self) -> Simulation:
        """New ones, in virtual time."""
        options: dict[str, Any] = dict(self.options)
        return motorbus.simulate(self.family.name, ids=self.ids, **options)


class Order(NamedTuple):
    """A command that does what reading and writing by name cannot; frames as people write them."""

    frames: tuple[str, ...]
    before: tuple[str, ...] = ()
    changes: str = ""
    restarts: bool = False


class Proof(NamedTuple):
    """What was seen: `simulator` is "answers" or "obeys: …", `decoder` "names it"; "" where nothing of it was."""

    simulator: str
    decoder: str


def by_name(device: Device, row: Entry) -> Proof:
    """Read it where it can be read, and write it where that moves nothing and is not refused by name."""
    with device.made() as simulation, motorbus.open(simulation.url) as bus:
        one = bus.family.devices.blocking(bus, min(simulation.simulator.nodes))
        try:
            met = bus.trace.subscribe()
            one.identify()
            seen = bus.trace.subscribe()
            _read_and_written(one, row)
        except MotorbusError:
            return Proof("", "")
        records = list(seen)
        asked = [record.data for record in records if record.direction == "tx"]
        told = [record.data for record in records if record.direction == "rx"]
        good = bool(asked) and bool(told) and not faults(bus.family, told)
        before = [record.data for record in met][: -len(records)]
        decoder = named(bus.family, asked, row.name, before) or labelled(bus.family, told, row.name)
        return Proof("answers" if good else "", decoder)


def _read_and_written(one: Any, row: Entry) -> None:
    value: Value = row.to_value(row.high)
    if row.readable:
        value = one.read(row.name)[row.name]
    plain = row.writable and not row.protected
    if plain and row.storage is Storage.RAM and row.effect is Effect.NONE:
        one.write(**{row.name: value})


def by_order(device: Device, row: Entry, order: Order) -> Proof:
    """Send the frames of its command, each to new devices; a reply, or what has changed after it, is the proof."""
    seen = {_obeyed(device, frame, order) for frame in order.frames}
    frames = [data_of(frame) for frame in order.frames]
    simulator = seen.pop() if len(seen) == 1 else ""
    return Proof(simulator, named(device.family, frames, row.name))


def _obeyed(device: Device, frame: str, order: Order) -> str:
    with device.made() as simulation:
        simulator = simulation.simulator
        shipped = _memory(simulator, order.changes)
        _heard(simulator, map(data_of, order.before), 0.0)
        before = shipped if order.restarts else _memory(simulator, order.changes)
        if told := _heard(simulator, [data_of(frame)], LATER):
            return "" if faults(device.family, told) else "answers"
        for node in list(simulator.nodes.values()) if order.restarts else []:
            node.power_cycle()
        if not order.changes or _memory(simulator, order.changes) == before:
            return ""
        return f"obeys: `{order.changes}`{' after a power cycle' if order.restarts else ''}"


def _memory(simulator: Any, name: str) -> list[int]:
    return [node.memory[name] for node in simulator.nodes.values()] if name else []


def _heard(simulator: Any, frames: Iterable[Data], at: float) -> list[Data]:
    for one in frames:
        simulator.receive(one, at)
    return [data for _, data in simulator.advance(at + PATIENCE)]


def data_of(text: str) -> Data:
    """A frame as people write it: 625#…, or bytes in hexadecimal."""
    return (parse_word(text) or b"") if "#" in text else bytes.fromhex(text)


def faults(family: Family, frames: Iterable[Data]) -> list[str]:
    """What the decoder finds wrong with these."""
    return [one.fault for data in frames for one in family.explain(_flat(data)) if one.fault]


def named(family: Family, frames: Iterable[Data], name: str, before: Iterable[Data] = ()) -> str:
    """What the decoder makes of a name: "names it", or "" where it is a word in the meaning of no part.

    Meanings only, for "id" is also what a field of many frames is called. `before` is what was said before each frame,
    such as who the device is, where what follows is to be understood by that.
    """
    context = b"".join(map(_flat, before))
    known = len(family.explain(context)) if context else 0
    explained = [one for data in frames for one in family.explain(context + _flat(data))[known:]]
    good = [one for one in explained if not one.fault]
    found = any(re.search(rf"\b{name}\b", part.meaning) for one in good for part in one.parts)
    return "names it" if found else ""


def labelled(family: Family, frames: Iterable[Data], name: str) -> str:
    """The same where a request names no row and its reply brings many: a part of the reply that is called so."""
    good = [one for data in frames for one in family.explain(_flat(data)) if not one.fault]
    return (
        "names it"
        if any(part.name == name and len(one.parts) > 9 for one in good for part in one.parts)
        else ""
    )


def _flat(data: Data) -> bytes:
    return data.flat() if isinstance(data, CanFrame) else data
