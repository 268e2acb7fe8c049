"""A script of faults as text: one a line or between semicolons, `#` begins a remark.

    seed 42
    exchange 17 byte 3: drop
    exchange 17 byte 0 to device: corrupt 80
    exchange 18: delay 0.02
    1% of bytes: corrupt
    at 2.5 s: power-cycle 3

It prints itself as a text that parses to an equal script, so a failing case can be kept, sent and run again.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

from motorbus.errors import RequestError
from motorbus.link.base import Side
from motorbus.simulation.faults.fault import ANY, Fault
from motorbus.simulation.faults.words import WORDS, Takes

EXAMPLES: Final = (
    "for example `exchange 17 byte 3: drop`, `1% of bytes: corrupt` or `at 2.5 s: power-cycle 3`"
)
LONGEST: Final = 80
"""Characters of what is wrong that are said again."""
_KEYS: Final = ("seed", "exchange", "packet", "byte", "bytes", "host", "device", "all")
_WHERE: Final = re.compile(
    r"(?:at\s+)?(?:exchange\s+(?P<exchange>\d+)(?:\s+(?:byte\s+(?P<byte>\d+)|packet\s+(?P<packet>\d+)))?"
    r"|(?P<percent>[\d.]+(?:e[+-]?\d+)?)\s*%(?:\s+of\s+(?P<unit>bytes|packets))?"
    r"|(?P<moment>[\d.]+(?:e[+-]?\d+)?)\s*s)"
    r"(?:\s+to\s+(?P<to>host|device))?",
    re.ASCII,
)
_SIDE: Final = re.compile(r"\bto\s+(?:host|device)\b")
_SIGNED: Final = (
    (re.compile(r"\bexchange\s+[-+]"), "exchanges are counted from 1, without a sign"),
    (re.compile(r"\bpacket\s+[-+]"), "packets are counted from 1, without a sign"),
    (re.compile(r"\bbyte\s+[-+]"), "bytes are counted from 0, without a sign"),
    (re.compile(r"(?<![\w.])[-+][\d.e]+\s*%"), "a chance is more than 0 and at most 100 %, without a sign"),
    (
        re.compile(r"(?<![\w.])[-+][\d.e]+\s*s\b"),
        "a moment is counted from the beginning, without a sign",
    ),
)
"""Numbers with a sign that stand where a place is said, and what is true of those numbers."""
_SPAN: Final = re.compile(r"(?P<low>[\d.]+(?:e[+-]?\d+)?)-(?P<high>[\d.]+(?:e[+-]?\d+)?)", re.ASCII)
_DECIMAL: Final = re.compile(r"\d+", re.ASCII)
_ID: Final = re.compile(r"0+|[1-9]\d*", re.ASCII)
_HEX: Final = re.compile(r"(?:0x)?[0-9a-f]+", re.ASCII | re.IGNORECASE)
_REAL: Final = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Script:
    """Faults in order, and what chance begins with; None: nobody said."""

    faults: tuple[Fault, ...] = ()
    seed: int | None = None

    def __str__(self) -> str:
        return "\n".join(
            ([] if self.seed is None else [f"seed {self.seed}"]) + [str(one) for one in self.faults]
        )

    def __iter__(self) -> Iterator[Fault]:
        return iter(self.faults)

    def __len__(self) -> int:
        return len(self.faults)

    @property
    def by_chance(self) -> bool:
        """Whether the seed decides anything."""
        return any(fault.by_chance for fault in self.faults)

    @property
    def line(self) -> str:
        """The same in one line, for a flag or an order."""
        return "; ".join(str(self).splitlines())

    def seeded(self, seed: int) -> Script:
        """With this seed if it has none."""
        return self if self.seed is not None else replace(self, seed=seed)


def parse(text: str) -> Script:
    """A script from its text. Raises RequestError with the line, what is expected there, and what is near."""
    faults: list[Fault] = []
    seed: int | None = None
    for count, line in enumerate(text.splitlines(), start=1):
        for said in _parts(line):
            if re.fullmatch(r"seed\s+\d+", said, re.ASCII):
                seed = _one_seed(seed, said, count)
            else:
                faults.append(_fault(said, count))
    return Script(tuple(faults), seed)


def as_script(script: Script | str | Iterable[Fault]) -> Script:
    """Whatever says a script as one."""
    if isinstance(script, str):
        return parse(script)
    return script if isinstance(script, Script) else Script(tuple(script))


def requested(script: Script | str | Iterable[Fault]) -> Script:
    """The same of what somebody has asked for; "" is none.

    Raises RequestError for another text without a fault: its writer believes that something goes wrong.
    """
    made = as_script(script)
    if script and isinstance(script, str) and not made:
        raise RequestError(f"{short(script)!r}: there is no fault in it", expected=EXAMPLES)
    return made


def _one_seed(before: int | None, said: str, count: int) -> int:
    if before is not None:
        raise RequestError(
            f"line {count}: {short(said)!r}: the seed is {before} already", expected="one seed"
        )
    try:
        return _whole(said.split()[1])
    except RequestError as error:
        raise RequestError(f"line {count}: {error.summary}") from None


def _fault(said: str, count: int) -> Fault:
    where, colon, what = said.partition(":")
    match = _WHERE.fullmatch(where.strip())
    words = what.split()
    if not colon or match is None or not words:
        raise _incomplete(said, count) or _nonsense(said, count)
    if words[0] not in WORDS:
        raise _unknown(words[0], said, count)
    try:
        return _made(match, words)
    except RequestError as error:
        why = error.summary
        if why.startswith("fault "):  # what follows says the same fault again, in its own words
            why = why.rpartition(": ")[2]
        raise RequestError(
            f"line {count}: {short(said)!r} is not a fault: {why}", expected=error.expected
        ) from None


def _made(match: re.Match[str], words: list[str]) -> Fault:
    place: dict[str, Any] = {
        name: _whole(match[name]) for name in ("exchange", "byte", "packet") if match[name]
    }
    place |= {name: _float(match[name]) for name in ("percent", "moment") if match[name]}
    if match["percent"] and not place["percent"]:
        raise RequestError("impossible chance", expected="more than 0 and at most 100 %")
    if match["to"]:
        place["to"] = Side(match["to"])
    place["per_byte"] = match["unit"] == "bytes"
    return Fault(action=words[0], **place, **_arguments(words[0], words[1:], loose=not match["byte"]))


def _arguments(action: str, said: list[str], *, loose: bool) -> dict[str, Any]:
    """What stands behind a word; `loose`: what is not said there is left to chance."""
    takes = WORDS[action].takes
    most = {Takes.NOTHING: 0, Takes.SECONDS_NODE: 2}.get(takes, 1)
    optional = takes.name.startswith("PERHAPS") or takes is Takes.NOTHING
    if not said and loose and takes in (Takes.BITS, Takes.BIT, Takes.BYTE):
        return {"value": ANY}
    if side := _SIDE.search(" ".join(said)):
        raise RequestError(
            f"`{side[0]}` stands before the colon",
            expected=f"the place first, as `exchange 17 {side[0]}: drop`",
        )
    if len(said) > most or (not said and not optional):
        raise RequestError(f"{action} takes {takes.value or 'nothing more'}")
    try:
        return _values(takes, said)
    except ValueError:
        raise RequestError(f"impossible {short(' '.join(said))!r}", expected=takes.value) from None


def _values(takes: Takes, said: list[str]) -> dict[str, Any]:
    if not said:
        return {}
    if takes in (Takes.BITS, Takes.BYTE):
        return {"value": _integer(said[0], _HEX, 16)}
    if takes in (Takes.BIT, Takes.PERHAPS_COUNT):
        return {"value": _integer(said[0], _DECIMAL)}
    if takes in (Takes.NODE, Takes.NODES):
        every = takes is Takes.NODES and said[0] == "all"
        return {"node": None if every else _node(said[0])}
    if takes is Takes.SECONDS_NODE:
        whom = said[1] if len(said) > 1 else "all"
        return {"seconds": _real(said[0]), "node": None if whom == "all" else _node(whom)}
    span = _SPAN.fullmatch(said[0]) if takes is Takes.SPAN else None
    if span:
        return {"seconds": _real(span["low"]), "until": _real(span["high"])}
    return {"seconds": _real(said[0])}


def _node(text: str) -> int:
    """An id, in decimal or as 0x25. Which ones there are is not known here."""
    value = _integer(text, _HEX, 16) if text[:2].lower() == "0x" else _integer(text, _ID)
    if value.bit_length() > 32:
        raise ValueError(value.bit_length())
    return value


def _integer(text: str, form: re.Pattern[str], base: int = 10) -> int:
    """A number without a sign. What Python takes besides, as 1_0 and digits of other scripts, is a slip of the pen."""
    if not form.fullmatch(text):
        raise ValueError(text)
    return int(text, base)


def _real(text: str) -> float:
    if not _REAL.fullmatch(text):
        raise ValueError(text)
    return float(text)


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:  # more digits than Python turns into a number
        raise RequestError(f"{short(text)} is no number that can be reached") from None


def _float(text: str) -> float:
    try:
        return _real(text)
    except ValueError:
        raise RequestError(f"{text} is no number") from None


def is_meant(text: str) -> bool:
    """Whether whoever wrote this meant a script, be it a bad or an empty one, and not the name of a file."""
    parts = list(_parts(text))
    return ":" in text or not parts or any(_lack(part) or part.split()[0] == "seed" for part in parts)


def _parts(text: str) -> Iterator[str]:
    for line in text.splitlines():
        yield from filter(None, map(str.strip, line.partition("#")[0].split(";")))


def _lack(said: str) -> str:
    """What a part of a script lacks, where that can be told; else ""."""
    where, colon, what = map(str.strip, said.partition(":"))
    place = _WHERE.match(where)
    word = where[place.end() :].split()[:1] if place else []
    if place and not word and not what:
        return "it does not say what goes wrong there"
    if word and word[0] in WORDS and not colon:
        return f"there is no colon before {word[0]}"
    first = (where or what).split()[:1]
    if first and first[0] in WORDS and not (where and what):
        return "it does not say where"
    return ""


def _incomplete(said: str, count: int) -> RequestError | None:
    """What is wrong with a part that lacks something; None: it is another thing."""
    if said.split()[0] == "seed":
        return RequestError(
            f"line {count}: {short(said)!r} is no seed", expected="a whole number, as `seed 42`"
        )
    if lack := _sign(said.partition(":")[0]) or _lack(said):
        return RequestError(f"line {count}: {short(said)!r} is not a fault: {lack}", expected=EXAMPLES)
    return None


def _sign(where: str) -> str:
    """What is wrong with a number in this place that has a sign; "" when none has."""
    return next((why for form, why in _SIGNED if form.search(where)), "")


def _nonsense(said: str, count: int) -> RequestError:
    """What is near: a word of the grammar that one of these could have been meant to be."""
    unknown = [
        word for word in re.findall(r"[a-z][a-z-]*", said.lower()) if word not in (*_KEYS, *WORDS, "at", "to")
    ]
    near = [match for word in unknown for match in _near(word, [*_KEYS, *WORDS], 1)]
    return RequestError(
        f"line {count}: {short(said)!r} is not a fault",
        expected=EXAMPLES,
        cause=f"perhaps {' and '.join(f'`{word}`' for word in near)} was meant" if near else "",
    )


def _unknown(word: str, said: str, count: int) -> RequestError:
    near = _near(word, WORDS, 3)
    return RequestError(
        f"line {count}: {short(said)!r} is not a fault: there is no {short(word)!r}",
        expected=f"perhaps {' or '.join(near)}" if near else f"one of {', '.join(WORDS)}",
    )


def short(text: str) -> str:
    """As much of it as a reader needs to find it."""
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def _near(word: str, known: Iterable[str], most: int) -> list[str]:
    from difflib import get_close_matches  # only who has made a mistake waits for it

    return get_close_matches(word, list(known), n=most)
