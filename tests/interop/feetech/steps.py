"""Calls of a library, what they must return, and what the servo must hold afterwards."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, TypeAlias

from tests.interop.feetech.peer import Peer, PeerError
from tests.interop.feetech.twin import IDS, Twin

TRIES: Final = 20


class Held(NamedTuple):
    """What the servo holds at this moment: a number of `size` bytes, or `each` of them."""

    node: int
    address: int
    size: int = 2
    each: bool = False


class Through(NamedTuple):
    """Such a number, converted."""

    convert: Callable[[Any], Any]
    held: Held


class Raised(NamedTuple):
    """An exception with these words in it."""

    words: str


Memory: TypeAlias = Mapping[tuple[int, int], "list[int] | Held"]
"""(id, address) -> the bytes from there on; `Held`: those before the calls."""


class Call(NamedTuple):
    """One call of a library: of what it keeps under `owner`, or of its class or module of that name."""

    owner: str
    name: str
    arguments: tuple[Any, ...]
    gives: Any = None


@dataclass(frozen=True)
class Step:
    """Calls that belong together, on servos fresh from power-up.

    `before` and `after`  the memory before, and afterwards
    `orders`              for the simulator's control socket before the calls, as "unplug 2"
    `status`              of servo 1 in the simulator afterwards
    """

    calls: tuple[Call, ...]
    before: Memory = field(default_factory=dict)
    after: Memory = field(default_factory=dict)
    orders: tuple[str, ...] = ()
    status: Mapping[str, Any] = field(default_factory=dict)


def carry_out(step: Step, peer: Peer, twin: Twin) -> None:
    """Run a step, several times on a busy machine. Raises AssertionError with all that differs."""
    for _ in range(TRIES):
        twin.fresh()
        wrong = _differences(step, peer, twin)
        if not wrong:
            return
        twin.drain()
    raise AssertionError("\n".join([str(step.calls), *wrong]))


def _differences(step: Step, peer: Peer, twin: Twin) -> list[str]:
    for (node, address), data in step.before.items():
        twin.write(node, address, _resolved(data, twin))
    for order in step.orders:
        twin.order(order)
    # Before the calls: an own read would take replies away.
    wanted = [_resolved(call.gives, twin) for call in step.calls]
    after = {where: _resolved(data, twin) for where, data in step.after.items()}
    wrong = []
    for call, value in zip(step.calls, wanted, strict=True):
        try:
            gave = peer.call(call.owner, call.name, *call.arguments)
        except PeerError as error:
            gave = Raised(str(error))
        if not agrees(gave, value):
            wrong.append(f"{call.name}{call.arguments} gave {gave!r}, not {value!r}")
    if step.status:
        twin.alarm(max(IDS))  # all writes have arrived when this servo has answered
        status = twin.status()[1]
        wrong += [f"{name}: {status[name]!r}" for name, value in step.status.items() if status[name] != value]
    for (node, address), data in after.items():
        found = twin.read(node, address, len(data))
        if found != data:
            wrong.append(f"{node} holds {found} at {address}, not {data}")
    return wrong


def _resolved(value: Any, twin: Twin) -> Any:
    if isinstance(value, Held):
        data = twin.read(value.node, value.address, value.size)
        if value.each:
            return data
        return twin.kinds[0].number_of(data) if value.size == 2 else data[0]
    if isinstance(value, Through):
        return value.convert(_resolved(value.held, twin))
    if isinstance(value, list):
        return [_resolved(one, twin) for one in value]
    return value


def agrees(gave: Any, wanted: Any) -> bool:
    """Whether this is what was wanted; floats nearly so."""
    if isinstance(wanted, Raised):
        return isinstance(gave, Raised) and wanted.words in gave.words
    if isinstance(wanted, list) and isinstance(gave, list):
        return len(gave) == len(wanted) and all(map(agrees, gave, wanted))
    if isinstance(wanted, float):
        return isinstance(gave, float | int) and math.isclose(gave, wanted, rel_tol=1e-6, abs_tol=1e-9)
    return type(gave) is type(wanted) and bool(gave == wanted)
