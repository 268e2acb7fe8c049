"""What must survive a crash: how far a guarded change of a device has come, on disk before its next step.

A servo whose id is half changed answers to a name that nobody remembers. So whoever changes one says first what it is
about to do, then each step, then how it ended; each record is on disk before the next frame leaves. One file per port,
beside its lock and held by it, so never two writers. It holds one change: beginning the next one replaces it, and
nothing begins while another is unfinished.
"""

from __future__ import annotations

import contextlib
import json
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from motorbus.core.operation import ASKED, INTENT, OUTCOME, Journal
from motorbus.errors import LinkError, MotorbusError, RequestError
from motorbus.link.lock import journals

FORMAT: Final = 1
REACHED: Final = "reached"
"""Among the facts of a change: the states it has been recorded in, in order."""


class Change(NamedTuple):
    """A guarded change that is not over: on which bus, by which verb, with which facts, since when (UTC).

    `facts` are those of its intent, and "reached", the states it has come to.
    """

    bus: str
    verb: str
    facts: dict[str, Any]
    begun: str

    @property
    def node(self) -> int:
        """The id that the device had when it began."""
        return int(self.facts["node"])


class BusJournal:
    """The journal of one bus, by its address; called with a `core.operation.Journal` it records it.

    Without a `path` it is kept in memory: simulated devices of this process are gone with it.
    """

    def __init__(self, bus: str, path: Path | None = None) -> None:
        self.bus = bus
        self.path = path
        self._memory = b""

    def __call__(self, event: object) -> None:
        """Record it; it is on disk when this returns.

        Raises RequestError while another change is unfinished, and for a file that a later version wrote; LinkError
        when the file cannot be written.
        """
        assert isinstance(event, Journal)
        open_change = self.unfinished()
        begins = event.state in (ASKED, INTENT)
        if open_change is not None and (begins or event.change != open_change.verb):
            raise _unfinished(open_change)
        if event.state == ASKED or (event.state == OUTCOME and open_change is None):
            return
        record = {"change": event.change, "state": event.state, "at": _now(), "facts": event.facts}
        if open_change is None:
            head = {"format": FORMAT, "what": "changes of devices on this bus", "bus": self.bus}
            self._replace(_line(head) + _line(record))
        else:
            self._append(_line(record))

    def unfinished(self) -> Change | None:
        """The change that has begun and has no outcome yet. Raises RequestError for a file of a later version."""
        return _read(self._content(), self.path)

    def warning(self) -> str:
        """What the user of this bus ought to know about it; "" when nothing is unfinished."""
        try:
            change = self.unfinished()
        except MotorbusError as error:
            return f"{error.summary}; {error.advice}"
        return f"{_described(change)} is unfinished; {_ADVICE.format(change.bus)}" if change else ""

    # -- the file -------------------------------------------------------------------------------------------------

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
        """The whole file anew: another one is made beside it and takes its name, so it is never half written."""
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
        """One more record; a torn one before it, which an interrupted write has left, gets a line of its own."""
        content = self._content()
        line = line if content.endswith(b"\n") else b"\n" + line
        if self.path is None:
            self._memory += line
            return
        try:
            _write(self.path, os.O_APPEND, line)
        except OSError as error:
            raise _unusable(self.path, "written", error) from error


def everywhere() -> list[Change]:
    """Every unfinished change on any bus of this user. Raises RequestError for a file that a later version wrote."""
    found = (_read(path.read_bytes(), path) for path in journals())
    return [change for change in found if change is not None]


def _read(content: bytes, path: Path | None) -> Change | None:
    """The change in these lines, when it has no outcome; a torn line is a record that was never made."""
    if not content:
        return None
    head, *rest = content.split(b"\n")
    bus = _bus(_parsed(head), path)
    change: Change | None = None
    for record in map(_parsed, rest):
        if record is None:
            continue
        state, facts = str(record.get("state")), record.get("facts") or {}
        if state == OUTCOME:
            change = None
        elif change is None:
            change = Change(
                bus, str(record.get("change")), {**facts, REACHED: [state]}, str(record.get("at"))
            )
        else:
            change.facts[REACHED].append(state)
    return change


def _bus(head: dict[str, Any] | None, path: Path | None) -> str:
    if head is None or head.get("format") != FORMAT:
        said = "no format" if head is None else f"format {head.get('format')!r}"
        raise RequestError(
            f"{path}: a journal with {said}, which this version of motorbus does not know",
            expected=f"format {FORMAT}",
            cause="a later version wrote it, or something else did",
            advice="finish what it holds with the version that wrote it, or, if every device of this bus has its id and"
            " rate, remove the file",
        )
    return str(head.get("bus"))


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        record = json.loads(line)
    except ValueError:
        return None
    return record if isinstance(record, dict) else None


def _line(record: dict[str, Any]) -> bytes:
    return json.dumps(record).encode() + b"\n"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _write(path: Path, flags: int, content: bytes) -> None:
    descriptor = os.open(path, os.O_WRONLY | getattr(os, "O_CLOEXEC", 0) | flags, 0o600)
    try:
        while content:
            content = content[os.write(descriptor, content) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    """Make a new name in it survive a crash; Windows has no such call, and does it by itself."""
    with contextlib.suppress(PermissionError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


_ADVICE: Final = "`motorbus recover {}` finishes it or takes it back"


def _described(change: Change) -> str:
    return f"{change.verb}() of #{change.facts.get('node')}, begun {change.begun},"


def _unfinished(change: Change) -> RequestError:
    return RequestError(
        f"{_described(change)} is unfinished on this bus",
        cause="the program that made the change was ended, or the device lost its supply, in the middle of it",
        advice=f"{_ADVICE.format(change.bus)}; nothing was sent",
    )


def _unusable(path: Path, what: str, error: OSError) -> LinkError:
    why = (error.strerror or str(error)).lower()
    return LinkError(
        f"the journal {path} cannot be {what}: {why}",
        cause="without it a crash in the middle of a change could not be mended",
        advice="make room, or set XDG_STATE_HOME to a folder that you may write to",
    )
