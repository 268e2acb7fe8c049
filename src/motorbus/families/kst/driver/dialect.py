"""How one bus is spoken to, and what it has taught: profile, id format, form of writes, form of start.

Several makers share this protocol and differ in such things, and no servo tells which of them it is. So a bus is
configured, and a family configured for an open bus keeps a `Memory` of what it has found out (which id format a node
answers, who takes sized writes only, which alarms were heard). The plain family keeps nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from math import inf
from typing import Final

from motorbus.core import units
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data, Event, Notification, Reply
from motorbus.errors import RequestError
from motorbus.families.kst import wire
from motorbus.families.kst.table import PROFILES, Profile

ID_FORMATS: Final = ("std", "ext", "auto")
SIZED: Final = ("auto", "no", "yes")
NMT: Final = ("profile", "none", "vendor", "standard")
WINDOW: Final = 16
"""Nodes in flight at once. Four to ten fill any CAN bus; more costs nothing, for the bus itself is the limit."""
MOST: Final = 127
ALARM_HELD: Final = 5.0
"""s that an alarm is shown after it was last heard: servos say that it begins, never that it is over."""
LOW_VOLTAGE: Final = "low voltage"


class Memory:
    """What one open bus has taught.

    `extended`  id format by node: True 29 bits
    `sized`     nodes that take only writes which state their length
    `frames`    frames heard that were no bus errors, and `errors` those that were
    `strangers` nodes that replied in an id format which is not spoken here
    `boots`     how often each node has said that it starts
    """

    def __init__(self) -> None:
        self.extended: dict[int, bool] = {}
        self.sized: set[int] = set()
        self.strangers: set[int] = set()
        self.alarms: dict[int, tuple[tuple[str, ...], float | None]] = {}
        self.boots: Counter[int] = Counter()
        self.frames = 0
        self.errors = 0

    def hear(self, event: Event, extended: bool = False) -> None:
        """Take note of a frame that came; when it came is known only at the node's next answer.

        A reply teaches the id format too, so that who answered everyone can be stopped alone.
        """
        if isinstance(event, Reply):
            self.extended.setdefault(event.lane, extended)
        if isinstance(event, Notification) and event.kind == "bus error":
            self.errors += 1
            return
        self.frames += 1
        if isinstance(event, Notification) and event.kind == "alarm":
            self.alarms[event.node] = (alarm_names(event.data), None)
        if isinstance(event, Notification) and event.kind == "heartbeat" and wire.says_boot(event.data):
            self.boots[event.node] += 1

    def alarm(self, node: int, at: float) -> tuple[str, ...]:
        """The alarms of this node that were heard lately, `at` being now."""
        names, since = self.alarms.get(node, ((), None))
        if at == -inf:  # whoever asks has not heard the node yet, so he does not know the time
            return names
        if since is None and names:
            self.alarms[node] = (names, at)
        elif since is not None and at - since > ALARM_HELD:
            del self.alarms[node]
            return ()
        return names


class Dialect:
    """The settings of one bus. Raises RequestError, with the choices, for a setting that is impossible.

    `profile`    a key of `PROFILES`: the maker's scale, range, objects and start rule
    `id_format`  std: 11-bit identifiers, ext: 29-bit, auto: each node is asked in both once
    `sized`      whether writes state their length: no (0x22, as the manual has it), yes (CiA 301), or auto, which
                 does as the manual says until a node refuses that
    `nmt`        the form of start and stop; profile: what the profile says
    """

    def __init__(
        self,
        profile: object = "kst",
        id_format: object = "std",
        sized: object = "auto",
        nmt: object = "profile",
        memory: Memory | None = None,
    ) -> None:
        self.profile: Final[Profile] = PROFILES[_choice("profile", profile, PROFILES)]
        self.id_format: Final = _choice("id_format", id_format, ID_FORMATS)
        self.sized: Final = _choice("sized", _word(sized), SIZED)
        self.wanted_nmt: Final = _choice("nmt", nmt, NMT)
        self.nmt: Final = self.profile.nmt if self.wanted_nmt == "profile" else self.wanted_nmt
        needed = self.id_format == "auto"  # or every exchange would begin with the same question
        self.memory: Final = Memory() if memory is None and needed else memory

    def like(self, profile: str) -> Dialect:
        """The same bus, as a servo of another make hears it; what has been learnt is shared."""
        return Dialect(profile, self.id_format, self.sized, self.wanted_nmt, self.memory)

    @property
    def formats(self) -> frozenset[bool]:
        """The id formats in which answers are expected: False 11 bits, True 29."""
        return {
            "std": frozenset({False}),
            "ext": frozenset({True}),
            "auto": frozenset({False, True}),
        }[self.id_format]

    @property
    def must_start(self) -> bool:
        """Servos ignore positions until they were started."""
        return self.nmt == "standard"

    def undecided(self, node: int) -> bool:
        """Nobody knows yet which id format this node answers."""
        return self.id_format == "auto" and self.memory is not None and node not in self.memory.extended

    def extended(self, node: int) -> bool:
        """Address this node with 29 bits; an undecided one with 11, as the manual says."""
        if self.id_format == "auto":
            return self.memory is not None and self.memory.extended.get(node, False)
        return self.id_format == "ext"

    def states_length(self, node: int) -> bool:
        """Writes to this node state their length."""
        return self.sized == "yes" or (self.memory is not None and node in self.memory.sized)

    def learn_format(self, node: int, extended: bool) -> None:
        """This node has answered in this format."""
        if self.memory is not None:
            self.memory.extended[node] = extended

    def learn_sized(self, node: int) -> None:
        """This node has refused a write without a length and taken one with it."""
        if self.memory is not None:
            self.memory.sized.add(node)

    def alarm(self, node: int, at: float) -> tuple[str, ...]:
        """Alarms of this node heard within the last `ALARM_HELD` seconds."""
        return () if self.memory is None else self.memory.alarm(node, at)


class Ear:
    """The receiver of a bus that keeps a memory: what comes is noted on its way through."""

    def __init__(self, formats: frozenset[bool], memory: Memory) -> None:
        self._receiver = wire.FrameReceiver(formats)
        self._formats = formats
        self._memory = memory

    @property
    def held(self) -> int:
        """A frame is an event, so nothing ever waits."""
        return self._receiver.held

    def feed(self, data: Data, /) -> list[Event]:
        """Take one frame; give what it is."""
        events = self._receiver.feed(data)
        if isinstance(data, CanFrame) and data.extended not in self._formats:
            self._memory.strangers.update(_replier(data))
        for event in events:
            self._memory.hear(event, isinstance(data, CanFrame) and data.extended)
        return events

    def flush(self) -> list[Event]:
        """Nothing is held back."""
        return self._receiver.flush()


def _replier(frame: CanFrame) -> tuple[int, ...]:
    """Whose reply this is by its identifier and length; () when it is none."""
    node = frame.id - wire.REPLY
    return (node,) if node in wire.NODES and len(frame.data) == wire.LENGTH else ()


def alarm_names(data: bytes) -> tuple[str, ...]:
    """What an alarm says; one that nobody knows as hex."""
    return (LOW_VOLTAGE,) if data == wire.LOW_VOLTAGE else (f"alarm {data.hex(' ').upper()}",)


def window(value: object) -> int:
    """Nodes in flight at once, 1 to 127. Raises RequestError."""
    try:
        number = units.whole(str(value))
    except ValueError:
        number = 0
    if not 1 <= number <= MOST:
        raise RequestError(
            f"window={value}: not a number of nodes", expected=f"1 to {MOST}", advice="nothing was sent"
        )
    return number


def _word(value: object) -> object:
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else value


def _choice(name: str, value: object, choices: tuple[str, ...] | Mapping[str, object]) -> str:
    word = str(value).lower()
    if word in choices:
        return word
    raise RequestError(
        f"{name}={value}: there is no such {name.replace('_', ' ')}",
        expected=f"one of {', '.join(choices)}",
        advice="nothing was sent",
    )


PLAIN: Final = Dialect()
"""As the manual has it, without a memory: how a bus is spoken to that was not configured."""


def dialect_of(family: object) -> Dialect:
    """How a bus of this (configured) family is spoken to; the manual's way where nothing says otherwise."""
    found = getattr(family, "_dialect", None)
    return found if isinstance(found, Dialect) else PLAIN
