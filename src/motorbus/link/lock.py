"""One owner per port, and a way to learn who it is.

Two programs on one half-duplex line destroy each other's frames, and neither can tell why. So whoever opens a port
holds a lock file named after it; the file says which process that is. The operating system drops the lock of a
process that died, so a lock is never stale. Beside the file lies the socket over which another process may ask for
an emergency stop.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Self

from motorbus.errors import LinkError
from motorbus.link.refusal import Owner, busy

SOCKET_LIMIT = 107  # bytes of a path in struct sockaddr_un on Linux, the terminating zero not counted
JOURNAL = ".journal"
SIMULATED = ".simulated"
TRIES = 50  # each a millisecond: how long somebody who only looks may be in the way


def state_folder() -> Path:
    """Where locks and sockets live: `motorbus` in the platform's state folder, made with mode 0700.

    $XDG_STATE_HOME or ~/.local/state; on Windows the local application data. Raises LinkError when it cannot be.
    """
    try:
        folder = _state_home() / "motorbus"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if stat.S_IMODE(folder.stat().st_mode) & 0o077:
            folder.chmod(0o700)
    except (OSError, RuntimeError) as error:
        raise LinkError(
            f"no folder for the locks of ports: {error}",
            advice="set XDG_STATE_HOME to a folder that you may write to",
        ) from error
    return folder


def _state_home() -> Path:
    if os.name == "nt":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    home = Path(os.environ.get("XDG_STATE_HOME", ""))
    return home if home.is_absolute() else Path.home() / ".local" / "state"  # relative ones do not count


def real_name(port: str) -> str:
    """One name for one port, whatever the user called it: symbolic links resolved, letters of a host lowered, and
    this machine by its number."""
    if "://" in port:
        return re.sub(r"(?<=/)localhost(?=[:/]|$)", "127.0.0.1", port.lower().rstrip("/"))
    return port.upper() if os.name == "nt" else os.path.realpath(port)


def _stem(port: str) -> str:
    """Readable, and different for different ports."""
    name = real_name(port)
    readable = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[-32:]
    return f"{readable}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def socket_path(port: str) -> Path:
    """Where the holder of this port listens for an emergency stop; short enough for a local socket everywhere."""
    folder = state_folder()
    path = folder / f"{_stem(port)}.sock"
    if len(os.fsencode(path)) <= SOCKET_LIMIT:
        return path
    digest = hashlib.sha256(os.fsencode(path)).hexdigest()[:16]
    return _short_folder() / f"{digest}.sock"


def journal_path(port: str) -> Path:
    """Where the changes of devices on this port are recorded that must not be forgotten by a crash."""
    return state_folder() / f"{_stem(port)}{JOURNAL}"


def journals() -> list[Path]:
    """Every such file of this user."""
    return sorted(state_folder().glob(f"*{JOURNAL}"))


def _short_folder() -> Path:
    """A folder of this user's with a short name, for when the state folder's is too long."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"motorbus-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or (found.st_uid, stat.S_IMODE(found.st_mode)) != (user, 0o700):
        raise LinkError(f"{folder}: somebody else has made it", advice="set XDG_STATE_HOME to a shorter path")
    return folder


class PortLock:
    """The right to use one port, held by at most one process; `acquire` it, `release` it, or use it in a `with`."""

    def __init__(self, port: str, suffix: str = ".lock") -> None:
        self.port = port
        self.path = state_folder() / f"{_stem(port)}{suffix}"
        self._descriptor: int | None = None
        self._pid = 0

    def acquire(self) -> Self:
        """Take it. Raises PortBusy, whose `owner` is the process that holds it."""
        for _ in range(TRIES):
            self._descriptor = _try(self.path)
            if self._descriptor is not None:
                self._pid = os.getpid()
                _sign(self._descriptor, Owner(self._pid, program_name(), self.port))
                return self
            owner = _signed(self.path)
            if owner is not None and is_alive(owner.pid):
                raise busy(self.port, owner)
            time.sleep(0.001)  # its owner has not signed yet, or somebody only looks
        raise busy(self.port, None)

    def release(self) -> None:
        """Give it back; does nothing when it is not held. What a fork has inherited stays with its parent."""
        if self._descriptor is None:
            return
        descriptor, self._descriptor = self._descriptor, None
        if os.name == "nt":  # an open file cannot be removed there
            os.close(descriptor)
            self.path.unlink(missing_ok=True)
        else:
            if self._pid == os.getpid():
                self.path.unlink(missing_ok=True)
            os.close(descriptor)

    @property
    def held(self) -> bool:
        """This process has it, by this."""
        return self._descriptor is not None

    def lent(self) -> PortLock:
        """The same right for whoever opens the port meanwhile; its release gives nothing back."""
        return _Lent(self.port)

    def owner(self) -> Owner | None:
        """The process that holds the port now, or None."""
        return _owner(self.path)

    def __enter__(self) -> Self:
        return self.acquire()

    def __exit__(self, *exc: object) -> None:
        self.release()


class _Lent(PortLock):
    """A lock that another object holds, and goes on holding."""

    def acquire(self) -> Self:
        return self


def taken(port: str, kept: PortLock | None = None) -> PortLock:
    """The lock of this port, which is ours from now on; `kept` is one that we have, maybe of this port.

    Raises PortBusy, as `PortLock.acquire`.
    """
    lock = PortLock(port)
    return kept.lent() if kept is not None and kept.held and kept.path == lock.path else lock.acquire()


@contextlib.contextmanager
def served_by_simulator(port: str) -> Iterator[None]:
    """Mark this port as one that a simulator of this process serves; without a state folder it stays unmarked."""
    mark = None
    with contextlib.suppress(OSError):
        mark = PortLock(port, SIMULATED).acquire()
    try:
        yield
    finally:
        if mark is not None:
            mark.release()


def is_simulated(port: str) -> bool:
    """A live simulator of this user serves this port; False for every port that is not known as simulated."""
    return PortLock(port, SIMULATED).owner() is not None


def holders() -> list[Owner]:
    """Every port that a live motorbus process of this user holds, and which process that is."""
    owners = (_owner(path) for path in sorted(state_folder().glob("*.lock")))
    return [owner for owner in owners if owner is not None]


def _try(path: Path) -> int | None:
    """The descriptor of this file, locked by us, or None."""
    try:
        import fcntl
    except ImportError:
        return _try_exclusive(path)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(descriptor).st_ino == path.stat().st_ino:
            return descriptor
    except (BlockingIOError, FileNotFoundError):  # held, or released and removed between open and lock
        pass
    os.close(descriptor)
    return None


def _try_exclusive(path: Path) -> int | None:
    """As above where there is no flock: the file is the lock. Windows refuses to remove one that is open."""
    owner = _signed(path)
    if os.name == "nt" or (owner is not None and not is_alive(owner.pid)):
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        return None


def _sign(descriptor: int, owner: Owner) -> None:
    os.ftruncate(descriptor, 0)
    os.write(descriptor, json.dumps(owner._asdict()).encode())


def _signed(path: Path) -> Owner | None:
    """Who signed this lock, alive or not."""
    try:
        about = json.loads(path.read_bytes())
        return Owner(int(about["pid"]), str(about["program"]), str(about["port"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _owner(path: Path) -> Owner | None:
    owner = _signed(path)
    return owner if owner is not None and is_alive(owner.pid) and _is_held(path) else None


def _is_held(path: Path) -> bool:
    """Somebody has this lock; the file alone may be left from a process that died."""
    try:
        import fcntl
    except ImportError:
        return path.exists()
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


def is_alive(pid: int) -> bool:
    """A process with this id exists. On Windows always true: asking would interrupt it."""
    if os.name == "nt":
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True


def program_name() -> str:
    """What this process calls itself, for the message that somebody else gets."""
    path = Path(sys.argv[0] if sys.argv else "")
    name = path.parent.name if path.name == "__main__.py" else path.name
    return name if name not in ("", "-c", "-m") else Path(sys.executable or "python").name
