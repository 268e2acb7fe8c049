"""The rate that a terminal is really set to.

The servos' rates 76 800 and 128 000 have no constant of their own in the terminal interface, and an adapter may round
what it was asked for. Linux tells the number itself; elsewhere only the usual rates can be named.
"""

from __future__ import annotations

import struct
import sys

TCGETS2 = 0x802C542A  # asm-generic/ioctls.h, sizeof(struct termios2) = 44; MIPS, PowerPC and SPARC differ
TERMIOS2 = struct.Struct("=4I20s2I")


def line_speed(descriptor: int) -> int | None:
    """Bit/s that this terminal, or the pseudo-terminal at this master, is set to; None when it cannot be told."""
    return (_exact(descriptor) if sys.platform == "linux" else None) or _usual(descriptor)


def _exact(descriptor: int) -> int | None:
    import fcntl

    try:
        told = fcntl.ioctl(descriptor, TCGETS2, bytes(TERMIOS2.size))
    except OSError:
        return None
    speed: int = TERMIOS2.unpack(told)[-1]
    return speed or None


def _usual(descriptor: int) -> int | None:
    import termios

    try:
        code = termios.tcgetattr(descriptor)[5]
    except termios.error:
        return None
    names = (name for name in vars(termios) if name[:1] == "B" and name[1:].isdigit())
    return next((int(name[1:]) for name in names if getattr(termios, name) == code), None) or None
