"""Which other program has a serial port open.

Most programs take no lock, and Linux lets several of them open one port. This module looks into /proc, as `lsof` does.
On other systems it finds no program.
"""

from __future__ import annotations

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
    try:
        names = os.listdir(proc)
    except OSError:
        return None
    for name in names:
        if not name.isdigit() or name == str(os.getpid()):
            continue
        process = proc / name
        opened = _open_files(process)
        uses = any(
            target == device and _is_same(process / "fd" / number, device) for number, target in opened
        )
        if uses and not _serves(process, opened, device):
            return Owner(int(name), _program(process), device)
    return None


def _open_files(process: Path) -> list[tuple[str, str]]:
    """Number and target of every descriptor; what could be read when the process ended or denied access."""
    found = []
    try:
        for number in os.listdir(process / "fd"):
            found.append((number, os.readlink(process / "fd" / number)))  # noqa: PERF401 - keeps what was read
    except OSError:
        pass
    return found


def _is_same(descriptor: Path, device: str) -> bool:
    """The same device number too: in a container the same name can be another device."""
    try:
        theirs, ours = descriptor.stat(), Path(device).stat()
    except OSError:
        return False
    return (theirs.st_dev, theirs.st_rdev) == (ours.st_dev, ours.st_rdev)


def _serves(process: Path, opened: list[tuple[str, str]], device: str) -> bool:
    """Whether this process holds the master of the pseudo-terminal."""
    if not device.startswith(PTY_FOLDER):
        return False
    for number, target in opened:
        if target in PTY_MASTERS:
            index = ""  # older kernels do not report it
            try:
                lines = (process / "fdinfo" / number).read_text().splitlines()
                index = next((line.split()[1] for line in lines if line.startswith("tty-index:")), "")
            except OSError:
                pass
            if index in (device.removeprefix(PTY_FOLDER), ""):
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
