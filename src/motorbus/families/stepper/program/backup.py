"""All projects of a controller as a TOML file: the dumps, each with a checksum, since a dump has none."""

from __future__ import annotations

from hashlib import sha256
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

from motorbus.errors import RequestError
from motorbus.families.stepper.parameters import PROJECTS, ROW_LENGTH, Order, Project, decode_image
from motorbus.families.stepper.program.file import Program, read_toml
from motorbus.families.stepper.protocol import DUMP_LENGTH, HEADER, READ_PROJECT, REPLY_LENGTH


class ProjectTable(Struct, kw_only=True, forbid_unknown_fields=True):
    """The dump of one project in hexadecimal, and the first 16 digits of its SHA-256."""

    number: Annotated[int, Meta(ge=1, le=PROJECTS)]
    sha256: str
    dump: str


class BackupFile(Struct, kw_only=True, forbid_unknown_fields=True):
    """A backup file, format 1."""

    format: Literal[1]
    kind: Literal["stepper backup"]
    dump_order: Order = "little"
    project: Annotated[list[ProjectTable], Meta(min_length=1, max_length=PROJECTS)]


class Backup(Struct, frozen=True, kw_only=True):
    """Dumps of 226 bytes by project; `order` is that of the bytes of a number in them."""

    dumps: dict[int, bytes]
    order: Order = "little"

    @property
    def projects(self) -> tuple[int, ...]:
        """The numbers of the projects in it, in order."""
        return tuple(sorted(self.dumps))

    def project(self, number: int) -> Project:
        """The numbers of a project. Raises RequestError if it is not in the backup."""
        if number not in self.dumps:
            listed = ", ".join(map(str, self.projects))
            raise RequestError(f"no project {number} in this backup", expected=f"one of {listed}")
        return decode_image(self.dumps[number][REPLY_LENGTH:], self.order)

    def text(self) -> str:
        """The file; comments give each project as a program."""
        lines = ["format = 1", 'kind = "stepper backup"', f'dump_order = "{self.order}"']
        for number in self.projects:
            dump = self.dumps[number]
            rows = [
                dump[at : at + ROW_LENGTH].hex(" ") for at in range(REPLY_LENGTH, DUMP_LENGTH, ROW_LENGTH)
            ]
            lines += ["", "[[project]]", f"number = {number}", f'sha256 = "{_checksum(dump)}"']
            lines += ["dump = '''", dump[:REPLY_LENGTH].hex(" "), *rows, "'''"]
            try:
                program = Program.from_dump(dump, order=self.order).text()
            except RequestError as error:
                program = f"no program: {error.summary}"
            lines += [f"# {line}".rstrip() for line in program.splitlines()]
        return "\n".join(lines) + "\n"

    @classmethod
    def parse(cls, source: str) -> Backup:
        """From the text of a file. Raises RequestError, naming the project, if it is damaged or no backup."""
        try:
            file = msgspec.convert(read_toml(source), BackupFile)
        except msgspec.ValidationError as error:
            raise _wrong(str(error)) from None
        dumps = {}
        for entry in file.project:
            try:
                dump = bytes.fromhex(entry.dump)
            except ValueError:
                dump = b""
            head = HEADER + bytes((READ_PROJECT, entry.number))
            if len(dump) != DUMP_LENGTH or not dump.startswith(head) or _checksum(dump) != entry.sha256:
                raise _wrong(f"project {entry.number}: its dump and its sha256 do not match")
            dumps[entry.number] = dump
        if len(dumps) < len(file.project):
            raise _wrong("a project is in it twice")
        return cls(dumps=dumps, order=file.dump_order)


def _checksum(dump: bytes) -> str:
    return sha256(dump).hexdigest()[:16]


def _wrong(what: str) -> RequestError:
    return RequestError(
        f"this backup cannot be used: {what}",
        expected="a file of `motorbus backup`",
        advice="take another copy of it",
    )
