"""Scripts of faults of every kind, for property tests."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from motorbus.link.base import Side
from motorbus.simulation.faults import ANY, WORDS, Fault, Script
from motorbus.simulation.faults.words import Takes

SECONDS = st.floats(1e-6, 1e6)
BY_CHANCE = (Takes.BITS, Takes.BIT, Takes.BYTE)


@st.composite
def places(draw: st.DrawFn, action: str) -> dict[str, Any]:
    """Where, how often or when."""
    kinds = ["packet", "moment", "percent"] + (["byte", "per_byte"] if WORDS[action].byte else [])
    kind = draw(st.sampled_from(kinds))
    place: dict[str, Any] = {}
    if kind in ("packet", "byte"):
        place["exchange"] = draw(st.integers(0, 12))
        place[kind] = draw(st.integers(1, 3)) if kind == "packet" else draw(st.integers(0, 30))
    elif kind == "moment":
        place["moment"] = draw(st.floats(0, 100))
    else:
        place["percent"] = draw(st.floats(1e-9, 100))
        place["per_byte"] = kind == "per_byte"
    if action != "echo" and draw(st.booleans()):
        place["to"] = draw(st.sampled_from(Side))
    return place


@st.composite
def arguments(draw: st.DrawFn, action: str, at_byte: bool) -> dict[str, Any]:
    """What stands behind the word."""
    takes = WORDS[action].takes
    if takes in BY_CHANCE:
        low, high = {Takes.BITS: (1, 255), Takes.BIT: (0, 7), Takes.BYTE: (0, 255)}[takes]
        exact = st.integers(low, high)
        return {"value": draw(exact if at_byte else exact | st.just(ANY))}
    if takes is Takes.PERHAPS_COUNT:
        return {"value": draw(st.integers(0, 20))}
    if takes in (Takes.NODE, Takes.NODES):
        return {"node": draw(st.integers(0, 253) if takes is Takes.NODE else st.none() | st.integers(0, 253))}
    if takes is Takes.NOTHING:
        return {}
    found: dict[str, Any] = {"seconds": draw(SECONDS)}
    if takes.name.startswith("PERHAPS") and draw(st.booleans()):
        return {}
    if takes is Takes.SPAN and draw(st.booleans()):
        found["until"] = found["seconds"] * draw(st.floats(1.5, 10))
    if takes is Takes.SECONDS_NODE:
        found["node"] = draw(st.none() | st.integers(0, 253))
    return found


@st.composite
def _fault(draw: st.DrawFn, actions: tuple[str, ...]) -> Fault:
    action = draw(st.sampled_from(actions))
    place = draw(places(action))
    return Fault(action=action, **place, **draw(arguments(action, "byte" in place)))


def faults(*actions: str) -> st.SearchStrategy[Fault]:
    """Faults of these words, or of all."""
    return _fault(actions or tuple(WORDS))


scripts = st.builds(Script, st.lists(faults(), max_size=6).map(tuple), st.none() | st.integers(0, 2**40))
