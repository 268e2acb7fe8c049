"""Much of a FEETECH conversation cut into tiles at once, and which of them are sound packets.

A capture is nearly all packets that follow one another, so it pays to cut it by one regular expression and to sum
every piece up, without a step of Python for each. What does not fit is left to the search of `stream`: a tile that is
no sound packet says nothing but "search here".
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from operator import itemgetter
from zlib import adler32

from motorbus.families.feetech.wire.packets import SOUND

_LONGEST = 252
"""The greatest length field of a tile: a packet of 256 bytes, whose sum Adler-32 does not yet reduce."""
_LOW = (0xFF).__and__
_FIRST = itemgetter(0)
_SOUND = re.compile(bytes((SOUND + 1,)) + b"*")
"""The low half of Adler-32 is 1 + the sum of the bytes."""
_HEADED = re.compile(b"\xff*")


def tiles(data: bytes, top: int) -> list[bytes]:
    """All of `data` in pieces: what has the form of a packet with an id up to `top`, runs without FF, and single FF."""
    return _form(top).findall(data)


def sound_until(pieces: list[bytes]) -> Callable[[int], int]:
    """A function: all tiles from this one on are sound packets, up to which?"""
    sums = bytes(map(_LOW, map(adler32, pieces)))
    firsts = bytes(map(_FIRST, pieces))

    def until(index: int) -> int:
        return min(_end(_SOUND, sums, index), _end(_HEADED, firsts, index))

    return until


def _end(form: re.Pattern[bytes], data: bytes, start: int) -> int:
    """Where the run that begins here ends."""
    found = form.match(data, start)
    return found.end() if found else start


@cache
def _form(top: int) -> re.Pattern[bytes]:
    lengths = b"|".join(re.escape(bytes((length,))) + b".{%d}" % length for length in range(2, _LONGEST + 1))
    return re.compile(
        b"\xff\xff[\\0-%b](?:%b)|[^\xff]+|\xff" % (re.escape(bytes((top,))), lengths), re.DOTALL
    )
