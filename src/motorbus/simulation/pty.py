"""The simulator's end of a pseudo-terminal, so that any program can open a simulated bus as a serial port.

The other end stays open here as well: a client that closes the port and another that opens it are then nothing
special, as with a real adapter. What no client reads is dropped, as on a wire.
"""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

from motorbus.errors import LinkError, RequestError
from motorbus.link.lock import served_by_simulator
from motorbus.link.serial import line_speed

CHUNK = 4096
TERMINALS = "/dev/pts/"


class PtyMaster:
    """An open pseudo-terminal pair in raw mode. `slave_name` is what a client opens.

    Raises LinkError where the system has no pseudo-terminals.
    """

    def __init__(self) -> None:
        self._links: list[Path] = []
        self._pulled: list[Path] = []
        self._mark = contextlib.ExitStack()
        self._open()

    def _open(self) -> None:
        try:
            import tty

            self._master, self._slave = os.openpty()
        except (ImportError, AttributeError, OSError) as error:
            raise LinkError(
                f"no pseudo-terminal here: {error}", advice="serve the simulator on a TCP port instead"
            ) from error
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.slave_name = os.ttyname(self._slave)
        self._mark.enter_context(served_by_simulator(self.slave_name))

    def fileno(self) -> int:
        """Turns readable when a client has written."""
        return self._master

    def read(self) -> bytes:
        """What clients have written; b"" when nothing."""
        try:
            return os.read(self._master, CHUNK)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Send to whoever has the port open; returns how many bytes still had room."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def rate(self) -> int | None:
        """Bit/s that the client has set, so that a device set to another rate can stay silent; None: unknown."""
        return line_speed(self._master)

    def symlink(self, path: str | Path) -> None:
        """Give the port a stable name, until `close`.

        Raises RequestError when something is there that a simulator has not left behind, LinkError when the folder
        does not allow it.
        """
        link = Path(path)
        try:
            if os.path.lexists(link):
                self._check_left_behind(link)
            new = link.with_name(f"{link.name}.{secrets.token_hex(4)}")
            new.symlink_to(self.slave_name)
            new.replace(link)
        except OSError as error:
            raise LinkError(f"{link}: cannot make the symbolic link: {error.strerror}") from error
        self._links.append(link)

    def _check_left_behind(self, link: Path) -> None:
        target = str(link.readlink()) if link.is_symlink() else ""
        is_ours = target == self.slave_name or (target.startswith(TERMINALS) and not link.exists())
        if not is_ours:
            raise RequestError(
                f"{link} exists already" + (f" and leads to {target}" if target else ""),
                cause="another simulator serves it, or it is something else",
                advice="choose another name, or remove it",
            )

    @property
    def fixed(self) -> str:
        """Why it cannot be pulled and come back; "" when it can."""
        return (
            ""
            if self._links or self._pulled
            else "without a symbolic link nobody would find the terminal again"
        )

    def unplug(self) -> None:
        """Vanish, symbolic links included, until `plug`: whoever has it open is told that it has hung up."""
        links = list(self._links)
        self.close()
        self._pulled = links

    def plug(self) -> None:
        """Come back, as another terminal behind the same symbolic links. Raises as making it does."""
        self._open()
        links, self._pulled = self._pulled, []
        for link in links:
            self.symlink(link)

    def close(self) -> None:
        """Hang up and take the symbolic links away; calling it again does nothing."""
        for link in self._links:
            with contextlib.suppress(OSError):
                if str(link.readlink()) == self.slave_name:
                    link.unlink()
        self._links.clear()
        self._mark.close()
        for descriptor in (self._slave, self._master):
            if descriptor >= 0:
                os.close(descriptor)
        self._slave = self._master = -1
