"""Which other program has a serial port open.

Most programs take no lock, and Linux lets several of them open one port. This module looks into /proc, as `lsof` does.
On other systems it finds no program.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from motorbus.link.errors import Owner

PTY_MASTERS = ("/dev/ptmx", "/dev/pts/ptmx")
PTY_FOLDER = "/dev/pts/"


def find_user(device: str, proc: Path = Path("/proc")) -> Owner | None:
    """The first other process that has this device open; `device` is a path without symbolic links.

    Only processes that this user may inspect are seen. The process at the other end of a pseudo-terminal is its
    simulator and does not count.
    """
    with contextlib.suppress(OSError):
        for name in os.listdir(proc):
            if not name.isdigit() or name == str(os.getpid()):
                continue
            opened = _open_files(proc / name)
            is_open = any(target == device and _is_same(path, device) for path, target in opened)
            if is_open and not _serves(opened, device):
                return Owner(int(name), _program(proc / name), device)
    return None


def _open_files(process: Path) -> list[tuple[Path, str]]:
    """Path and target of every descriptor; what could be read when the process ended or denied access."""
    found = []
    with contextlib.suppress(OSError):
        for path in (process / "fd").iterdir():
            found.append((path, os.readlink(path)))  # noqa: PERF401 - keeps what was read
    return found


def _is_same(descriptor: Path, device: str) -> bool:
    """Whether it is the same file too: in a container the same name can be another device."""
    try:
        return os.path.samefile(descriptor, device)
    except OSError:
        return False


def _serves(opened: list[tuple[Path, str]], device: str) -> bool:
    """Whether a process with these files holds the master of the pseudo-terminal."""
    if not device.startswith(PTY_FOLDER):
        return False
    number = device.removeprefix(PTY_FOLDER)
    for path, target in opened:
        if target in PTY_MASTERS:
            with contextlib.suppress(OSError):
                about = (path.parents[1] / "fdinfo" / path.name).read_text()
                if (
                    "tty-index:" not in about or f"tty-index:\t{number}\n" in about
                ):  # older kernels do not tell
                    return True
    return False


def _program(process: Path) -> str:
    """Name of the program; of the script where Python runs one; "?" when unknown."""
    try:
        words = (process / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return "?"
    name = Path(words[0]).name
    if name.startswith("python") and len(words) > 1 and not words[1].startswith("-"):
        return Path(words[1]).name
    return name or "?"
