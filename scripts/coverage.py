"""Writes docs/reference/coverage.md: what of each vendor's manual is there, in five places, and which test says so.

Commands are listed in tests/coverage/FAMILY.toml, one entry for each; objects (registers) come from the tables of the
family, so that a new row is on the page by itself. What stands on the page are claims: tests/test_coverage.py finds
every one of them true, or fails. What simulator and decoder make of an object is no claim but is seen while the page is
made (`scripts/proof.py`). `python -m scripts.coverage` writes the page, with `--check` it only compares.
"""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Iterator, Mapping
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


class Object(NamedTuple):
    """A row of a table, and where it is; `command` names the command that does what reading and writing cannot."""

    row: Entry
    maps: tuple[str, ...]
    api: tuple[str, ...]
    cli: tuple[str, ...]
    test: str
    command: str = ""


class Coverage(NamedTuple):
    """One family: what there is of its manual. `options` are those of the simulator for each register map."""

    family: Family
    title: str
    device: str
    ids: str
    commands: tuple[Command, ...]
    objects: tuple[Object, ...]
    maps: Mapping[str, Mapping[str, str]]

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
    cells: list[Command | Object] = [*commands, *objects]
    for one in cells:
        if not (one.api and one.cli and one.test):
            raise ValueError(f"{name}: a cell of {_name(one)} is empty")
    return Coverage(family, told["title"], told["device"], told["ids"], commands, objects, told["maps"])


def _command(told: Mapping[str, Any]) -> Command:
    lists = {key: tuple(told.get(key, ())) for key in ("api", "cli", "vectors", "before")}
    if not lists["vectors"]:
        raise ValueError(f"{told['name']}: no frame")
    return Command(**{**told, **lists})


def _objects(family: Family, told: Mapping[str, Any]) -> Iterator[Object]:
    rows: dict[str, list[str]] = {}
    for table_name in told["maps"]:  # of a map without a simulator nothing can be claimed
        for name in family.tables[table_name]:
            rows.setdefault(name, []).append(table_name)
    strangers = set(told.get("object", {})) - set(rows)
    if strangers:
        raise ValueError(f"no table has {', '.join(sorted(strangers))}")
    for name, maps in rows.items():
        yield _object(family.tables[maps[0]][name], tuple(maps), told)


def _object(row: Entry, maps: tuple[str, ...], told: Mapping[str, Any]) -> Object:
    own = told.get("object", {}).get(row.name, {})
    plain = row.writable and not row.protected
    verbs = [verb for verb, can in (("read", row.readable), ("write", plain)) if can]
    api = [f"{told['device']}.{verb}" for verb in verbs] + own.get("api", [])
    cli = [
        {"read": f"read BUS#ID {row.name}", "write": f"write BUS#ID {row.name}=VALUE"}[verb] for verb in verbs
    ]
    test = own.get("test") or told["tests"][_kind(row, plain)]
    if not row.readable and not plain and not own.get("command"):
        raise ValueError(f"{row.name} can be neither read nor written: which command does it?")
    return Object(row, maps, tuple(api), (*cli, *own.get("cli", [])), test, own.get("command", ""))


def _kind(row: Entry, plain: bool) -> str:
    """Which of a family's tests of all rows judges this one."""
    if plain and row.storage is Storage.EEPROM:
        return "kept"
    return "write" if plain and row.effect is Effect.NONE else "read"


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
            "\n### Objects\n",
            *_left_out(told),
            "| object | address | maps | access | API | shell | simulator | decoder | test |",
            "|---|---|---|---|---|---|---|---|---|",
            *objects,
            "",
        ]
    )


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
        _code(one.api),
        _shell(one.cli),
        simulator,
        "explains",
        _test(one.test),
    ]
    return f"| {' | '.join(cells)} |"


def _object_row(told: Coverage, one: Object) -> str:
    row = one.row
    address = str(row.address) if row.subindex is None else f"0x{row.address:04X}:{row.subindex:02X}"
    where = "all" if len(one.maps) == len(told.family.tables) else ", ".join(one.maps)
    unwritten = row.writable and len(one.api) == 1 and one.api[0].endswith(".read")
    access = f"{row.access.value}; no verb writes it yet" if unwritten else row.access.value
    cells = [f"`{row.name}`", address, where, access, _code(one.api), _shell(one.cli)]
    return f"| {' | '.join([*cells, *proven(told, one), _test(one.test)])} |"


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
