"""Writes docs/reference/coverage.md: what of each vendor's manual is there, in five places, and which test says so.

Commands are listed in tests/coverage/FAMILY.toml, one entry for each; objects (registers) come from the tables of the
family, so that a new row is on the page by itself. What stands on the page are claims: tests/test_coverage.py finds
every one of them true, or fails. What simulator and decoder make of an object is no claim but is seen while the page is
made (`scripts/proof.py`). `python -m scripts.coverage` writes the page, with `--check` it only compares.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from motorbus import families
from motorbus.core.entry import Entry, Storage
from motorbus.core.family import Family
from motorbus.core.operation import Effect
from scripts.proof import Device, Order, Proof, by_name, by_order

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "reference" / "coverage.md"
DATA = ROOT / "tests" / "coverage"
VECTORS = ROOT / "tests" / "vectors"


class Command(NamedTuple):
    """An instruction or command of the manual, and where it is.

    `vectors`  frames of it, by their names in tests/vectors; `before` must be sent first
    `answers`  whether a device answers; if not, `changes` names what it changes
    `restarts` what it changes shows after a power cycle
    `map`      the register map of the simulated device; the first when left out
    `later`    what is said where there is no API or no command of the shell yet
    """

    name: str
    manual: str
    api: tuple[str, ...]
    cli: tuple[str, ...]
    vectors: tuple[str, ...]
    test: str
    answers: bool = True
    before: tuple[str, ...] = ()
    changes: str = ""
    restarts: bool = False
    map: str = ""
    later: str = ""


class Unsent(NamedTuple):
    """An instruction that is known and never sent, and why.

    `vectors`   frames of it, by their names in tests/vectors
    `encoder`   the function of the family's wire that refuses it, called with `arguments`
    `simulator` what a simulated device does instead of answering; `switch` names the switch of the simulator, if there
                is one, by which it answers when that is set to `answers`
    """

    name: str
    source: str
    because: str
    vectors: tuple[str, ...]
    encoder: str
    arguments: tuple[int, ...]
    simulator: str
    test: str
    switch: str = ""
    answers: str = ""


class Object(NamedTuple):
    """A row of a table, and where it is; `command` names the command that does what reading and writing cannot.

    `tests` are several where writing it does more in one map than in another; `never` says why nothing writes it, where
    that is meant to stay so.
    """

    row: Entry
    maps: tuple[str, ...]
    api: tuple[str, ...]
    cli: tuple[str, ...]
    tests: tuple[str, ...]
    command: str = ""
    never: str = ""


class Coverage(NamedTuple):
    """One family: what there is of its manual. `maps` holds the options of the simulator for each register map.

    `alike` says of rows that are not listed to which of those that are they are alike.
    """

    family: Family
    title: str
    device: str
    ids: str
    commands: tuple[Command, ...]
    objects: tuple[Object, ...]
    maps: Mapping[str, Mapping[str, str]]
    unsent: tuple[Unsent, ...] = ()
    alike: str = ""

    def settings(self, map_: str) -> dict[str, object]:
        """What a bus of these devices must be told."""
        known = {option.name for option in self.family.link.settings}
        return {name: value for name, value in self.maps[map_].items() if name in known}


def known() -> list[str]:
    """Every family that motorbus brings along."""
    return sorted(path.stem for path in DATA.glob("*.toml"))


def load(name: str) -> Coverage:
    """What is claimed for this family. Raises ValueError for a cell that would be empty."""
    told = tomllib.loads((DATA / f"{name}.toml").read_text(encoding="utf-8"))
    family = families.load(name)
    commands = tuple(_command(one) for one in told["command"])
    objects = tuple(_objects(family, told))
    unsent = tuple(_unsent(one) for one in told.get("unsent", ()))
    cells: list[Command | Object] = [*commands, *objects]
    for one in cells:
        reached = (one.api and one.cli) or (isinstance(one, Command) and one.later)
        if not (reached and all(tests_of(one))):
            raise ValueError(f"{name}: a cell of {_name(one)} is empty")
    for no in unsent:
        if not all(no[: len(no) - len(Unsent._field_defaults)]):
            raise ValueError(f"{name}: a cell of {no.name} is empty")
    return Coverage(
        family,
        told["title"],
        told["device"],
        told["ids"],
        commands,
        objects,
        told["maps"],
        unsent,
        told.get("alike", {}).get("because", ""),
    )


def _command(told: Mapping[str, Any]) -> Command:
    lists = {key: tuple(told.get(key, ())) for key in ("api", "cli", "vectors", "before")}
    if not lists["vectors"]:
        raise ValueError(f"{told['name']}: no frame")
    return Command(**{**told, **lists})


def _unsent(told: Mapping[str, Any]) -> Unsent:
    lists = {key: tuple(told.get(key, ())) for key in ("vectors", "arguments")}
    return Unsent(**{**told, **lists})


def _objects(family: Family, told: Mapping[str, Any]) -> Iterator[Object]:
    rows: dict[str, list[str]] = {}
    alike = told.get("alike", {}).get("rows", "")
    for table_name in told["maps"]:  # of a map without a simulator nothing can be claimed
        for name in family.tables[table_name]:
            if not (alike and re.fullmatch(alike, name)):
                rows.setdefault(name, []).append(table_name)
    strangers = set(told.get("object", {})) - set(rows)
    if strangers:
        raise ValueError(f"no table has {', '.join(sorted(strangers))}")
    for name, maps in rows.items():
        written = hasattr(family.devices.blocking, "write")
        yield _object([family.tables[map_][name] for map_ in maps], tuple(maps), told, written=written)


def _object(
    rows: Sequence[Entry], maps: tuple[str, ...], told: Mapping[str, Any], *, written: bool = True
) -> Object:
    """What there is of a row; `written` says whether devices of this family are written by name."""
    row = rows[0]
    own = told.get("object", {}).get(row.name, {})
    plain = row.writable and not row.protected and written
    verbs = [verb for verb, can in (("read", row.readable), ("write", plain)) if can]
    api = [f"{told['device']}.{verb}" for verb in verbs] + own.get("api", [])
    cli = [
        {"read": f"read BUS#ID {row.name}", "write": f"write BUS#ID {row.name}=VALUE"}[verb] for verb in verbs
    ]
    kinds = dict.fromkeys(_kind(one, plain, told["tests"]) for one in rows)
    tests = (own["test"],) if "test" in own else tuple(told["tests"][kind] for kind in kinds)
    if not row.readable and not plain and not own.get("command"):
        raise ValueError(f"{row.name} can be neither read nor written: which command does it?")
    more = own.get("command", ""), own.get("never", "")
    return Object(row, maps, tuple(api), (*cli, *own.get("cli", [])), tests, *more)


def _kind(row: Entry, plain: bool, tests: Mapping[str, str]) -> str:
    """Which of a family's tests of all rows judges this one; those of what moves are said where a family has them."""
    if plain and row.storage is Storage.EEPROM:
        return "kept_moves" if "kept_moves" in tests and row.effect is not Effect.PERSISTENT else "kept"
    if plain and row.effect is Effect.NONE:
        return "write"
    return "moves" if plain and "moves" in tests else "read"


def tests_of(one: Command | Object) -> tuple[str, ...]:
    """The tests that are named for this one."""
    return (one.test,) if isinstance(one, Command) else one.tests


def _name(one: Command | Object) -> str:
    return one.name if isinstance(one, Command) else one.row.name


def vectors(name: str) -> dict[str, str]:
    """The frames known of this family as people write them, by their names."""
    found = {}
    for file in sorted((VECTORS / name).glob("*.json")):
        for one in json.loads(file.read_text(encoding="utf-8")):
            data = one["hex"]
            found[one["id"]] = f"{one['can_id']}#{data.replace(' ', '')}" if "can_id" in one else data
    return found


HEAD = """# Coverage

What of each vendor's manual is there: every instruction, command and object, in five places. Each cell of this page
is a claim that a test finds true: the name exists in Python, the words are a command of the shell, the simulated
device answers the frame (or, where no answer is due, obeys: what is named changes), `motorbus decode` explains it, and
the test that is named is there. For each object and each register map its frames were sent to a simulated device, and
explained, when this page was made. A cell that would be empty fails the tests.

This page is made by `python -m scripts.coverage` from the tables of the families and from `tests/coverage`.
"""


def page() -> str:
    """The whole page."""
    return "\n".join([HEAD, *(_section(name) for name in known())])


def _section(name: str) -> str:
    told = load(name)
    frames = vectors(name)
    commands = [_command_row(one, frames) for one in told.commands]
    objects = [_object_row(told, one) for one in told.objects]
    return "\n".join(
        [
            f"## {told.title}\n",
            "### Instructions and commands\n",
            "| command | manual | frame | API | shell | simulator | decoder | test |",
            "|---|---|---|---|---|---|---|---|",
            *commands,
            *_never_sent(told, frames),
            "\n### Objects\n",
            *_left_out(told),
            *([f"{told.alike}\n"] if told.alike else []),
            "| object | address | maps | access | API | shell | simulator | decoder | test |",
            "|---|---|---|---|---|---|---|---|---|",
            *objects,
            "",
        ]
    )


def _never_sent(told: Coverage, frames: Mapping[str, str]) -> list[str]:
    """The instructions that are known and not used, each with its reason."""
    if not told.unsent:
        return []
    return [
        "\n### Known, and never sent\n",
        "The encoder refuses these, so that no command can send them; the decoder explains them when others do.\n",
        "| instruction | source | frame | why it is never sent | encoder | simulator | decoder | test |",
        "|---|---|---|---|---|---|---|---|",
        *(_unsent_row(one, frames) for one in told.unsent),
    ]


def _unsent_row(one: Unsent, frames: Mapping[str, str]) -> str:
    sent = "<br>".join(f"`{_short(frames[vector])}`" for vector in one.vectors)
    simulator = f"{one.simulator}; `{one.switch}={one.answers}`: answers" if one.switch else one.simulator
    cells = [one.name, one.source, sent, one.because, "refuses", simulator, "explains", _test(one.test)]
    return f"| {' | '.join(cells)} |"


def _left_out(told: Coverage) -> list[str]:
    """What to say of register maps that nothing is claimed for."""
    others = [name for name in told.family.tables if name not in told.maps]
    if not others:
        return []
    here, there = (", ".join(f"`{name}`" for name in names) for names in (told.maps, others))
    return [
        f"Of the map {here}. Those of {there} are described, read and decoded. No simulator has them yet, so",
        f"nothing is claimed for them here: [every register]({told.family.name}-registers.md).\n",
    ]


def _command_row(one: Command, frames: Mapping[str, str]) -> str:
    simulator = "answers" if one.answers else f"obeys: `{one.changes}`" if one.changes else "obeys"
    sent = "<br>".join(f"`{_short(frames[vector])}`" for vector in one.vectors)
    cells = [
        one.name,
        one.manual,
        sent,
        _code(one.api) or one.later,
        _shell(one.cli) or one.later,
        simulator,
        "explains",
        _test(one.test),
    ]
    return f"| {' | '.join(cells)} |"


def _object_row(told: Coverage, one: Object) -> str:
    row = one.row
    where = "all" if len(one.maps) == len(told.family.tables) else ", ".join(one.maps)
    access = row.access.value
    if row.writable and len(one.api) == 1 and one.api[0].endswith(".read"):
        access += f"; no verb writes it: {one.never}" if one.never else "; no verb writes it yet"
    cells = [f"`{row.name}`", _address(told, one), where, access, _code(one.api), _shell(one.cli)]
    return f"| {' | '.join([*cells, *proven(told, one), '<br>'.join(map(_test, one.tests))])} |"


def _address(told: Coverage, one: Object) -> str:
    """Where the row is; where maps have it at several places, which map has which."""
    places: dict[str, list[str]] = {}
    for map_ in one.maps:
        row = told.family.tables[map_][one.row.name]
        place = str(row.address) if row.subindex is None else f"0x{row.address:04X}:{row.subindex:02X}"
        places.setdefault(place, []).append(map_)
    if len(places) == 1:
        return next(iter(places))
    return "<br>".join(f"{place} ({', '.join(maps)})" for place, maps in places.items())


def proven(told: Coverage, one: Object) -> Proof:
    """What simulator and decoder make of this row, by every map that has it. Raises ValueError where one does not."""
    found = {map_: proof(told, one, map_) for map_ in one.maps}
    for map_, seen in found.items():
        for who, what in seen._asdict().items():
            if not what:
                raise ValueError(
                    f"{told.family.name}: the {who} knows nothing of {one.row.name} of the map {map_}"
                )
    said = [" or ".join(dict.fromkeys(column)) for column in zip(*found.values(), strict=True)]
    return Proof(*said)


def proof(told: Coverage, one: Object, map_: str) -> Proof:
    """The same by one map. Raises ValueError for a row that no verb reaches and whose command is not listed."""
    row = told.family.tables[map_][one.row.name]
    device = Device(told.family.configured(**told.settings(map_)), told.ids, told.maps[map_])
    if row.readable or not row.protected:
        return by_name(device, row)
    commands = {command.name: command for command in told.commands}
    if one.command not in commands:
        raise ValueError(f"{row.name}: there is no command {one.command!r}")
    command, frames = commands[one.command], vectors(told.family.name)
    sent, before = ([frames[name] for name in names] for names in (command.vectors, command.before))
    return by_order(device, row, Order(tuple(sent), tuple(before), command.changes, command.restarts))


def _short(frame: str) -> str:
    return frame if len(frame) <= 44 else f"{frame[:41]}..."


def _code(names: tuple[str, ...]) -> str:
    return "<br>".join(f"`{name}`" for name in names)


def _shell(lines: tuple[str, ...]) -> str:
    return "<br>".join(f"`{line}`" for line in lines)


def _test(test: str) -> str:
    return f"`{test.removeprefix('tests/')}`"


def main() -> int:
    """Write the page, or with --check see that the one there is the one that would be written."""
    text = page()
    if "--check" in sys.argv[1:]:
        return int(not PAGE.exists() or PAGE.read_text(encoding="utf-8") != text)
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
