"""What faults make of one packet, at its bytes or of all of it: pieces, each with how much later it comes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Final, NamedTuple, TypeAlias

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.simulation.faults.fault import Fault

INSTANT: Final = 1e-6
"""s between what comes before something that happens to the bus, that, and what comes after it."""
GAP: Final = 0.001
"""s between the pieces of a packet that is split, where nobody says how much."""


Piece: TypeAlias = tuple[float, Data]
"""A part of a packet, and how much later than the packet it comes (s)."""


class Strike(NamedTuple):
    """A fault by position that strikes a packet: at which of its bytes, -1 for the whole; `rank` orders a script."""

    place: int
    rank: int
    fault: Fault


class Harmed(NamedTuple):
    """What is left of the bytes: pieces with how much later they come (s). `later` is what later packets suffer too,
    `lost` that nothing follows in this exchange."""

    pieces: list[tuple[float, bytes]]
    later: float
    lost: bool


def harmed(
    body: bytes,
    strikes: Iterable[Strike],
    later: float,
    lost: bool,
    happen: Callable[[Fault, float], None],
) -> Harmed:
    """Do all that is to be done to the bytes of one packet, which come `later`, or are `lost`, by what was done before.

    `happen` is told what happens to the bus, and how much later than the packet (s).
    """
    run, start = b"", 0
    pieces: list[tuple[float, bytes]] = []
    shift = later
    for place, group in groupby(strikes, key=lambda strike: strike.place):
        run += body[start:place] if not lost else b""
        byte, start = body[place : place + 1], place + 1
        for _, _, fault in group:
            if fault.word.waits:
                happen(fault, shift)
                continue
            if fault.action in ("delay", "split") or fault.word.world:
                pieces.append((shift, run))
                run = b""
            if fault.word.world:
                happen(fault, shift + INSTANT)
                shift += 2 * INSTANT
            elif fault.action in ("delay", "split"):
                shift += fault.seconds or GAP
                later += fault.seconds if fault.action == "delay" else 0.0
            elif fault.action == "truncate":
                lost = True
            else:
                byte = changed(fault, byte)
        run += byte if not lost else b""
    pieces.append((shift, run + (body[start:] if not lost else b"")))
    return Harmed([(when, piece) for when, piece in pieces if piece], later, lost)


def changed(fault: Fault, byte: bytes) -> bytes:
    """A byte (or none, where one is lost already) after a fault that changes it."""
    if fault.action == "insert":
        return bytes([fault.value]) + byte
    if fault.action in ("corrupt", "flip"):
        bits = fault.value if fault.action == "corrupt" else 1 << fault.value
        return bytes([byte[0] ^ bits]) + byte[1:] if byte else byte
    return byte * 2 if fault.action == "duplicate" else b""


def whole(fault: Fault, pieces: list[Piece]) -> list[Piece]:
    """The pieces of a packet after a fault that strikes all of it."""
    if fault.action == "drop":
        return []
    if fault.action == "duplicate":
        return pieces + pieces
    if fault.action == "delay":
        return [(shift + fault.seconds, piece) for shift, piece in pieces]
    if fault.action == "split":
        return _split(pieces, fault.seconds or GAP)
    return pieces


def _split(pieces: list[Piece], gap: float) -> list[Piece]:
    """Every byte by itself."""
    found: list[Piece] = []
    for shift, piece in pieces:
        if isinstance(piece, CanFrame):
            return pieces
        for place in range(len(piece)):
            found.append((shift + len(found) * gap, piece[place : place + 1]))
    return found
