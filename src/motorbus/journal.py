"""The crash journal: each state of a guarded change of a device is on disk before the next frame of the change leaves.

After a crash a servo may have an unknown id, and a controller a borrowed project. There is one file per port, beside
its lock, and the holder of the lock is the only writer. A file holds one change: the next change replaces it, and none
begins while another one is unfinished.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from motorbus.core.steps import ASKED, INTENT, OUTCOME, REACHED, READABLE, JournalEntry
from motorbus.errors import LinkError, MotorbusError, RequestError
from motorbus.link.lock import journals

FORMAT: Final = 1


class Change(NamedTuple):
    """An unfinished change: its bus, driver function, facts and begin (UTC).

    `facts` are those of its intent, and "reached": its states so far, in order.
    """

    bus: str
    verb: str
    facts: dict[str, Any]
    begun: str

    @property
    def what(self) -> str:
        """What is unfinished, for the user; "" when the facts have no text."""
        return self._text("what")

    @property
    def cause(self) -> str:
        """Why it is unfinished, for the user; "" when the facts have no text."""
        return self._text("cause")

    @property
    def advice(self) -> str:
        """How to end it, for the user; "" when the facts have no text."""
        return self._text("advice").replace("{bus}", self.bus)

    @property
    def node(self) -> int:
        """The id of the device when the change began. Raises RequestError for a record without one."""
        node = self.facts.get("node")
        if isinstance(node, bool) or not isinstance(node, int):
            raise RequestError(
                f"the journal of {self.bus} does not say which device was to change",
                cause="another program wrote it, or it was damaged",
                advice=f"if every device of that bus is in order, `motorbus recover {self.bus} --forget` removes it",
            )
        return node

    def describe(self) -> str:
        """What is unfinished, and since when."""
        what = self.what or f"{self.verb}() of #{self.facts.get('node')}"
        return f"{what}, begun {self.begun},"

    def remedy(self) -> str:
        """What the user does to end it."""
        effect = "gives it back" if self.what else "finishes it or takes it back"
        return self.advice or f"`motorbus recover {self.bus}` {effect}"

    def _text(self, name: str) -> str:
        text = self.facts.get(name)
        return text if isinstance(text, str) else ""


class BusJournal:
    """The journal of one bus, named by its address; a call with a `JournalEntry` records it.

    Without a `path` it is kept in memory, for simulated devices of this process.
    """

    def __init__(self, bus: str, path: Path | None = None) -> None:
        self.bus = bus
        self.path = path
        self._memory = b""

    def __call__(self, event: object) -> None:
        """Record an entry; it is on disk when this returns.

        Raises RequestError while another change is unfinished, for a first record without a device, and for a file of a
        later version; LinkError when the file cannot be written.
        """
        assert isinstance(event, JournalEntry)
        change = self.unfinished()
        if change is not None and _is_refused(event, change):
            raise _unfinished(change)
        if event.state == ASKED or (event.state == OUTCOME and change is None):
            return
        if change is None and "node" not in event.facts:
            raise RequestError(
                f"{event.change}() has reached {event.state!r}, and its beginning is not recorded",
                cause="its journal was closed meanwhile, by `motorbus recover` or another task",
                advice="look how the device is before it is changed again",
            )
        record = {"change": event.change, "state": event.state, "at": _now(), "facts": event.facts}
        if change is None:
            head = {"format": FORMAT, "what": "changes of devices on this bus", "bus": self.bus}
            self._replace(_line(head) + _line(record))
        else:
            self._append(_line(record))

    def unfinished(self) -> Change | None:
        """The change that has begun and has no outcome. Raises RequestError for a file of a later version."""
        return _parse(self._content(), self.path)

    def forget(self) -> None:
        """Leave no change unfinished. Raises LinkError when the file cannot be written."""
        self._replace(b"")

    def warning(self) -> str:
        """The warning for the user of this bus; "" when no change is unfinished."""
        try:
            change = self.unfinished()
        except MotorbusError as error:
            return f"{error.summary}; {error.advice}"
        return f"{change.describe()} is unfinished; {change.remedy()}" if change else ""

    # -- the file ------------------------------------------------------------------------------------------------

    def _content(self) -> bytes:
        if self.path is None:
            return self._memory
        try:
            return self.path.read_bytes()
        except FileNotFoundError:
            return b""
        except OSError as error:
            raise _unusable(self.path, "read", error) from error

    def _replace(self, content: bytes) -> None:
        """Replace the file by a new one, so that it is never half written."""
        if self.path is None:
            self._memory = content
            return
        new = self.path.with_name(f"{self.path.name}.new")
        try:
            _write(new, os.O_CREAT | os.O_TRUNC, content)
            new.replace(self.path)
            _sync_folder(self.path.parent)
        except OSError as error:
            raise _unusable(self.path, "written", error) from error

    def _append(self, line: bytes) -> None:
        """Append a record; a torn one before it gets a line of its own."""
        line = line if self._content().endswith(b"\n") else b"\n" + line
        if self.path is None:
            self._memory += line
            return
        try:
            _write(self.path, os.O_APPEND, line)
        except OSError as error:
            raise _unusable(self.path, "written", error) from error


def everywhere() -> list[Change | MotorbusError]:
    """All unfinished changes of this user, on any bus; for a file that cannot be read, the error."""
    found: list[Change | MotorbusError] = []
    for path in journals():
        try:
            change = BusJournal("", path).unfinished()
        except MotorbusError as error:
            found.append(error)
        else:
            found += [change] if change is not None else []
    return found


def find_files(matches: Callable[[str], bool]) -> list[Path]:
    """The files of unfinished changes on buses whose address `matches`; without unreadable files.

    A port may have lost its name: the link of the user leads to an adapter that is gone.
    """
    found = []
    for path in journals():
        with contextlib.suppress(MotorbusError, OSError):
            change = _parse(path.read_bytes(), path)
            if change is not None and matches(change.bus):
                found.append(path)
    return found


def _parse(content: bytes, path: Path | None) -> Change | None:
    """The unfinished change in these lines; a torn line is no record."""
    if not content:
        return None
    head, *lines = content.split(b"\n")
    bus = _parse_head(head, path)
    change: Change | None = None
    for record in map(_parse_line, lines):
        if record is None:
            continue
        state, facts = str(record.get("state")), record.get("facts")
        facts = facts if isinstance(facts, dict) else {}
        if state == OUTCOME:
            change = None
        elif change is None:
            before = facts.get(REACHED)
            reached = [*map(str, before if isinstance(before, list) else ()), state]
            verb, begun = str(record.get("change")), str(record.get("at"))
            change = Change(bus, verb, {**facts, REACHED: reached}, begun)
        else:
            change.facts[REACHED].append(state)
    return change


def _parse_head(line: bytes, path: Path | None) -> str:
    """The address of the bus."""
    head = _parse_line(line)
    if head is None or head.get("format") != FORMAT:
        text = "no format" if head is None else f"format {head.get('format')!r}"
        raise RequestError(
            f"{path}: a journal with {text}, which this version of motorbus does not know",
            expected=f"format {FORMAT}",
            cause="a later version wrote it, or another program",
            advice="finish the change with the version that wrote it or, if every device of this bus is in order, use"
            " `motorbus recover BUS --forget` or remove the file",
        )
    return str(head.get("bus"))


def _parse_line(line: bytes) -> dict[str, Any] | None:
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) else None


def _line(record: dict[str, Any]) -> bytes:
    return json.dumps(record).encode() + b"\n"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _write(path: Path, flags: int, content: bytes) -> None:
    descriptor = os.open(path, os.O_WRONLY | flags, 0o600)
    try:
        while content:
            content = content[os.write(descriptor, content) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    """Let a new name in this folder survive a crash. Windows does that by itself and has no such call."""
    with contextlib.suppress(PermissionError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _is_refused(event: JournalEntry, change: Change) -> bool:
    """Whether this entry belongs to another change than the unfinished one."""
    if event.state == ASKED:
        return not (event.facts.get(READABLE) and change.facts.get(READABLE))
    return (
        event.state == INTENT
        or event.change != change.verb
        or any(change.facts.get(name, fact) != fact for name, fact in event.facts.items() if name != REACHED)
    )


def _unfinished(change: Change) -> RequestError:
    return RequestError(
        f"{change.describe()} is unfinished on this bus",
        cause=change.cause
        or "the program that made it ended, or the device lost its supply, in the middle of it",
        advice=f"{change.remedy()}; nothing was sent",
    )


def _unusable(path: Path, what: str, error: OSError) -> LinkError:
    reason = (error.strerror or str(error)).lower()
    return LinkError(
        f"the journal {path} cannot be {what}: {reason}",
        cause="without it a change that a crash interrupts cannot be recovered",
        advice="make room, or set XDG_STATE_HOME to a folder that you may write to",
    )
