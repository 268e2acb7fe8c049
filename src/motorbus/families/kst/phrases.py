"""The few turns of phrase that every explained frame shares."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from motorbus.families.kst.table import Profile

Field: TypeAlias = tuple[int, str, str]
"""So many bytes, what they are called, and what they say."""


class Told(NamedTuple):
    """A frame in words: its title, what its identifier says, the fields of its data, and why it is bad ("" if not)."""

    title: str
    identifier: str
    fields: list[Field]
    fault: str = ""


def faulted(title: str, identifier: str, data: bytes, fault: str) -> Told:
    """A bad frame: its data in one piece, and the reason."""
    fields: list[Field] = [(len(data), "data", fault)] if data else []
    return Told(title, identifier, fields, fault)


def reserved(data: bytes) -> Field:
    """Bytes that say nothing; whoever receives them ignores them, whatever they are."""
    return len(data), "reserved", "ignored, though not 0" if any(data) else "0"


def angle(profile: Profile, raw: int) -> str:
    """A raw position in degrees, and how it was counted."""
    return f"{degrees(profile, raw)} (raw {raw}, {profile.counts_per_degree} per degree)"


def degrees(profile: Profile, raw: int) -> str:
    """A raw position in degrees."""
    return f"{raw / profile.counts_per_degree:.6g}°"


def counted(count: int, what: str = "byte") -> str:
    """So many of something."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"
