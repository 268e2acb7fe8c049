"""Whether what came back is an answer, or our own words.

For 15 of the 27 examples of the manual the reply is the request's first six bytes. On a line that hands back what is
sent, such as a half-duplex adapter or a loop of wire, nothing at all would seem to answer, start, stop, jog, home,
save and clear. Two things tell: five bytes more, the rest of the request with its checksum; and the length of a dump,
which no echo has.
"""

from __future__ import annotations

from enum import Enum

from motorbus.families.stepper.wire.frames import REPLY_LENGTH, REQUEST_LENGTH, decode_request, difference


class Echo(Enum):
    """What can be said so far.

    `NO`        it differs from the request, so it is no echo
    `POSSIBLE`  it is the request so far; wait until five bytes more would have come (5.2 ms at 9600 baud)
    `CERTAIN`   the whole request came back, its checksum with it
    """

    NO = "no"
    POSSIBLE = "possible"
    CERTAIN = "certain"


def echo(request: bytes, received: bytes) -> Echo:
    """Whether `received`, all that came since the request was sent, is its echo. Nothing received is `POSSIBLE`."""
    if received[:REQUEST_LENGTH] == request:
        return Echo.CERTAIN
    return Echo.POSSIBLE if request.startswith(received) else Echo.NO


def looks_like_echo(request: bytes) -> bool:
    """Whether a proper reply to this request may be its own first six bytes. Never for a dump, which is longer."""
    asked = decode_request(request)
    return (
        asked is not None
        and asked.command.name != "read_project"
        and not difference(request, request[:REPLY_LENGTH])
    )
