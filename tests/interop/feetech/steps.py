"""What a session consists of: calls with what they must give, and what the servo must hold afterwards.

`why` names the way in which the library differs from motorbus or the device; without it all agree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, TypeAlias

from tests.interop.feetech.peer import Peer, PeerError
from tests.interop.feetech.twin import IDS, Twin


class Held(NamedTuple):
    """Stands for what the servo holds at this moment, whatever it is: a number of `size` bytes, or `each` of them."""

    node: int
    address: int
    size: int = 2
    each: bool = False


Memory: TypeAlias = Mapping[tuple[int, int], "list[int] | Held"]
"""(id, address) -> the bytes from there on; `Held`: those that are there before the calls."""


class Through(NamedTuple):
    """Stands for what such a number becomes in the units of the library."""

    convert: Callable[[Any], Any]
    held: Held
    words: str = "held"


class Raised(NamedTuple):
    """Stands for an exception with these words in it."""

    words: str


class Anything(NamedTuple):
    """Stands for what cannot be foreseen, such as the time; `what` says it."""

    what: str


class Call(NamedTuple):
    """One call of a library: of what it keeps under `owner`, or of its class or module of that name."""

    owner: str
    name: str
    arguments: tuple[Any, ...]
    gives: Any = None


@dataclass(frozen=True)
class Step:
    """Calls that belong together, on servos fresh from power-up.

    `before` and `after`  what is put into the memory before, and what must be in it afterwards
    `orders`              for the simulator's control socket before the calls, as "unplug 2"
    `status`              what the simulator must say of the servo `of` afterwards
    `lasting`             it changes what no power cycle brings back, so it is done once only
    """

    calls: tuple[Call, ...]
    before: Memory = field(default_factory=dict)
    after: Memory = field(default_factory=dict)
    why: str = ""
    orders: tuple[str, ...] = ()
    status: Mapping[str, Any] = field(default_factory=dict)
    of: int = 1
    lasting: bool = False


TRIES: Final = 20


def carry_out(step: Step, peer: Peer, twin: Twin) -> None:
    """Run it and judge it. Again, a few times: a busy machine may wake the simulator later than a library waits.

    Raises AssertionError with what was not as it must be.
    """
    for _ in range(1 if step.lasting else TRIES):
        twin.fresh()
        wrong = _wrong(step, peer, twin)
        if not wrong:
            return
        twin.hush()
    raise AssertionError("\n".join([_shown(step), *wrong]))


def _wrong(step: Step, peer: Peer, twin: Twin) -> list[str]:
    for (node, address), data in step.before.items():
        twin.write(node, address, _resolved(data, twin))
    for order in step.orders:
        twin.order(order)
    wanted = [
        _resolved(call.gives, twin) for call in step.calls
    ]  # now: our own reading would take away answers
    after = {where: _resolved(data, twin) for where, data in step.after.items()}
    wrong = [
        line for call, gives in zip(step.calls, wanted, strict=True) for line in _called(call, gives, peer)
    ]
    if step.status:
        twin.alarm(max(IDS))  # all that was written before has arrived when this one has answered
        told = twin.status().get(step.of, {})
        wrong += [
            f"{name}: {told.get(name)!r}" for name, value in step.status.items() if told.get(name) != value
        ]
    for (node, address), data in after.items():
        found = twin.read(node, address, len(data))
        if found != data:
            wrong.append(f"{node} holds {found} at {address}, not {data}")
    return wrong


def _called(call: Call, wanted: Any, peer: Peer) -> Iterable[str]:
    try:
        gave = peer.call(call.owner, call.name, *call.arguments)
    except PeerError as error:
        gave = Raised(str(error))
    if not agrees(gave, wanted):
        yield f"{call.name}{call.arguments} gave {gave!r}, not {wanted!r}"


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
    if isinstance(wanted, Anything):
        return not isinstance(gave, Raised)
    if isinstance(wanted, Raised):
        return isinstance(gave, Raised) and wanted.words in gave.words
    if isinstance(wanted, list) and isinstance(gave, list):
        return len(gave) == len(wanted) and all(map(agrees, gave, wanted))
    if isinstance(wanted, float):
        return isinstance(gave, float | int) and math.isclose(gave, wanted, rel_tol=1e-6, abs_tol=1e-9)
    return type(gave) is type(wanted) and bool(gave == wanted)


def _shown(step: Step) -> str:
    return " ".join(f"{call.owner}.{call.name}{call.arguments}" for call in step.calls)


def one(owner: str, name: str, *arguments: Any, gives: Any = None, **more: Any) -> Step:
    """A step of one call."""
    return Step((Call(owner, name, arguments, gives),), **more)
