"""From the text of a file to what it describes, or to the one message that says where it is wrong and what to do.

Every key is known; one that is not is refused, for a word misspelt is a value that silently has its default. Each field
is judged alone here, with the unit it is written in; what several must agree on is judged after that.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, NamedTuple, TypeAlias

import msgspec

from motorbus.core import units
from motorbus.core.register import is_number
from motorbus.errors import RequestError
from motorbus.motion.machine import keys
from motorbus.motion.machine.agreement import check, no_axis
from motorbus.motion.machine.keys import Key
from motorbus.motion.machine.model import FORMAT, NAME, AxisSpec, BusSpec, Description, GroupSpec
from motorbus.motion.machine.refusal import listed, nearest, path, refused, said, to_do

CheckAddress: TypeAlias = Callable[[str], object]
LONGEST: Final = 1 << 20
"""Characters a file may have; a hundred axes with every key have a tenth of it."""
_LINE: Final = 120
EXAMPLES: Final = {
    "address": 'FAMILY:PORT, options after commas, as "feetech:/dev/ttyACM0,baud=1000000"',
    "device": 'BUS#ID, as "arm#1" or "arm#0x25"',
    "name": "text in quotes, 200 characters at most",
}
LIST: Final = 'axes = ["shoulder", "elbow"]'
IN_QUOTES: Final = 'text stands in quotes, and so does a number with its unit: "90 deg"'
HEADS: Final = "write [axis.shoulder] on a line of its own, and its keys below"
ONCE: Final = "each [table] stands in a file once, and each key in its table once"


def read(text: str, check_address: CheckAddress | None = None) -> Description:
    """What a file describes. `check_address` raises RequestError for an address that it cannot take.

    Raises RequestError, naming the place in the file, for what cannot be.
    """
    data = toml(text)
    _format(data)
    _known(data, keys.TOP)
    buses = {name: _bus(name, table, check_address) for name, table in _tables(data, "bus")}
    axes = {name: _axis(name, table) for name, table in _tables(data, "axis")}
    groups = {name: _group(name, table) for name, table in _tables(data, "group")}
    poses = {name: _pose(name, table, axes) for name, table in _tables(data, "pose")}
    name = _value(data, keys.FILE["name"], ())
    found = Description(name=name, buses=buses, axes=axes, groups=groups, poses=poses)
    check(found)
    return found


# -- the file ------------------------------------------------------------------------------------------------------


def toml(text: str) -> dict[str, Any]:
    """The plain data of a text. Raises RequestError, with line and column where they are known."""
    if len(text) > LONGEST:
        raise refused(
            "", f"the file has more than {LONGEST} characters", "fewer", "see that it is the right one"
        )
    try:
        return tomllib.loads(text.removeprefix("\ufeff"))
    except tomllib.TOMLDecodeError as error:
        why = str(error)
        advice = ONCE if "overwrite" in why or "twice" in why else IN_QUOTES
    except RecursionError:
        why, advice = "it is nested too deeply", "no key needs a list in a list"
    except ValueError:  # Python reads no number of more than 4300 digits
        why, advice = "a number has thousands of digits", "write fewer; 15 are enough"
    short = why if len(why) <= _LINE else f"{why[: _LINE // 2]} … {why[-_LINE // 2 :]}"
    raise refused("", f"the file is no TOML: {short}", "TOML", advice)


def _format(data: Mapping[str, Any]) -> None:
    found = data.get("format")
    if "format" not in data:
        raise refused("format", "is missing", f"format = {FORMAT}", "make it the first line of the file")
    if type(found) is not int or found != FORMAT:
        newer = type(found) is int and found > FORMAT
        advice = "a newer motorbus may read it: update motorbus" if newer else f"write format = {FORMAT}"
        raise refused("format", f"{said(found)} is not known", f"format = {FORMAT}", advice)


def _tables(data: Mapping[str, Any], kind: str) -> list[tuple[str, Mapping[str, Any]]]:
    """The tables of one kind by their names, which are good ones."""
    tables = data.get(kind, {})
    if not isinstance(tables, dict):
        raise refused(kind, f"{said(tables)} is no table", f"tables [{kind}.NAME]", HEADS)
    for name, table in tables.items():
        _name(kind, name)
        if not isinstance(table, dict):
            where, table_ = path(kind, name), f"a table [{kind}.{name}]"
            raise refused(where, f"{said(table)} is no table", table_, HEADS)
    return list(tables.items())


def _name(kind: str, name: str) -> None:
    if re.fullmatch(NAME, name):
        return
    better = re.sub(r"[^a-z0-9_-]+", "_", name.lower()).strip("_-")[:40]
    fits = re.fullmatch(NAME, better) is not None
    raise refused(
        path(kind, name),
        "the name has other characters, or too many" if name else "the name is empty",
        "a lower case letter, then lower case letters, digits, _ and -, 40 at most",
        f"call it {better}" if fits else "call it by a word, as left-arm",
    )


def _known(table: Mapping[str, Any], known: Iterable[str], *where: str) -> None:
    for key in table:
        if key not in known:
            raise refused(
                path(*where, key), "there is no such key", listed(known), nearest(key, known, "take it out")
            )


# -- its tables ----------------------------------------------------------------------------------------------------


def _bus(name: str, table: Mapping[str, Any], check_address: CheckAddress | None) -> BusSpec:
    _known(table, keys.BUS, "bus", name)
    address = _value(table, keys.BUS["address"], ("bus", name))
    if check_address is not None:
        try:
            check_address(address)
        except RequestError as error:
            where = path("bus", name, "address")
            advice = to_do(error.advice, "change it in the address")
            raise refused(where, error.summary, error.expected, advice) from None
    return BusSpec(address=address)


def _axis(name: str, table: Mapping[str, Any]) -> AxisSpec:
    _known(table, keys.AXIS, "axis", name)
    linear = "travel" in table
    return AxisSpec(
        **{key.name: _value(table, key, ("axis", name), linear=linear) for key in keys.AXIS.values()}
    )


def _group(name: str, table: Mapping[str, Any]) -> GroupSpec:
    _known(table, keys.GROUP, "group", name)
    where, axes = path("group", name, "axes"), table.get("axes")
    if not isinstance(axes, list):
        what = "is missing" if "axes" not in table else f"{said(axes)} is no list"
        raise refused(where, what, LIST, "put the names of its axes into a list")
    for place, axis in enumerate(axes):
        if not isinstance(axis, str):
            raise refused(f"{where}[{place}]", f"{said(axis)} is no name", LIST, "names stand in quotes")
    if not axes:
        raise refused(where, "it names no axis", LIST, "name one, or take the group out")
    return GroupSpec(axes=tuple(axes))


def _pose(name: str, table: Mapping[str, Any], axes: Mapping[str, AxisSpec]) -> dict[str, float]:
    _axes_of(table, axes, "pose", name)
    rows = {axis: keys.POSE._replace(name=axis) for axis in table}
    return {axis: _value(table, rows[axis], ("pose", name), linear=axes[axis].linear) for axis in table}


def _axes_of(table: Mapping[str, Any], axes: Mapping[str, AxisSpec], *where: str) -> None:
    if not table:
        expected = 'positions by the names of axes: shoulder = "10 deg"'
        raise refused(path(*where), "it names no axis", expected, "name one, or take the pose out")
    for axis in table:
        if axis not in axes:
            raise no_axis(path(*where, axis), axis, axes)


# -- one field -----------------------------------------------------------------------------------------------------


class Place(NamedTuple):
    """A field that is being read: its key, where it stands, what is written there, on which kind of axis."""

    key: Key
    where: str
    written: Any
    linear: bool

    @property
    def quantity(self) -> str:
        """What it measures; "" where it is no quantity."""
        return self.key.measure.of(self.linear) if self.key.measure else ""

    @property
    def example(self) -> str:
        """A line that could stand there."""
        return f"{self.key.name} = {self.key.example[self.linear]}"

    def refused(self, what: str, expected: str, advice: str = "") -> RequestError:
        """The error for it; without better advice it gives an example and says what the key means."""
        return refused(self.where, what, expected, advice or f"write it as {self.example} ({self.key.says})")


def _value(table: Mapping[str, Any], key: Key, where: tuple[str, ...], *, linear: bool = False) -> Any:
    """The value of one field in the API's unit, or its default."""
    if key.name not in table and key.needed:
        advice = f"add it to [{path(*where)}]"
        raise refused(path(*where, key.name), "is missing", EXAMPLES[key.name], advice)
    if key.name not in table and not any(key.usual):
        return key.default
    place = Place(key, path(*where, key.name), table.get(key.name, key.usual[linear]), linear)
    if place.quantity:
        return _within(_amount(place), place)
    if key.choices(linear):
        return _choice(place)
    if key.kind is float and not is_number(place.written):
        raise place.refused(f"{said(place.written)} is no finite number", f"a number, {key.range(linear)}")
    return _within(place.written, place)


def _choice(place: Place) -> Any:
    """One word or number of several."""
    written, choices = place.written, place.key.choices(place.linear)
    for choice in choices:
        if type(written) is type(choice) and written == choice:
            return choice
    advice = ""
    if isinstance(written, str):
        other = written in place.key.choices(not place.linear)
        advice = _other_kind(place.linear) if other else nearest(written, map(keys.word, choices))
    raise place.refused(f"{said(written)} is not possible", listed(map(keys.word, choices)), advice)


def _amount(place: Place) -> float:
    """A quantity in the API's unit, from text with a unit, or from a number where its unit cannot be mistaken."""
    written, quantity = place.written, place.quantity
    if isinstance(written, str):
        try:
            found = units.parse(written, quantity)
        except RequestError as error:
            advice = _other_kind(place.linear) if _fits_other(place) else ""
            raise place.refused(error.summary, error.expected, advice) from None
        if place.key.needs_unit and _is_bare(written):
            raise _without_unit(place, float(written))
        return found
    if is_number(written):
        if place.key.needs_unit:
            raise _without_unit(place, float(written))
        return float(written)
    if place.key.needs_unit:
        raise place.refused(f"{said(written)} is no {quantity}", "a finite number with its unit, in quotes")
    unit = f"number in {keys.api_unit(quantity)}" if keys.api_unit(quantity) else "fraction of 1"
    raise place.refused(f"{said(written)} is no {quantity}", f"a finite {unit}, or with its unit in quotes")


def _is_bare(written: str) -> bool:
    try:
        float(written)
    except ValueError:
        return False
    return True


def _without_unit(place: Place, value: float) -> RequestError:
    """The error for a number without its unit, with the same number in both units that may be meant."""
    scales = units.SCALES[place.quantity]
    api = keys.api_unit(place.quantity).replace("²", "2")
    small = next(unit for unit in ("deg", "deg/s", "deg/s2", "mm", "mm/s", "mm/s2") if unit in scales)
    in_small = f"{value * scales[small]:.6g} {api}"
    in_api = f"{value / scales[small]:.6g} {small}"
    name, number = place.key.name, f"{value:.12g}"
    return place.refused(
        f"{number} has no unit",
        f"a {place.quantity} with its unit, in quotes",
        f'write {name} = "{number} {small}" ({in_small}) or {name} = "{number} {api}" ({in_api})',
    )


def _fits_other(place: Place) -> bool:
    """Whether it would be right on the other kind of axis."""
    measure = place.key.measure
    if measure is None or measure.turning == measure.linear:
        return False
    try:
        units.parse(place.written, measure.of(not place.linear))
    except RequestError:
        return False
    return True


def _other_kind(linear: bool) -> str:
    if linear:
        return "an axis with travel is linear, and its positions are lengths; leave travel out where it turns"
    return 'an axis is linear when it has travel = "5 mm", its way for one turn'


def _within(value: Any, place: Place) -> Any:
    key, written = place.key, said(place.written)
    try:
        return msgspec.convert(value, key.hint)
    except msgspec.ValidationError:
        range_ = key.range(place.linear)
    if range_:
        percent = place.quantity == "load" and is_number(place.written) and 1 < place.written <= 100
        advice = f'for {written} % write "{written} %"' if percent else ""
        raise place.refused(f"{written} is out of range", range_, advice)
    what = {"address": "bus address", "device": "device", "name": "name of a machine"}[key.name]
    advice = "take # and the id out: it stands in an axis" if key.name == "address" and "#" in written else ""
    raise place.refused(f"{written} is no {what}", EXAMPLES[key.name], advice)
