"""From the text of a file to what it describes, or to the one message that says where it is wrong and what to do.

Every key is known; one that is not is refused, for a word misspelt is a value that silently has its default. Each field
is judged alone here, with the unit it is written in; what several must agree on is judged after that.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, TypeAlias

import msgspec

from motorbus.core import units
from motorbus.core.entry import is_number
from motorbus.errors import RequestError
from motorbus.motion.machine import keys
from motorbus.motion.machine.agreement import check
from motorbus.motion.machine.keys import Key
from motorbus.motion.machine.model import FORMAT, NAME, AxisSpec, BusSpec, Description, GroupSpec, Measure
from motorbus.motion.machine.refusal import listed, nearest, path, refused, said

CheckAddress: TypeAlias = Callable[[str], object]
LONGEST: Final = 1 << 20
"""Characters a file may have; a hundred axes with every key have a tenth of it."""
EXAMPLES: Final = {
    "address": 'FAMILY:PORT, options after commas, as "feetech:/dev/ttyACM0,baud=1000000"',
    "device": 'BUS#ID, as "arm#1" or "arm#0x25"',
    "name": "text in quotes, 200 characters at most",
}
IN_QUOTES: Final = 'text stands in quotes, and so does a number with its unit: "90 deg"'
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
        raise refused("", f"the file has {len(text)} characters", f"{LONGEST} at most")
    try:
        return tomllib.loads(text.removeprefix("\ufeff"))
    except tomllib.TOMLDecodeError as error:
        why = str(error)
    except RecursionError:
        why = "it is nested too deeply"
    except ValueError:  # Python reads no number of more than 4300 digits
        why = "a number has thousands of digits"
    twice = "overwrite" in why or "twice" in why
    raise refused("", f"the file is no TOML: {why}", "TOML", ONCE if twice else IN_QUOTES)


def _format(data: Mapping[str, Any]) -> None:
    found = data.get("format")
    if "format" not in data:
        raise refused("format", "is missing", f"format = {FORMAT}", "make it the first line of the file")
    if type(found) is not int or found != FORMAT:
        raise refused(
            "format",
            f"{said(found)} is not known",
            f"format = {FORMAT}",
            "a newer motorbus may read it: update motorbus, or write the file anew",
        )


def _tables(data: Mapping[str, Any], kind: str) -> list[tuple[str, Mapping[str, Any]]]:
    """The tables of one kind by their names, which are good ones."""
    tables = data.get(kind, {})
    if not isinstance(tables, dict):
        raise refused(kind, f"{said(tables)} is no table", f"tables [{kind}.NAME]")
    for name, table in tables.items():
        _name(kind, name)
        if not isinstance(table, dict):
            raise refused(path(kind, name), f"{said(table)} is no table", f"a table [{kind}.{name}]")
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
        f"call it {better}" if fits else "",
    )


def _known(table: Mapping[str, Any], known: Iterable[str], *where: str) -> None:
    for key in table:
        if key not in known:
            raise refused(path(*where, key), "there is no such key", listed(known), nearest(key, known))


# -- its tables ----------------------------------------------------------------------------------------------------


def _bus(name: str, table: Mapping[str, Any], check_address: CheckAddress | None) -> BusSpec:
    _known(table, keys.BUS, "bus", name)
    address = _value(table, keys.BUS["address"], ("bus", name))
    if check_address is not None:
        try:
            check_address(address)
        except RequestError as error:
            where = path("bus", name, "address")
            raise refused(where, error.summary, error.expected, error.advice) from None
    return BusSpec(address=address)


def _axis(name: str, table: Mapping[str, Any]) -> AxisSpec:
    _known(table, keys.AXIS, "axis", name)
    linear = "travel" in table
    return AxisSpec(
        **{key.name: _value(table, key, ("axis", name), linear=linear) for key in keys.AXIS.values()}
    )


def _group(name: str, table: Mapping[str, Any]) -> GroupSpec:
    _known(table, keys.GROUP, "group", name)
    where, example = path("group", name, "axes"), 'axes = ["shoulder", "elbow"]'
    axes = table.get("axes")
    if not isinstance(axes, list):
        what = "is missing" if "axes" not in table else f"{said(axes)} is no list"
        raise refused(where, what, f"names of axes: {example}")
    for place, axis in enumerate(axes):
        if not isinstance(axis, str):
            raise refused(f"{where}[{place}]", f"{said(axis)} is no name", f"names of axes: {example}")
    if not axes:
        raise refused(where, "it names no axis", f"names of axes: {example}")
    return GroupSpec(axes=tuple(axes))


def _pose(name: str, table: Mapping[str, Any], axes: Mapping[str, AxisSpec]) -> dict[str, float]:
    _axes_of(table, axes, "pose", name)
    rows = {axis: keys.AXIS["low"]._replace(name=axis) for axis in table}
    return {axis: _value(table, rows[axis], ("pose", name), linear=axes[axis].linear) for axis in table}


def _axes_of(table: Mapping[str, Any], axes: Mapping[str, AxisSpec], *where: str) -> None:
    if not table:
        raise refused(path(*where), "it names no axis", 'positions by the names of axes: shoulder = "10 deg"')
    for axis in table:
        if axis not in axes:
            raise refused(
                path(*where, axis),
                "there is no such axis",
                listed(axes, "an axis of the file"),
                nearest(axis, axes),
            )


# -- one field -----------------------------------------------------------------------------------------------------


def _value(table: Mapping[str, Any], key: Key, where: tuple[str, ...], *, linear: bool = False) -> Any:
    """The value of one field in the API's unit, or its default."""
    place = path(*where, key.name)
    if key.name not in table and key.needed:
        raise refused(place, "is missing", EXAMPLES[key.name])
    if key.name not in table and not any(key.usual):
        return key.default
    written = table.get(key.name, key.usual[linear])
    if key.measure is None:
        return _plain(written, key, place, linear)
    return _within(_number(written, key, place, linear), written, key, place, linear)


def _plain(written: Any, key: Key, place: str, linear: bool) -> Any:
    """A field that is no quantity: a word of several, a number, or text of a certain form."""
    choices = key.choices(linear)
    if choices:
        return _choice(written, key, place, linear)
    if key.kind is float and not is_number(written):
        raise refused(place, f"{said(written)} is no finite number", f"a number {key.range(linear)}")
    return _within(written, written, key, place, linear)


def _choice(written: Any, key: Key, place: str, linear: bool) -> Any:
    choices = key.choices(linear)
    for choice in choices:
        if type(written) is type(choice) and written == choice:
            return choice
    advice = _other_kind(linear) if key.name == "unit" and written in key.choices(not linear) else ""
    if isinstance(written, str) and not advice:
        advice = nearest(written, (str(choice) for choice in choices))
    raise refused(place, f"{said(written)} is not possible", listed(map(str, choices)), advice)


def _number(written: Any, key: Key, place: str, linear: bool) -> float:
    assert key.measure is not None
    quantity = key.measure.of(linear)
    if isinstance(written, str):
        try:
            return units.parse(written, quantity)
        except RequestError as error:
            advice = _other_kind(linear) if _fits(written, key.measure, not linear) else ""
            raise refused(place, error.summary, error.expected, advice) from None
    if is_number(written):
        return float(written)
    unit = next(iter(units.SCALES[quantity]))
    expected = f'a finite number in {keys.api_unit(quantity)}, or with its unit in quotes, as "10 {unit}"'
    raise refused(place, f"{said(written)} is no {quantity}", expected)


def _fits(written: str, measure: Measure, linear: bool) -> bool:
    try:
        units.parse(written, measure.of(linear))
    except RequestError:
        return False
    return measure.turning != measure.linear


def _other_kind(linear: bool) -> str:
    if linear:
        return "an axis with travel is linear, and its positions are lengths; leave travel out where it turns"
    return 'an axis is linear when it has travel = "5 mm", its way for one turn'


def _within(value: Any, written: Any, key: Key, place: str, linear: bool) -> Any:
    try:
        return msgspec.convert(value, key.hint)
    except msgspec.ValidationError:
        range_ = key.range(linear)
    if range_:
        raise refused(place, f"{said(written)} is out of range", range_)
    what = {"address": "bus address", "device": "device", "name": "name of a machine"}[key.name]
    advice = "ids stand in an axis" if key.name == "address" and "#" in str(written) else ""
    raise refused(place, f"{said(written)} is no {what}", EXAMPLES[key.name], advice)
