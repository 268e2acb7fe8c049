"""A machine file that is half edited must not take the stop away: which device is on which bus is enough for one.

Where the file still is TOML, that is looked up in its tables, whatever else is wrong in them. Where it is none, it is
looked at line by line, and a line that is broken costs no other. For `stop` and `estop` alone: whoever moves something
needs the limits, and so the whole file.
"""

from __future__ import annotations

import re
import tomllib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from motorbus.cli.exits import Partial
from motorbus.cli.machine import is_address, is_name, machine_file
from motorbus.cli.target import targets
from motorbus.errors import MotorbusError, RequestError
from motorbus.motion.machine import AxisSpec, BusSpec, GroupSpec, Machine, kind_of_no_file
from motorbus.motion.machine.model import ADDRESS, Estop
from motorbus.motion.machine.reading import LONGEST
from motorbus.motion.machine.refusal import listed, nearest
from motorbus.motion.several import named

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence
    from pathlib import Path

WITHOUT: Final = "`motorbus stop FAMILY:PORT` and `motorbus estop FAMILY:PORT` need no file"
_NAME: Final = r"[^:#,.\[\]\"'=]+"
"""What can be called on a command line; the file itself is stricter."""
_DEVICE: Final = rf"{_NAME}#(0[xX][0-9a-fA-F]{{1,8}}|[0-9]{{1,10}})"
_HEAD: Final = re.compile(r"\s*\[+([^\[\]#]+)")
_KEY: Final = re.compile(r"[\w.\"' \t-]+=")
_QUOTED: Final = re.compile(r"[\"']([^\"']+)[\"']")
_LOOSE: Final = re.compile(r"[\"']?([^\"'\s]+)")


class Meant(NamedTuple):
    """Whom words mean: who can be stopped, each by a word of its own, and by name the errors of who cannot."""

    known: tuple[str, ...]
    unclear: dict[str, RequestError]


class Rough(NamedTuple):
    """What can be seen in a file, and by name the errors of those it speaks of and who cannot be placed.

    A group of this machine has all the names that it has in the file, also of those who cannot.
    """

    machine: Machine
    lost: dict[str, RequestError]


@contextmanager
def forgiving(words: Collection[str]) -> Iterator[Meant]:
    """Whom these words mean, everybody for none; a file with faults is as good as what can be seen in it.

    Adds to an error what needs no file. Raises Partial where all went well: somebody may be missing in the file.
    """
    fault, lost = _looked_up(words)
    meant = understood(words or _everybody(lost, rough=fault is not None), lost)
    try:
        yield meant
    except MotorbusError as error:
        if fault is not None:
            error.advice = f"{error.advice}; {WITHOUT}" if error.advice else WITHOUT
            if fault.summary not in error.summary:
                error.add_note(
                    f"only who can be seen in a file with an error was looked for: {fault.summary}"
                )
        raise
    if fault is not None:
        raise Partial(
            f"only those were stopped who can be seen in a file with an error: {fault.summary}",
            expected=f"all; seen were {', '.join(_axes(meant.known))}",
            advice=WITHOUT,
        )


def _looked_up(words: Collection[str]) -> tuple[RequestError | None, Mapping[str, RequestError]]:
    """What is wrong with the file, where these words need one, and who is lost in it.

    From here on the file is what can be seen in it; it stays what it is where that is nothing.
    """
    file = machine_file()
    needed = not words or not all(map(is_address, words))
    if file.path is None or not needed:
        return None, {}
    try:
        _ = file.machine
    except RequestError as error:
        found = _seen(file.path)
        if found is None:
            return error, ({} if words else {str(file.path): error})
        file.machine = found.machine
        return error, found.lost
    return None, {}


def _everybody(lost: Mapping[str, RequestError], *, rough: bool) -> tuple[str, ...]:
    """The axes, and buses without any where an axis may be there unseen; these last, for to look takes long."""
    machine = readable()
    bare = [bus for bus in machine.buses if not machine.axes_of(bus) or bus in machine.axes]
    return (*machine.axes, *(bare if rough or not machine.axes else ()), *lost)


def readable() -> Machine:
    """The machine of its file as far as it can be seen; one without anything where there is none."""
    file = machine_file()
    try:
        return file.machine if file.path is not None else Machine()
    except RequestError:  # whoever looks up a name in it is told
        return Machine()


# -- whom words mean -----------------------------------------------------------------------------------------------


def understood(words: Collection[str], lost: Mapping[str, RequestError]) -> Meant:
    """Take groups apart, so that one of their axes that cannot be understood takes no other along."""
    meant = Meant((), {})
    for part in dict.fromkeys(part for word in words for part in _parts(word)):
        try:
            if error := lost.get(part) or lost.get(part.partition("#")[0]):
                raise error
            targets(part)
        except RequestError as error:
            meant.unclear[part] = _named(part, error) if _is_there(part) else error
        else:
            meant = meant._replace(known=(*meant.known, part))
    return meant


def together(errors: Sequence[RequestError]) -> RequestError:
    """The first of several errors, with the others as its notes."""
    for other in dict.fromkeys(one.summary for one in errors[1:] if one.summary != errors[0].summary):
        errors[0].add_note(f"also: {other}")
    return errors[0]


def beside_others(errors: Sequence[RequestError]) -> Sequence[RequestError]:
    """The same errors, now that the others are stopped all the same."""
    for one in errors:
        one.advice = one.advice.replace("nothing was sent", "the others were visited")
    return errors


def _is_there(name: str) -> bool:
    machine = readable()
    return name in machine.axes or name in machine.buses


def _named(name: str, error: RequestError) -> RequestError:
    found = named(name, error)
    assert isinstance(found, RequestError)
    return found


def _parts(word: str, above: tuple[str, ...] = ()) -> tuple[str, ...]:
    """A word, or in the place of a group those whom it names."""
    groups = readable().groups if is_name(word) else {}
    if word not in groups:
        return (word,)
    itself = (word,) if _is_there(word) else ()
    others = () if word in above else groups[word].axes
    return (*itself, *(part for one in others for part in _parts(one, (*above, word))))


def _axes(words: Collection[str]) -> list[str]:
    """The names of the axes that these words mean; the word itself where it means none by name."""
    found: list[str] = []
    for word in words:
        found += (readable().axes_of(word) if _is_there(word) else ()) or (word,)
    return list(dict.fromkeys(found))


# -- what can be seen ----------------------------------------------------------------------------------------------


def _seen(path: Path) -> Rough | None:
    """What can be seen in a file; None when it cannot be read, or there is not even a bus in it."""
    try:
        if kind_of_no_file(path):
            return None
        with path.open("rb") as file:
            raw = file.read(4 * LONGEST)
    except (OSError, ValueError):
        return None
    wide = raw[:2] in (b"\xff\xfe", b"\xfe\xff")  # as some editors and shells save it
    found = rough(raw.decode("utf-16" if wide else "utf-8", errors="replace"))
    return found if found.machine.buses else None


def rough(text: str) -> Rough:
    """The buses, devices and groups that can be seen in a text, whatever else is in it.

    An axis is there when its bus is. Whether an emergency stop lets it go is kept, for it must not fall.
    """
    text = text.removeprefix("\ufeff")
    data = _toml(text)
    data = _by_lines(text) if data is None else data
    said = {kind: _tables(data, kind) for kind in ("bus", "axis", "group")}
    places = {name: _shaped(table, "address", ADDRESS) for name, table in said["bus"].items()}
    devices = {name: _shaped(table, "device", _DEVICE) for name, table in said["axis"].items()}
    members = {name: _members(table) for name, table in said["group"].items()}
    machine = Machine(
        buses={name: BusSpec(address=place) for name, place in places.items() if place},
        axes={
            name: _axis(device, said["axis"][name])
            for name, device in devices.items()
            if places.get(device.partition("#")[0])
        },
        groups={name: GroupSpec(axes=axes) for name, axes in members.items() if axes},
    )
    return Rough(machine, _lost(machine, places, devices, members))


def _axis(device: str, table: Mapping[str, Any]) -> AxisSpec:
    estop: Estop | None = "hold" if table.get("estop") == "hold" else None
    return AxisSpec(device=device, unit="rad", max_velocity=1.0, max_acceleration=1.0, estop=estop)


def _lost(
    machine: Machine,
    places: Mapping[str, str],
    devices: Mapping[str, str],
    members: Mapping[str, tuple[str, ...]],
) -> dict[str, RequestError]:
    """Why each of those who cannot be placed cannot."""
    lost: dict[str, RequestError] = {}
    for name in (name for axes in members.values() for name in axes if is_name(name)):
        near = nearest(name, machine.axes)
        lost[name] = _gone(
            f"{name}: a group names this axis, and the file has none", listed(machine.axes), near
        )
    for name in (name for name, axes in members.items() if not axes):
        lost[name] = _gone(f"{name}: this group names no axis", 'axes = ["shoulder", "elbow"]')
    for name, device in devices.items():
        bus = device.partition("#")[0]
        no_device = f"{name}: the file does not say which device this axis is", 'device = "BUS#ID"'
        no_bus = f"{name}: its device is {device}, and bus {bus} cannot be seen", listed(machine.buses)
        lost[name] = _gone(*(no_bus if device else no_device))
    for name in places:
        lost[name] = _gone(f"{name}: the file does not say where this bus is", 'address = "FAMILY:PORT"')
    there = {*machine.buses, *machine.axes, *machine.groups}
    return {name: error for name, error in lost.items() if name not in there}


def _gone(summary: str, expected: str, near: str = "") -> RequestError:
    return RequestError(summary, expected=expected, advice=f"{near or 'mend the file'}; nothing was sent")


def _tables(data: Mapping[str, Any], kind: str) -> dict[str, dict[str, Any]]:
    tables = data.get(kind)
    if not isinstance(tables, dict):
        return {}
    return {
        name: table if isinstance(table, dict) else {}
        for name, table in tables.items()
        if re.fullmatch(_NAME, name)
    }


def _shaped(table: Mapping[str, Any], key: str, form: str) -> str:
    """What stands under this key, or under one that is misspelt, where it has this form; "" for nothing."""
    texts = [text for text in (table.get(key), *table.values()) if isinstance(text, str)]
    return next((text for text in texts if re.fullmatch(form, text)), "")


def _members(table: Mapping[str, Any]) -> tuple[str, ...]:
    """The names in a group: a list, or a text with commas in it."""
    said = table.get("axes", next((one for one in table.values() if isinstance(one, list)), ()))
    names = re.split(r"[,\s]+", said) if isinstance(said, str) else said if isinstance(said, list) else ()
    return tuple(dict.fromkeys(name for name in names if isinstance(name, str) and name))


# -- what is no TOML -----------------------------------------------------------------------------------------------


def _toml(text: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        return None


def _by_lines(text: str) -> dict[str, Any]:
    """As TOML would be read, without what cannot be. A table that is there twice is two, of a key the first counts."""
    data: dict[str, Any] = {}
    head: tuple[str, ...] = ()
    heads: set[tuple[str, ...]] = set()
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if _KEY.match(line):
            key, _, begun = line.partition("=")
            _put(data, (*head, *_path(key)), _value(_whole(begun.strip(), lines, number)))
        elif table := _HEAD.match(line):
            head = _path(table[1])
            while head in heads:
                head = (*head[:-1], f"{head[-1]} again")
            heads.add(head)
            _put(data, head, {})
    return data


def _whole(begun: str, lines: Sequence[str], number: int) -> str:
    """A value that begins on this line, with the lines below that belong to it where it is a list."""
    found = [begun]
    for below in range(number + 1, len(lines) if begun.startswith("[") else 0):
        line = lines[below]
        if "]" in found[-1].partition("#")[0] or _KEY.match(line) or _HEAD.match(line):
            break
        found.append(line)
    return "\n".join(found)


def _path(words: str) -> tuple[str, ...]:
    return tuple(word.strip(" \t\"'") for word in words.split("."))


def _value(text: str) -> Any:
    """What a value is in TOML; where it is none, the names of a list, or what may be a text without its quotes."""
    if (whole := _toml(f"value = {text}")) is not None:
        return whole["value"]
    if text.startswith("["):
        return _QUOTED.findall("\n".join(line.partition("#")[0] for line in text.splitlines()))
    loose = _LOOSE.match(text)
    return loose[1] if loose else ""


def _put(data: dict[str, Any], path: Sequence[str], value: Any) -> None:
    """Put a value where nothing is yet."""
    for name in path[:-1]:
        data = data.setdefault(name, {})
        if not isinstance(data, dict):
            return
    data.setdefault(path[-1], value)
