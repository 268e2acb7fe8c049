"""The crash journal: the state of a guarded change of a device, on disk before the next step of the change.

After a crash a servo may have an unknown id, and a controller another project than its owner wrote. So a change is
recorded before it begins, at each step and at its end; each record is on disk before the next frame leaves. There is
one file per port, beside its lock. The holder of the lock is the only writer. A file holds one change: the next change
replaces it, and none begins while another is unfinished.
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
    """A guarded change that is not over: on which bus, by which verb, with which facts, since when (UTC).

    `facts` are those of its intent, and "reached", the states it has come to.
    """

    bus: str
    verb: str
    facts: dict[str, Any]
    begun: str

    @property
    def what(self) -> str:
        """What is unfinished, in words; "" when its facts do not say, and its verb has to."""
        return self._words("what")

    @property
    def cause(self) -> str:
        """Why it is unfinished, in words; "" when its facts do not say."""
        return self._words("cause")

    @property
    def advice(self) -> str:
        """What ends it, in words; "" when its facts do not say: then recover does."""
        return self._words("advice").replace("{bus}", self.bus)

    def _words(self, name: str) -> str:
        said = self.facts.get(name)
        return said if isinstance(said, str) else ""

    @property
    def node(self) -> int:
        """The id that the device had when it began. Raises RequestError for a record that does not say."""
        node = self.facts.get("node")
        if isinstance(node, bool) or not isinstance(node, int):
            raise RequestError(
                f"the journal of {self.bus} does not say which device was to change",
                cause="something else wrote it, or it was damaged",
                advice=_FORGET.format(self.bus),
            )
        return node


class BusJournal:
    """The journal of one bus, by its address; called with a `core.steps.JournalEntry` it records it.

    Without a `path` it is kept in memory: simulated devices of this process are gone with it.
    """

    def __init__(self, bus: str, path: Path | None = None) -> None:
        self.bus = bus
        self.path = path
        self._memory = b""

    def __call__(self, event: object) -> None:
        """Record it; it is on disk when this returns.

        Raises RequestError while another change is unfinished (by another verb, or with other facts), for a first
        record without a device, and for a file of a later version; LinkError when the file cannot be written.
        """
        assert isinstance(event, JournalEntry)
        open_change = self.unfinished()
        if open_change is not None and _hinders(open_change, event):
            raise _unfinished(open_change)
        if event.state == ASKED or (event.state == OUTCOME and open_change is None):
            return
        if open_change is None and "node" not in event.facts:
            raise RequestError(
                f"{event.change}() has reached {event.state!r} and nothing is known of its beginning",
                cause="its journal has been closed in the meantime, by `motorbus recover` or another task",
                advice="look how the device is before it is changed again",
            )
        record = {"change": event.change, "state": event.state, "at": _now(), "facts": event.facts}
        if open_change is None:
            head = {"format": FORMAT, "what": "changes of devices on this bus", "bus": self.bus}
            self._replace(_line(head) + _line(record))
        else:
            self._append(_line(record))

    def unfinished(self) -> Change | None:
        """The change that has begun and has no outcome yet. Raises RequestError for a file of a later version."""
        return _read(self._content(), self.path)

    def forget(self) -> None:
        """Leave nothing unfinished, whatever the file holds. Raises LinkError when it cannot be written."""
        self._replace(b"")

    def warning(self) -> str:
        """What the user of this bus ought to know about it; "" when nothing is unfinished."""
        try:
            change = self.unfinished()
        except MotorbusError as error:
            return f"{error.summary}; {error.advice}"
        return f"{_described(change)} is unfinished; {_advice(change)}" if change else ""

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
        """Replace the file by a new one, so it is never half written."""
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


def everywhere() -> list[Change | MotorbusError]:
    """Every unfinished change on any bus of this user; for a file that cannot be read, why: it hides no other."""
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
    """The files of unfinished changes on buses whose address at that time `matches`. Unreadable files are left out.

    A port may have lost its name: the user's link points to an adapter that is gone.
    """
    found = []
    for path in journals():
        with contextlib.suppress(MotorbusError, OSError):
            change = _read(path.read_bytes(), path)
            if change is not None and matches(change.bus):
                found.append(path)
    return found


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
        state, facts = str(record.get("state")), _plain(record.get("facts"))
        if state == OUTCOME:
            change = None
        elif change is None:
            before = facts.get(REACHED)
            reached = [*map(str, before if isinstance(before, list) else ()), state]
            change = Change(
                bus, str(record.get("change")), {**facts, REACHED: reached}, str(record.get("at"))
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
            advice="finish what it holds with the version that wrote it, or, if every device of this bus is as it"
            " should be, `motorbus recover BUS --forget` or remove the file",
        )
    return str(head.get("bus"))


def _plain(facts: object) -> dict[str, Any]:
    return facts if isinstance(facts, dict) else {}


def _parsed(line: bytes) -> dict[str, Any] | None:
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
    """Make a new name in it survive a crash; Windows has no such call, and does it by itself."""
    with contextlib.suppress(PermissionError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _hinders(change: Change, event: JournalEntry) -> bool:
    """This event is refused while that change is open."""
    if event.state == ASKED:
        return not (event.facts.get(READABLE) and change.facts.get(READABLE))
    return event.state == INTENT or not _belongs(event, change)


def _belongs(event: JournalEntry, change: Change) -> bool:
    """This is a record of that change: it has the same verb, and no fact differs."""
    return event.change == change.verb and all(
        change.facts.get(name, fact) == fact for name, fact in event.facts.items() if name != REACHED
    )


_FORGET: Final = "if every device of that bus is in order, `motorbus recover {} --forget` removes the record"


def _described(change: Change) -> str:
    what = change.what or f"{change.verb}() of #{change.facts.get('node')}"
    return f"{what}, begun {change.begun},"


def _advice(change: Change) -> str:
    if change.advice:
        return change.advice
    ends = "gives it back" if change.what else "finishes it or takes it back"
    return f"`motorbus recover {change.bus}` {ends}"


def _unfinished(change: Change) -> RequestError:
    return RequestError(
        f"{_described(change)} is unfinished on this bus",
        cause=change.cause
        or "the program that made the change was ended, or the device lost its supply, in the middle of it",
        advice=f"{_advice(change)}; nothing was sent",
    )


def _unusable(path: Path, what: str, error: OSError) -> LinkError:
    why = (error.strerror or str(error)).lower()
    return LinkError(
        f"the journal {path} cannot be {what}: {why}",
        cause="without it a crash in the middle of a change could not be mended",
        advice="make room, or set XDG_STATE_HOME to a folder that you may write to",
    )
