"""Settings of one bus, and what the driver knows of one servo."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from typing import Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.register import Register, RegisterMap, Value, is_number, shown
from motorbus.core.request import Request
from motorbus.errors import RequestError
from motorbus.families.kst import sdo
from motorbus.families.kst.notifications import BusState
from motorbus.families.kst.profiles import PROFILES, Profile, to_raw

ID_FORMATS: Final = ("std", "ext")
SIZED: Final = ("no", "yes")
NMT: Final = ("profile", "none", "standard")


@dataclass(frozen=True, kw_only=True, eq=False)
class BusSettings:
    """How the servos of one bus are addressed.

    `profile`   scale, range, objects and start rule of the maker
    `extended`  29-bit identifiers (id_format=ext); else 11-bit
    `sized`     writes state their length (CiA 301); else specifier 0x22, as in the manual
    `must_start`  servos accept positions only after a start
    `state`     what the open bus has received
    """

    profile: Profile = PROFILES["kst"]
    extended: bool = False
    sized: bool = False
    must_start: bool = False
    state: BusState = field(default_factory=BusState)

    def upload(self, node: int, row: Register) -> CanFrame:
        """The request that reads this object of one servo or of all (0)."""
        return self.format(sdo.encode_upload(node, row.address, row.subindex or 0))

    def download(self, node: int, row: Register, raw: int) -> CanFrame:
        """The request that writes this object of one servo or of all (0). Raises RequestError outside its range."""
        frame = sdo.encode_download(node, row.address, row.subindex or 0, row.encode(raw), sized=self.sized)
        return self.format(frame)

    def format(self, frame: CanFrame) -> CanFrame:
        """The frame with an identifier of 11 or 29 bits, as the bus uses."""
        return frame._replace(extended=self.extended)


def choice(name: str, value: object, choices: Iterable[str]) -> str:
    """The setting in lower case. Raises RequestError, with the choices, for any other."""
    word = str(value).lower()
    if word in choices:
        return word
    raise RequestError(f"{name}={value} is not possible", expected=f"one of {', '.join(choices)}")


DEFAULT: Final = BusSettings()  # the settings of the manual


class Node:
    """One servo by its id, 1 to 127. It does no I/O; the driver functions fill it.

    `at`         arrival time of its last reply (s, link clock)
    `limits`     travel limits (rad) as last read; None: not read yet
    `last_move`  identifies its latest move
    `reading`    the request for its position, which is made once
    """

    def __init__(self, node: int, settings: BusSettings = DEFAULT) -> None:
        self.node: Final = checked_id(node)
        self.settings: Final = settings
        self.profile: Final[Profile] = settings.profile
        self.table: Final[RegisterMap] = settings.profile.table
        self.limits: tuple[float, float] | None = None
        self.at = -inf
        self.last_move: object = None
        self.reading: Request[float] | None = None

    @property
    def alarm(self) -> tuple[str, ...]:
        """Alarms received within 5 s before its last reply; a servo does not report that an alarm is over."""
        return self.settings.state.alarm(self.node, self.at)

    def raw(self, row: Register, value: Value) -> int:
        """Value in the unit of the row -> raw value. Raises RequestError if not finite, or an angle out of range."""
        if row.unit == "rad" and is_number(value):
            return to_raw(self.profile, value, row.name)
        return row.to_raw(value)


def feature_row(node: Node, name: str, feature: str) -> Register:
    """The object that this feature needs. Raises RequestError, with the profiles that have it, where it is missing."""
    if name in node.table:
        return node.table[name]
    profiles = [profile.name for profile in PROFILES.values() if name in profile.table]
    raise RequestError(
        f"node {node.node}: the profile {node.profile.name} has no {feature}",
        expected=f"a servo of the profile {' or '.join(profiles)}",
        advice=f"if this servo has it, choose its profile, as in kst:PORT,profile={profiles[0]}",
        node=node.node,
    )


def checked_id(node: int) -> int:
    """The id of one servo. Raises RequestError for anything else, also for 0 (all servos)."""
    if isinstance(node, int) and not isinstance(node, bool) and node in sdo.NODES:
        return node
    raise RequestError(f"{shown(node)} is not the id of a servo", expected="1 to 127; 0 addresses all servos")


def hexadecimal(node: int) -> str:
    """An id as users of this protocol write it: 0x25 (37)."""
    return f"0x{node:02X} ({node})"
