"""Changes of a file that a person wrote: comments, order and blanks stay theirs, and only what was meant changes.

That is proved each time: the new text must say what the old one said and the change, and describe a machine. The one
place that imports tomlkit, and only when a file is edited.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from math import isfinite
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from motorbus.errors import RequestError
from motorbus.motion.machine import reading
from motorbus.motion.machine.reading import CheckAddress
from motorbus.motion.machine.refusal import listed, nearest, path, refused

if TYPE_CHECKING:
    from tomlkit import TOMLDocument

Value: TypeAlias = str | int | float | Sequence[str] | Mapping[str, Any]
"""What stands at a place of the file: a quantity is text with its unit; a mapping is all of a table."""
Data: TypeAlias = dict[str, Any]
BY_HAND: Final = "make this change by hand"
_DEEPEST: Final = 3


def edited(
    text: str, changes: Mapping[str, Value | None], *, check_address: CheckAddress | None = None
) -> str:
    """The text with other values: `edited(text, {"axis.shoulder.zero": "12 deg", "pose.old": None})`.

    A place is `name`, or the names of a table and a key with points between. None takes it out, and a mapping says all
    of a table. A key that was not there comes last in its table, and a table last among its kind.
    Raises RequestError, naming the place, when the result would be no machine.
    """
    wanted, document = reading.toml(text), _document(text)
    for place, value in changes.items():
        keys = place.split(".")
        if not all(keys) or len(keys) > _DEEPEST:
            raise refused(
                path(place),
                "this is no place in the file",
                "axis.shoulder.zero, pose.ready, name",
                "name one",
            )
        for where, leaf in list(_leaves(wanted, keys, value)):
            _put_plain(wanted, where, leaf)
            _put(document, where, leaf)
    return _proved(text, document, wanted, check_address)


# -- text and document -----------------------------------------------------------------------------------------------


def _document(text: str) -> TOMLDocument:
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    try:
        return tomlkit.parse(text.removeprefix("\ufeff").replace("\r\n", "\n"))
    except (TOMLKitError, RecursionError) as error:
        raise refused(
            "", f"the file cannot be edited: {error}", "TOML, as in the documentation", BY_HAND
        ) from None


def _proved(text: str, document: TOMLDocument, wanted: Data, check_address: CheckAddress | None) -> str:
    """The new text, which says what is wanted and describes a machine, with the ends of lines of the old one."""
    after = document.as_string()
    try:
        same = _filled(reading.toml(after)) == _filled(wanted)
    except RequestError:
        same = False
    if not same:
        raise refused("", "this file cannot be edited without changing more", "[axis.shoulder]", BY_HAND)
    reading.read(after, check_address)
    start = "\ufeff" if text.startswith("\ufeff") else ""
    return start + (after.replace("\n", "\r\n") if "\r\n" in text else after)


def _filled(data: Data) -> Data:
    """The data without tables that hold nothing: [axis] alone on a line says as much as no such line."""
    return {key: value for key, value in data.items() if value != {}}


# -- values ----------------------------------------------------------------------------------------------------------


def _leaves(data: Data, keys: list[str], value: Value | None) -> Iterator[tuple[list[str], Any]]:
    """What a change is, key by key; a mapping takes out what it does not say."""
    if not isinstance(value, Mapping):
        yield keys, list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
        return
    here: Any = data
    for key in keys:
        here = here.get(key, {}) if isinstance(here, dict) else {}
    for key in here if isinstance(here, dict) else ():
        if key not in value:
            yield [*keys, key], None
    for key, inside in value.items():
        yield from _leaves(data, [*keys, key], inside)


def _put_plain(data: Data, keys: list[str], value: Any) -> None:
    """Change plain data. Raises RequestError where there is no table on the way, or nothing to take out."""
    *tables, last = keys
    here: Any = data
    for depth, key in enumerate(tables, start=1):
        here = here.setdefault(key, {})
        if not isinstance(here, dict):
            raise refused(path(*keys[:depth]), "this is no table", f"a table [{'.'.join(tables)}]", BY_HAND)
    if value is None and last not in here:
        raise refused(
            path(*keys), "it is not there, and cannot be taken out", listed(here), nearest(last, here)
        )
    if isinstance(value, float) and not isfinite(value):
        raise refused(
            path(*keys), f"{value} is no finite number", "a number, or text with a unit", "give one"
        )
    if value is None:
        del here[last]
    else:
        here[last] = deepcopy(value)


def _put(document: TOMLDocument, keys: list[str], value: Any) -> None:
    """Change the document in the same way."""
    from tomlkit.exceptions import TOMLKitError

    *tables, last = keys
    here: Any = document
    try:
        for depth, key in enumerate(tables, start=1):
            if key not in here:
                _begin(here, key, is_super=depth < len(tables))
            here = here[key]
        if value is None:
            here.remove(last)
        elif last in here or _body(here) is None:
            here[last] = value
        else:
            rest = _cut(here)
            here.append(last, value)
            _body(here).extend(rest)
    except (TOMLKitError, ValueError, TypeError) as error:
        raise refused(
            path(*keys), f"this cannot stand in a file: {error}", "text, a number", "give one"
        ) from None


def _begin(parent: Any, name: str, *, is_super: bool) -> None:
    """Add a table behind its sisters; what stood behind the last of them stands behind it now."""
    import tomlkit
    from tomlkit.items import InlineTable

    if isinstance(parent, InlineTable):
        parent[name] = tomlkit.inline_table()
        return
    table = tomlkit.table(is_super_table=is_super)
    sisters = [one for one in parent.values() if _body(one)] if not is_super else []
    if not sisters:
        parent[name] = table
        return
    rest = _cut(sisters[-1])
    _body(sisters[-1]).append((None, tomlkit.nl()))
    parent[name] = table
    _body(parent[name]).extend(rest)


def _body(table: Any) -> Any:
    """The lines of a table that has a head of its own, as tomlkit keeps them; None for others."""
    from tomlkit.items import Table

    return table.value.body if isinstance(table, Table) else None


def _cut(table: Any) -> list[Any]:
    """Take the lines behind the last key out of a table: they belong to what comes next, or to nobody."""
    body = _body(table)
    end = max((place for place, (name, _) in enumerate(body, start=1) if name is not None), default=0)
    rest = body[end:]
    del body[end:]
    return list(rest)
