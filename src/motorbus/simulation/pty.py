"""The simulator's end of a pseudo-terminal, which any program can open as a serial port."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path
from typing import Final

from motorbus.errors import LinkError, RequestError
from motorbus.link.lock import served_by_simulator
from motorbus.link.serial import line_speed

CHUNK: Final = 4096
TERMINALS: Final = "/dev/pts/"


class PtyMaster:
    """A pseudo-terminal in raw mode, which also is the `Stream` of the programs that open it, one after the other.

    With `link` a symbolic link leads to it, and it can be unplugged and plugged. The other end stays open here, so that
    programs may come and go. Raises LinkError when the system has no pseudo-terminals or the link cannot be made,
    RequestError when something else is at `link`.
    """

    gone = False

    def __init__(self, link: str | Path | None = None) -> None:
        self.link = Path(link) if link is not None else None
        self._mark = contextlib.ExitStack()
        self._open()

    @property
    def name(self) -> str:
        """The path that a program opens."""
        return self.slave_name if self.link is None else str(self.link)

    @property
    def can_unplug(self) -> bool:
        """Whether programs find it again: by a link."""
        return self.link is not None

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
        try:
            self._make_link()
        except BaseException:
            self.close()
            raise
        self._mark.enter_context(served_by_simulator(self.slave_name))

    def fileno(self) -> int:
        return self._master

    def read(self) -> bytes:
        try:
            return os.read(self._master, CHUNK)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def rate(self) -> int | None:
        return line_speed(self._master)

    def set_rate(self, rate: int) -> None:
        """Set the terminal to this rate (bit/s), which a program that sets none then has."""
        import termios

        code = getattr(termios, f"B{rate}", None)
        if code is not None:
            settings = termios.tcgetattr(self._slave)
            settings[4] = settings[5] = code
            termios.tcsetattr(self._slave, termios.TCSANOW, settings)

    def unplug(self) -> None:
        """Hang up and remove the link until `plug`."""
        self.close()

    def plug(self) -> None:
        """Open another terminal behind the same link."""
        self._open()

    def close(self) -> None:
        """Hang up and remove the link; a second call does nothing."""
        if self.link is not None:
            with contextlib.suppress(OSError):
                if str(self.link.readlink()) == self.slave_name:
                    self.link.unlink()
        self._mark.close()
        for descriptor in (self._slave, self._master):
            if descriptor >= 0:
                os.close(descriptor)
        self._slave = self._master = -1

    def _make_link(self) -> None:
        if self.link is None:
            return
        try:
            if os.path.lexists(self.link):
                self._check_left_over(self.link)
            new = self.link.with_name(f"{self.link.name}.{secrets.token_hex(4)}")
            new.symlink_to(self.slave_name)
            new.replace(self.link)
        except OSError as error:
            raise LinkError(f"{self.link}: cannot make the symbolic link: {error.strerror}") from error

    def _check_left_over(self, link: Path) -> None:
        """Raise RequestError unless a simulator that ended has left this link."""
        target = str(link.readlink()) if link.is_symlink() else ""
        is_ours = target == self.slave_name or (target.startswith(TERMINALS) and not link.exists())
        if not is_ours:
            raise RequestError(
                f"{link} exists already" + (f" and leads to {target}" if target else ""),
                cause="another simulator serves it, or it is something else",
                advice="choose another name, or remove it",
            )
