"""One owner per port: a lock file that names the process which holds the port.

Two programs on one half-duplex line destroy each other's frames. The operating system releases the lock of a process
that died, so a lock is never stale. Beside the lock are the socket for an emergency stop from other processes, and the
journal of the bus.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Self

from motorbus.errors import LinkError
from motorbus.link.errors import Owner, busy

SOCKET_LIMIT = 107  # bytes of a path in struct sockaddr_un of Linux, without the terminating zero
JOURNAL = ".journal"
SIMULATED = ".simulated"
TRIES = 20  # of 1 ms: a process that looks up the owner holds the file for a moment


def state_folder() -> Path:
    """The folder of locks, sockets and journals, made with mode 0700. Raises LinkError when it cannot be made.

    It is `motorbus` in $XDG_STATE_HOME, in ~/.local/state, or in the local application data of Windows.
    """
    if os.name == "nt":
        home = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    else:
        home = Path(os.environ.get("XDG_STATE_HOME", ""))
        if not home.is_absolute():  # the XDG specification: a relative path is ignored
            home = Path("~/.local/state").expanduser()
    return _make_private(home / "motorbus")


def _make_private(folder: Path) -> Path:
    """Make this folder with mode 0700. Raises LinkError, also when it belongs to another user."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not hasattr(os, "getuid") or folder.lstat().st_uid == os.getuid():
            folder.chmod(0o700)  # a link of another user could lead to a folder of ours
        elif os.getuid():
            raise PermissionError(f"{folder} belongs to another user")
    except OSError as error:
        raise LinkError(
            f"no folder for the locks of ports: {error}",
            advice="set XDG_STATE_HOME to a folder with a short path that you may write to",
        ) from error
    return folder


def real_name(port: str) -> str:
    """The canonical name of a port: no symbolic links, host names in lower case, localhost as 127.0.0.1."""
    if "://" in port:
        return re.sub(r"(?<=/)localhost(?=[:/]|$)", "127.0.0.1", port.lower().rstrip("/"))
    return port.upper() if os.name == "nt" else os.path.realpath(port)


def _file(port: str, suffix: str) -> Path:
    """A file in the state folder; its name is readable, and unique by a digest of the port."""
    name = real_name(port)
    readable = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[-32:]
    digest = hashlib.sha256(name.encode()).hexdigest()[:8]
    return state_folder() / f"{readable}-{digest}{suffix}"


def socket_path(port: str) -> Path:
    """Where the owner of this port listens for an emergency stop; short enough for a Unix socket.

    Raises LinkError when neither the state folder nor the temporary folder can be used.
    """
    path = _file(port, ".sock")
    if len(os.fsencode(path)) <= SOCKET_LIMIT:
        return path
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = _make_private(Path(tempfile.gettempdir()) / f"motorbus-{user}")
    if folder.lstat().st_uid != user:  # root may change the mode of any folder
        raise LinkError(f"{folder} belongs to another user", advice="set XDG_STATE_HOME to a shorter path")
    return folder / f"{hashlib.sha256(os.fsencode(path)).hexdigest()[:16]}.sock"


def journal_path(port: str) -> Path:
    """The file that records guarded changes on this port."""
    return _file(port, JOURNAL)


def journals() -> list[Path]:
    """All journals of this user."""
    return sorted(state_folder().glob(f"*{JOURNAL}"))


class PortLock:
    """The exclusive right to one port, for at most one process; use it in a `with`, or `acquire` and `release` it."""

    def __init__(self, port: str, suffix: str = ".lock") -> None:
        self.port = port
        self.path = _file(port, suffix)
        self._descriptor: int | None = None
        self._pid = 0

    def acquire(self) -> Self:
        """Take the lock. Raises PortBusy with the `owner`."""
        for _ in range(TRIES):
            self._descriptor = _open_locked(self.path)
            if self._descriptor is not None:
                self._pid = os.getpid()
                owner = Owner(self._pid, program_name(), self.port)
                os.ftruncate(self._descriptor, 0)
                os.write(self._descriptor, json.dumps(owner._asdict()).encode())
                return self
            time.sleep(0.001)
        raise busy(self.port, _written_owner(self.path))

    def release(self) -> None:
        """Give the lock back, if it is held. In a forked child the file stays, for the parent."""
        if self._descriptor is None:
            return
        descriptor, self._descriptor = self._descriptor, None
        if self._pid == os.getpid():
            with contextlib.suppress(PermissionError):  # Windows does not remove an open file
                self.path.unlink(missing_ok=True)
        os.close(descriptor)

    @property
    def held(self) -> bool:
        """Whether this object holds the lock."""
        return self._descriptor is not None

    def owner(self) -> Owner | None:
        """The process that holds the port now."""
        return _written_owner(self.path) if _is_locked(self.path) else None

    def __enter__(self) -> Self:
        return self.acquire()

    def __exit__(self, *exc: object) -> None:
        self.release()


@contextlib.contextmanager
def opening(port: str, held: PortLock | None = None) -> Iterator[PortLock]:
    """Lock this port, unless the caller holds its lock already; release it when the block raises. Raises PortBusy.

    The lock of the block is not acquired when `held` is that of this port; its release does nothing.
    """
    lock = PortLock(port)
    if held is None or held.path != lock.path:
        lock.acquire()
    try:
        yield lock
    except BaseException:
        lock.release()
        raise


@contextlib.contextmanager
def served_by_simulator(port: str) -> Iterator[None]:
    """Mark this port as served by a simulator of this process, where the state folder can be used."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            stack.enter_context(PortLock(port, SIMULATED))
        yield


def is_simulated(port: str) -> bool:
    """Whether a running simulator of this user serves this port; False when unknown."""
    return PortLock(port, SIMULATED).owner() is not None


def holders() -> list[Owner]:
    """The owner of every port that a running motorbus process of this user holds."""
    locked = (path for path in sorted(state_folder().glob("*.lock")) if _is_locked(path))
    return [owner for path in locked if (owner := _written_owner(path)) is not None]


def _open_locked(path: Path) -> int | None:
    """The descriptor of this file with our lock on it; None while another process has the lock."""
    try:
        import fcntl
    except ImportError:  # Windows, which does not remove an open file: that is the lock
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
            return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL)
        return None
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(descriptor).st_ino == path.stat().st_ino:
            return descriptor
    except (BlockingIOError, FileNotFoundError):  # held, or removed between open and lock
        pass
    os.close(descriptor)
    return None


def _is_locked(path: Path) -> bool:
    """Whether a process holds the lock; a file alone may be left over."""
    try:
        import fcntl
    except ImportError:
        descriptor = _open_locked(path) if path.exists() else 0
        if descriptor:
            os.close(descriptor)
        return descriptor is None
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # shared: those who look do not see each other
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


def _written_owner(path: Path) -> Owner | None:
    """The owner that the file names, running or not."""
    try:
        about = json.loads(path.read_bytes())
        return Owner(int(about["pid"]), str(about["program"]), str(about["port"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def program_name() -> str:
    """The name of this program, for messages of other processes."""
    path = Path(sys.argv[0] if sys.argv else "")
    name = path.parent.name if path.name == "__main__.py" else path.name
    return name if name not in ("", "-c", "-m") else Path(sys.executable or "python").name
