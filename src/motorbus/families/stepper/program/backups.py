"""What a controller has stored, kept as a file: the dumps as they came, and for reading eyes what they say.

The bytes are what counts, for they hold what no field names as well. A dump has no checksum; in the file each has one,
because a bit that has turned over in a file is not to be sent to a motor. What the comments say is not read back.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Final

from motorbus.core.register import shown
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.program import Program
from motorbus.families.stepper.table import PROJECTS, Order, Project, checked_order, decode_image

FORMAT: Final = 1
KIND: Final = "stepper backup"
LONGEST: Final = 1_000_000
"""Characters that such a file may have."""
_DIGITS: Final = 16
_KEYS: Final = frozenset({"format", "kind", "dump_order", "made", "version", "project"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Backup:
    """Dumps of 226 bytes by project, 1 to 4, as two readings agreed on each.

    `order` says which byte of a number comes first in them; `made` is when, and `version` by what, as text, where
    somebody has said so.
    """

    dumps: Mapping[int, bytes]
    order: Order = "little"
    made: str = ""
    version: str = ""

    @property
    def projects(self) -> tuple[int, ...]:
        """The numbers of the projects in it, in order."""
        return tuple(sorted(self.dumps))

    def image(self, number: int) -> bytes:
        """The 220 bytes of a project. Raises RequestError when it is not in it."""
        if number not in self.dumps:
            listed = ", ".join(map(str, self.projects))
            raise RequestError(
                f"there is no project {shown(number)} in this backup", expected=f"one of {listed}"
            )
        return self.dumps[number][wire.REPLY_LENGTH :]

    def project(self, number: int) -> Project:
        """The numbers of a project. Raises RequestError when it is not in it."""
        return decode_image(self.image(number), self.order)

    def program(self, number: int) -> Program:
        """A project as a program. Raises RequestError when it is not in it, or holds what no project can."""
        self.image(number)
        return Program.from_dump(self.dumps[number], name=f"project {number}", order=self.order)

    def text(self) -> str:
        """The file."""
        return "\n".join([*_head(self), *(line for number in self.projects for line in _lines(self, number))])

    @classmethod
    def parse(cls, source: str) -> Backup:
        """From the text of a file. Raises RequestError, naming the project, for what is damaged or none."""
        data = _toml(source)
        dumps: dict[int, bytes] = {}
        for entry in data["project"]:
            number, dump = _project(entry)
            if number in dumps:
                raise _wrong(f"project {number} is in it twice", "each project once")
            dumps[number] = dump
        made, version = (str(data.get(key, "")) for key in ("made", "version"))
        return cls(
            dumps=dumps, order=checked_order(data.get("dump_order", "little")), made=made, version=version
        )


def is_backup(source: str) -> bool:
    """Whether the text of a file says that it is one, damaged or not."""
    try:
        return tomllib.loads(source).get("kind") == KIND
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        return False


def _head(backup: Backup) -> Iterator[str]:
    yield "# What a stepper controller has stored. `dump` is what counts, comments are for reading."
    yield f"format = {FORMAT}"
    yield f'kind = "{KIND}"'
    yield f'dump_order = "{backup.order}"'
    for key, value in (("made", backup.made), ("version", backup.version)):
        if value:
            yield f"{key} = {_quoted(value)}"


def _lines(backup: Backup, number: int) -> Iterator[str]:
    dump = backup.dumps[number]
    yield ""
    yield "[[project]]"
    yield f"number = {number}"
    yield f'sha256 = "{_sum(dump)}"'
    yield "dump = '''"
    yield dump[: wire.REPLY_LENGTH].hex(" ").upper()
    for at in range(wire.REPLY_LENGTH, len(dump), wire.ROW_LENGTH):
        yield dump[at : at + wire.ROW_LENGTH].hex(" ").upper()
    yield "'''"
    yield from (f"# {line}".rstrip() for line in _said(backup, number))


def _said(backup: Backup, number: int) -> list[str]:
    if backup.project(number).is_cleared:
        return ["no steps: it was cleared"]
    try:
        return backup.program(number).text().splitlines()
    except RequestError as error:
        return [f"no program: {error.summary}"]


def _toml(source: str) -> dict[str, Any]:
    if len(source) > LONGEST:
        raise _wrong(f"it has {len(source)} characters", f"{LONGEST} at most")
    try:
        data = tomllib.loads(source)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise _wrong(f"it is not TOML: {error}", "a file that `backup` has written") from None
    if data.get("kind") != KIND:
        raise _wrong(f"kind = {shown(data.get('kind'))}", f'kind = "{KIND}"')
    if (found := data.get("format")) != FORMAT or isinstance(found, bool):
        raise _wrong(f"format = {shown(found)} is not known here", f"format = {FORMAT}")
    for key in data.keys() - _KEYS:
        raise _wrong(f"{shown(key)} is not known here", f"one of {', '.join(sorted(_KEYS))}")
    if not isinstance(data.get("project"), list) or not data["project"]:
        raise _wrong("there is no [[project]] in it", "one to four of them")
    return data


def _project(entry: object) -> tuple[int, bytes]:
    found = entry if isinstance(entry, Mapping) else {}
    number, digits, total = (found.get(key) for key in ("number", "dump", "sha256"))
    if not isinstance(number, int) or isinstance(number, bool) or not 1 <= number <= PROJECTS:
        raise _wrong(f"number = {shown(number)}", f"1 to {PROJECTS}")
    try:
        dump = bytes.fromhex(digits) if isinstance(digits, str) else b""
    except ValueError:
        dump = b""
    if fault := wire.dump_fault(dump, number):
        raise _wrong(
            f"project {number}: its dump is none: {fault}", f"{wire.DUMP_LENGTH} bytes in hexadecimal"
        )
    if total != _sum(dump):
        raise _wrong(f"project {number}: sha256 = {shown(total)} does not fit its dump", f'"{_sum(dump)}"')
    return number, dump


def _sum(dump: bytes) -> str:
    return sha256(dump).hexdigest()[:_DIGITS]


def _quoted(text: str) -> str:
    plain = "".join(letter if letter.isprintable() else " " for letter in text)
    return '"' + plain.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _wrong(what: str, expected: str) -> RequestError:
    return RequestError(
        f"this backup cannot be used: {what}",
        expected=expected,
        cause="another kind of file, or one that was changed or damaged",
        advice="take another copy of it; nothing was sent",
    )
