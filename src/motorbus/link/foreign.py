"""Which other program has a serial port open.

Most programs take no lock, and the kernel lets any number of them open one port. So before we open it we look, as
`lsof` does, whether somebody has it. This is Linux only; elsewhere nobody is found.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from motorbus.link.refusal import Owner

MASTERS = ("/dev/ptmx", "/dev/pts/ptmx")
TERMINALS = "/dev/pts/"


def who_holds(device: str, proc: Path = Path("/proc")) -> Owner | None:
    """The first other process that has this device open, as far as we may look; `device` has no symbolic links.

    A process that holds the other end of a pseudo-terminal is its simulator, not its user, and does not count.
    """
    for process in _others(proc):
        descriptors = _descriptors(process)
        if any(
            target == device and _is_same(process / "fd" / number, device) for number, target in descriptors
        ) and not _serves(process, descriptors, device):
            return Owner(int(process.name), _program(process), device)
    return None


def _others(proc: Path) -> Iterator[Path]:
    try:
        names = os.listdir(proc)
    except OSError:
        return
    own = str(os.getpid())
    yield from (proc / name for name in names if name.isdigit() and name != own)


def _descriptors(process: Path) -> list[tuple[str, str]]:
    """Number and target of every descriptor of this process; [] for one that is not ours to see."""
    found = []
    try:
        for number in os.listdir(process / "fd"):
            found.append((number, os.readlink(process / "fd" / number)))  # noqa: PERF401 - it may end half-way
    except OSError:
        pass
    return found


def _is_same(descriptor: Path, device: str) -> bool:
    """The same name can be another device in a container."""
    try:
        theirs, ours = descriptor.stat(), Path(device).stat()
    except OSError:
        return False
    return (theirs.st_dev, theirs.st_rdev) == (ours.st_dev, ours.st_rdev)


def _serves(process: Path, descriptors: list[tuple[str, str]], device: str) -> bool:
    """This process holds the master of the pseudo-terminal."""
    if not device.startswith(TERMINALS):
        return False
    index = device.removeprefix(TERMINALS)
    return any(
        target in MASTERS and _index(process / "fdinfo" / number) in (index, "")
        for number, target in descriptors
    )


def _index(about: Path) -> str:
    """The number of the pseudo-terminal this master belongs to; "" where the kernel does not tell."""
    try:
        lines = about.read_text().splitlines()
    except OSError:
        return ""
    return next((line.split()[1] for line in lines if line.startswith("tty-index:")), "")


def _program(process: Path) -> str:
    """The name of its program; of its script when an interpreter runs one."""
    try:
        words = (process / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        words = []
    name = Path(words[0]).name if words else ""
    if name.startswith("python") and len(words) > 1 and not words[1].startswith("-"):
        return Path(words[1]).name
    return name or "?"
