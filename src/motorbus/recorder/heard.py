"""A family that says nothing of its recordings: what its receiver makes of them, as a host would hear it."""

from __future__ import annotations

from functools import cache

from motorbus import families
from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import ABSENT, NOTICE, REPLY, Captures, PacketFacts, Run
from motorbus.core.family import Family
from motorbus.core.register import shown
from motorbus.core.request import Data, Event, Noise, Notification
from motorbus.errors import RequestError


@cache
def family_of(name: str) -> Family:
    """The family of this name, looked for once. Raises RequestError when there is none."""
    return families.load(name)


def spoken(family: str | Family) -> Family:
    """A family, or the one of this name. Raises RequestError when it is neither."""
    if isinstance(family, str):
        return family_of(family)
    if not hasattr(family, "link"):
        raise RequestError(
            f"{shown(family)} is no family of devices",
            expected=f"one of {', '.join(families.names())}, or a `FAMILY`",
            advice='name whose packets they are, as "feetech"',
        )
    return family


def captures_of(family: Family) -> Captures:
    """How recordings of this family are taken apart: as it says, else by its receiver, whichever way they went."""
    return family.link.captures or Captures(lambda way: ByReceiver(family))


class ByReceiver:
    """Replies and notices as the receiver tells them; the node is the lane where each node has its own."""

    def __init__(self, family: Family) -> None:
        self._receiver = family.open().receiver()
        self._frames = family.link.kind == "frames"
        self._found: list[Event] = []

    def feed(self, data: Data) -> list[Run]:
        """Take bytes, or one CAN frame; give what is complete."""
        return self._runs(self._receiver.feed(data), data)

    def flush(self) -> list[Run]:
        """Nothing more comes: give what can be made of the rest."""
        return self._runs(self._receiver.flush(), b"")

    def tell(self, packets: list[bytes]) -> PacketFacts:
        """What the receiver said of these, which it has found last."""
        found, self._found = self._found[: len(packets)], self._found[len(packets) :]
        kinds = [NOTICE if isinstance(event, Notification) else REPLY for event in found]
        nodes = [self._node(event) for event in found]
        return lambda: (kinds, nodes, [ABSENT] * len(found))

    def _node(self, event: Event) -> int:
        if isinstance(event, Notification):
            return event.node
        return event.lane if self._frames and event.lane is not None else ABSENT

    def _runs(self, events: list[Event], data: Data) -> list[Run]:
        runs: list[Run] = []
        for event in events:
            whole = data.flat() if isinstance(data, CanFrame) else event.data
            if isinstance(event, Noise):
                runs.append(Noise(whole, event.fault))
            else:
                self._found.append(event)
                runs.append([whole])
        return runs
