"""Which other program has a serial port open.

Most programs take no lock, and Linux lets several of them open one port. This module looks into /proc, as `lsof` does.
On other systems it finds no program.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from motorbus.link.errors import Owner

PTY_MASTERS = {"/dev/ptmx", "/dev/pts/ptmx"}
PTY_FOLDER = "/dev/pts/"


def find_user(device: str, proc: Path = Path("/proc")) -> Owner | None:
    """The first other process that has this device open; `device` is a path without symbolic links.

    Only processes that this user may inspect are seen. One with the master of a pseudo-terminal is a simulator or a
    terminal program, and does not count.
    """
    for process in proc.glob("[1-9]*"):
        if process.name == str(os.getpid()):
            continue
        opened: set[str] = set()
        with contextlib.suppress(OSError):  # it ended, or is not ours
            for descriptor in (process / "fd").iterdir():
                target = os.readlink(descriptor)
                # In a container the same name can be another device.
                if target in PTY_MASTERS or (target == device and descriptor.samefile(device)):
                    opened.add(target)
        if device in opened and not (device.startswith(PTY_FOLDER) and opened & PTY_MASTERS):
            return Owner(int(process.name), _program(process), device)
    return None


def _program(process: Path) -> str:
    """Name of the program; of the script where Python runs one; "?" when unknown."""
    with contextlib.suppress(OSError):
        words = (process / "cmdline").read_bytes().decode(errors="replace").split("\0")
        runs_script = Path(words[0]).name.startswith("python") and words[1:2] and not words[1].startswith("-")
        return Path(words[1] if runs_script else words[0]).name or "?"
    return "?"
