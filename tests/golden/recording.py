"""Replay one command on a simulated bus and record it: frames on the wire and a plain form of its result.

`record` is the only function that knows how the bytes of a bus are observed.
"""

from __future__ import annotations

import dataclasses
import inspect
import json
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from enum import Enum
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

import motorbus
from motorbus import MotorbusError
from motorbus.core.family import State

FOLDER = Path(__file__).parent
DEVICE = {"feetech": "Servo", "kst": "Servo", "stepper": "Controller"}
"""Family -> its public device class."""
CLOCK = ("at", "rounds")
"""Result fields that hold a moment or a count of polls; they depend on timing and are left out."""

Frames = list[list[Any]]


class Call(NamedTuple):
    """A device command `name`; with `on="family"` a function of the family that is run on the bus; with `on="group"` a
    method of a group of all devices, called with `args`, and its result with `kwargs["values"]`."""

    name: str
    args: tuple[Any, ...] = ()
    kwargs: Mapping[str, Any] = {}
    on: str = "device"


class Case(NamedTuple):
    """One trace: `call` on a new simulated bus after `before`. `variant` is the register map or the profile.

    `power_cycle`  the device is power-cycled when the command asks for it
    `lanes`        several CAN nodes are in flight at once, so frames are compared node by node
    `timed`        further result fields that depend on timing
    `polls`        how often a request is repeated depends on timing
    `keep`         which frames are recorded: "all"; "requests", where reports arrive in between; "none"
    """

    family: str
    variant: str
    call: Call
    label: str = ""
    before: tuple[Call, ...] = ()
    ids: tuple[int, ...] = (1,)
    options: Mapping[str, Any] = {}
    power_cycle: bool = False
    lanes: bool = False
    timed: tuple[str, ...] = ()
    polls: bool = False
    keep: str = "all"

    @property
    def id(self) -> str:
        return "/".join(filter(None, (self.family, self.variant, self.call.name, self.label)))


class Argument(NamedTuple):
    """An argument that exists only on an open bus: `make` gets the bench."""

    make: Callable[[Bench], Any]


class Bench:
    """The bus of one case, with a device object for each id."""

    def __init__(self, family: Any, bus: Any, simulation: Any, devices: dict[int, Any]) -> None:
        self.family = family
        self.bus = bus
        self.simulation = simulation
        self.devices = devices

    def run(self, call: Call) -> Any:
        args = [self._made(value) for value in call.args]
        kwargs = {name: self._made(value) for name, value in call.kwargs.items()}
        if call.on == "group":
            made = getattr(self.family.ServoGroup(list(self.devices.values())), call.name)
            made = made(*args) if args else made
            return self.bus.run(made(kwargs["values"]) if kwargs else made)
        if call.on == "family":
            return self.bus.run(getattr(self.family, call.name)(*args, **kwargs))
        return getattr(next(iter(self.devices.values())), call.name)(*args, **kwargs)

    def _made(self, value: Any) -> Any:
        return value.make(self) if isinstance(value, Argument) else value


@contextmanager
def bench(case: Case) -> Iterator[Bench]:
    """A simulated bus in virtual time, opened, with nothing else sent."""
    family = getattr(motorbus, case.family)
    kind = getattr(family, DEVICE[case.family])
    made: list[Bench] = []

    def report(event: object) -> None:
        if case.power_cycle and type(event).__name__ == "PowerCycleNeeded":
            made[0].simulation[case.ids[0]].power_cycle()

    with (
        motorbus.simulate(case.family, ids=case.ids, **case.options) as simulation,
        motorbus.open(simulation.url, report=report) as bus,
    ):
        if case.family == "kst":
            for node in case.ids:  # an option of the other simulators
                simulation[node].raw_position = simulation[node].values["goal_position"] = 50
        made.append(Bench(family, bus, simulation, {node: kind(bus, node) for node in case.ids}))
        yield made[0]


@contextmanager
def record(bus: Any) -> Iterator[Frames]:
    """Fill a list with `[">", request]` and `["<", reply]`, in order. The seam to the bus: its public trace."""
    frames: Frames = []
    subscription = bus.trace.subscribe(limit=1_000_000)
    try:
        yield frames
    finally:
        bus.trace.unsubscribe(subscription)
        for record in subscription:
            way = ">" if record.direction == "tx" else "<"
            data = record.data
            if isinstance(data, bytes) and way == "<" and frames and frames[-1][0] == "<":
                frames[-1][1] += data.hex()  # a port may deliver a reply in pieces
            else:
                frames.append([way, data.hex() if isinstance(data, bytes) else _can(data)])


def trace(case: Case) -> dict[str, Any]:
    """Replay a case: its id, its frames, its result."""
    with bench(case) as there:
        for call in case.before:
            with suppress(MotorbusError):  # a device that cannot be prepared so refuses the command too
                there.run(call)
        with record(there.bus) as frames:
            try:
                result = plain(there.run(case.call), (*CLOCK, *case.timed))
            except MotorbusError as error:
                result = plain(error)
    if case.lanes:
        frames = sorted(frames, key=lambda frame: int(frame[1].partition("#")[0], 16) & 0x7F)
    if case.keep != "all":
        frames = [frame for frame in frames if frame[0] == ">" and case.keep == "requests"]
    return {"id": case.id, "frames": collapsed(frames, timed=case.polls), "result": result}


def load(family: str) -> dict[str, dict[str, Any]]:
    """The recorded traces of a family by id."""
    lines = (FOLDER / f"{family}.jsonl").read_text(encoding="utf-8").splitlines()
    return {one["id"]: one for one in map(json.loads, lines)}


def write(family: str, cases: Sequence[Case]) -> int:
    """Record every case of a family; give how many."""
    traces = [trace(case) for case in cases if case.family == family]
    lines = [json.dumps(one, ensure_ascii=False, separators=(",", ":")) + "\n" for one in traces]
    (FOLDER / f"{family}.jsonl").write_text("".join(lines), encoding="utf-8")
    return len(traces)


def plain(value: Any, without: Sequence[str] = ()) -> Any:
    """A result as JSON: records by field names, enum members by name, floats with 9 digits, errors by type.

    Prose (text of several words) becomes "<text>": its wording is not part of a trace.
    """
    if isinstance(value, BaseException):
        return {"error": type(value).__name__}
    if isinstance(value, Enum):
        return value.name.lower()
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, Real):
        return float(f"{float(value):.9g}")
    if isinstance(value, str):
        return "<text>" if " " in value else value
    if isinstance(value, bytes | bytearray):
        return value.hex()
    if isinstance(value, Mapping):
        return {str(key): plain(held, without) for key, held in value.items()}
    names = field_names(value)
    if names is not None and {"name", "address", "size"} <= set(names):
        return value.name  # a register
    if names is not None:
        return {name: plain(getattr(value, name), without) for name in names if name not in without}
    if isinstance(value, Set):
        return sorted(plain(held, without) for held in value)
    if isinstance(value, Sequence):
        return [plain(held, without) for held in value]
    raise TypeError(f"no plain form of {type(value).__name__}")


def field_names(value: Any) -> Sequence[str] | None:
    """The fields of a record: a named tuple, a dataclass or a Struct; None for any other value."""
    if dataclasses.is_dataclass(value):
        return [field.name for field in dataclasses.fields(value)]
    fields: Sequence[str] | None = getattr(value, "_fields", None) or getattr(
        value, "__struct_fields__", None
    )
    if isinstance(value, State) and not value.refused:
        return [name for name in State._fields if name != "refused"]
    return fields


def collapsed(frames: Frames, *, timed: bool = False) -> Frames:
    """Replace requests that are sent again and again, alone or in turn.

    `["times", n, request, reply, …]` where every reply is the same; `["polls", request, …]` where replies differ, as
    then the number depends on timing, and everywhere if `timed`.
    """
    blocks: list[Frames] = []
    for frame in frames:
        if frame[0] == ">" or not blocks:
            blocks.append([])
        blocks[-1].append(frame)
    found: Frames = []
    while blocks:
        period, count = max(
            ((period, _repeated(blocks, period)) for period in (1, 2, 4)),
            key=lambda one: (one[0] * one[1] if one[1] > 1 else 0, -one[0]),
        )
        if count == 1:
            found += blocks.pop(0)
            continue
        first, run = blocks[:period], blocks[: period * count]
        del blocks[: period * count]
        if run == first * count and not timed:
            found.append(["times", count, *(way + data for block in first for way, data in block)])
            continue
        found.append(["polls", *(way + data for (way, data), *_ in first)])
        for (request, *_), block in zip(
            first, blocks[:period], strict=False
        ):  # the last turn may be incomplete
            if block[0] != request:
                break
            del blocks[0]
    return found


def _repeated(blocks: list[Frames], period: int) -> int:
    """How often the first `period` requests are sent in a row; four requests only with the same replies."""

    def part(count: int) -> list[Any]:
        found: list[Any] = blocks[period * count : period * (count + 1)]
        return found if period > 2 else [block[0] for block in found]

    count = 1
    while part(count) == part(0):
        count += 1
    return count


def _can(frame: Any) -> str:
    """A CAN frame as `id#data`, the id with 3 digits, or 8 where it has 29 bits."""
    return f"{frame.id:0{8 if frame.extended else 3}x}#{frame.data.hex()}"


def public_commands(device: type) -> list[str]:
    """The public methods of a device class by name: what is no property and no type."""
    names = [name for name in dir(device) if not name.startswith("_")]
    return [name for name in names if not isinstance(inspect.getattr_static(device, name), property | type)]


def public_functions(family: Any) -> list[str]:
    """The public functions of a family module by name."""
    return [name for name in family.__all__ if inspect.isfunction(getattr(family, name))]


def difference(expected: Mapping[str, Any], found: Mapping[str, Any]) -> str:
    """The first difference of two traces in words; "" where they are equal."""
    for number, (old, new) in enumerate(zip(expected["frames"], found["frames"], strict=False)):
        if old != new:
            return f"entry {number} of the frames: recorded {old}, now {new}"
    old, new = expected["frames"], found["frames"]
    if len(old) != len(new):
        more, what = (old, "missing now") if len(old) > len(new) else (new, "new")
        return f"entry {min(len(old), len(new))} of the frames is {what}: {more[min(len(old), len(new))]}"
    if expected["result"] != found["result"]:
        return f"the result: recorded {expected['result']}, now {found['result']}"
    return ""
