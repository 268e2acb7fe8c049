"""Settings of one bus, and what the driver knows of one servo."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf
from typing import Any, Final

from motorbus.core.register import Register, RegisterMap, Value
from motorbus.core.request import Request
from motorbus.errors import RequestError
from motorbus.families.kst.notifications import BusState
from motorbus.families.kst.profiles import PROFILES, Profile, to_raw
from motorbus.families.kst.sdo import NODES

ID_FORMATS: Final = ("std", "ext")
SIZED: Final = ("no", "yes")
NMT: Final = ("profile", "none", "vendor", "standard")


class BusSettings:
    """How the servos of one bus are addressed. Raises RequestError, with the choices, for an invalid setting.

    `profile`   a name of `PROFILES`: scale, range, objects and start rule of the maker
    `extended`  29-bit identifiers (id_format=ext); else 11-bit
    `sized`     writes state their length (CiA 301); else specifier 0x22, as in the manual
    `nmt`       form of start and stop: "none", "vendor" or "standard"
    `state`     what the open bus has received; None before it is opened
    """

    def __init__(
        self,
        profile: object = "kst",
        id_format: object = "std",
        sized: object = "no",
        nmt: object = "profile",
        state: BusState | None = None,
    ) -> None:
        if isinstance(sized, bool):
            sized = "yes" if sized else "no"
        self.profile: Final[Profile] = PROFILES[_choice("profile", profile, PROFILES)]
        self.extended: Final = _choice("id_format", id_format, ID_FORMATS) == "ext"
        self.sized: Final = _choice("sized", sized, SIZED) == "yes"
        self.nmt_setting: Final = _choice("nmt", nmt, NMT)
        self.nmt: Final = self.profile.nmt if self.nmt_setting == "profile" else self.nmt_setting
        self.state: Final = state

    def replace(self, **changed: object) -> BusSettings:
        """These settings with some replaced; the state is shared unless it is replaced."""
        own: dict[str, Any] = {
            "profile": self.profile.name,
            "id_format": "ext" if self.extended else "std",
            "sized": self.sized,
            "nmt": self.nmt_setting,
            "state": self.state,
        }
        return BusSettings(**own | changed)

    @property
    def must_start(self) -> bool:
        """Servos ignore positions until they are started."""
        return self.nmt == "standard"


def _choice(name: str, value: object, choices: tuple[str, ...] | Mapping[str, object]) -> str:
    word = str(value).lower()
    if word in choices:
        return word
    raise RequestError(
        f"{name}={value}: there is no such {name.replace('_', ' ')}",
        expected=f"one of {', '.join(choices)}",
        advice="nothing was sent",
    )


DEFAULT: Final = BusSettings()
"""The settings of the manual."""


class Node:
    """One servo by its id, 1 to 127. It does no I/O; the driver functions fill it.

    `at`         arrival time of its last reply (s, link clock)
    `limits`     travel limits (rad) as last read; None: not read yet
    `unsaved`    names of rows that were written here and may not be saved
    `last_move`  identifies its latest move
    `kept`       requests that are made once and run again, by name
    """

    def __init__(self, node: int, settings: BusSettings = DEFAULT) -> None:
        self.node: Final = checked_id(node)
        self.settings: Final = settings
        self.limits: tuple[float, float] | None = None
        self.at = -inf
        self.unsaved: set[str] = set()
        self.last_move: object = None
        self.kept: Final[dict[str, Request[Any]]] = {}

    @property
    def profile(self) -> Profile:
        """The profile of its bus."""
        return self.settings.profile

    @property
    def table(self) -> RegisterMap:
        """Its objects."""
        return self.settings.profile.table

    @property
    def alarm(self) -> tuple[str, ...]:
        """Alarms received within 5 s before its last reply; a servo does not report that an alarm is over."""
        state = self.settings.state
        return () if state is None else state.alarm(self.node, self.at)

    def value(self, row: Register, raw: int) -> Value:
        """Raw value of an object -> value in the unit of the row."""
        return row.to_value(raw)

    def raw(self, row: Register, value: Value) -> int:
        """Value in the unit of the row -> raw value; half a count of an angle rounds away from zero.

        Raises RequestError for a value that is not finite, or an angle outside the range of the row.
        """
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RequestError(
                f"{row.name}: {value!r} is not a number",
                advice="give a number; nothing was sent",
                node=self.node,
            )
        try:
            return to_raw(self.profile, value, row.name) if row.unit == "rad" else row.to_raw(value)
        except OverflowError:
            raise RequestError(
                f"{row.name}: this number is far out of range",
                advice="give an angle inside the range; nothing was sent",
                node=self.node,
            ) from None


def checked_id(node: int) -> int:
    """The id of one servo. Raises RequestError for anything else, also for 0 (all servos)."""
    if isinstance(node, int) and not isinstance(node, bool) and node in NODES:
        return node
    raise RequestError(
        f"{node!r} is not the id of a servo" + (": 0 addresses all servos" if node == 0 else ""),
        expected="1 to 127",
        advice="name one servo; `motorbus scan BUS` lists them; nothing was sent",
    )


def checked_ids(nodes: Iterable[int]) -> list[int]:
    """These ids, each once, in order. Raises RequestError for an invalid id."""
    return list(dict.fromkeys(checked_id(node) for node in nodes))


def hexadecimal(node: int) -> str:
    """An id as users of this protocol write it: 0x25 (37)."""
    return f"0x{node:02X} ({node})"


def lacking(node: Node, what: str, row: str) -> RequestError:
    """The error for a feature that the profile of this node lacks; `row` is the object that it needs."""
    having = [profile.name for profile in PROFILES.values() if row in profile.table]
    manual = "the KST CAN protocol manual does not have it; newer firmware and other makers do"
    return RequestError(
        f"node {node.node}: the profile {node.profile.name} has no {what}",
        expected=f"a servo of the profile {' or '.join(having)}",
        cause=manual if node.profile.name == "kst" else "no source says that these servos have it",
        advice=f"if this servo has it, choose its profile, as in kst:PORT,profile={having[0]}; nothing was sent",
        node=node.node,
    )


def check_above_zero(name: str, value: object, unit: str, *, node: int | None = None) -> None:
    """Raise RequestError unless this is a finite number above 0."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < inf:
        raise RequestError(
            f"{name} {value!r} is not a finite number above 0",
            advice=f"give it in {unit}; nothing was sent",
            node=node,
        )
