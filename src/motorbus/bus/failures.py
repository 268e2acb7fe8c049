"""Errors of a request: what was sent and received, the likely cause, and what to do."""

from __future__ import annotations

from typing import Any, Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import ANY, Effect, Request
from motorbus.errors import (
    ChecksumError,
    FramingError,
    Interrupted,
    LinkLost,
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    RequestError,
    UnexpectedReply,
)

SERIAL_WORDS: Final = {"rate": "baud rate", "bus": ""}
CAN_WORDS: Final = {
    "rate": "bit rate",
    "bus": ", a bus without its two terminating resistors",
}
FAULTS: Final[dict[str, tuple[type[MotorbusError], str, str]]] = {
    "silence": (
        NoReply,
        "no such id on this bus, another {rate}, no power, or a loose cable{bus}",
        "`motorbus scan BUS` lists who answers; `--rates all` tries every rate",
    ),
    "checksum": (
        ChecksumError,
        "bytes changed on the way: a long or loose cable, missing ground, or two nodes with one id",
        "check the wiring; `motorbus scan BUS` shows whether two nodes share an id",
    ),
    "framing": (
        FramingError,
        "the line carries something else: another {rate}, another program, electrical noise",
        "check the {rate} and that no other program sends on this bus",
    ),
    "surplus": (
        UnexpectedReply,
        "more bytes came than were asked for: two nodes with one id, an echo, or another host on the bus",
        "run one program on this bus and give every device its own id",
    ),
    "echo": (
        UnexpectedReply,
        "the adapter started or stopped echoing what is sent",
        "check the adapter; open the bus again",
    ),
    "unexpected": (
        UnexpectedReply,
        "the node sent a reply to another request: a late one, or one to another host",
        "run one program on this bus",
    ),
}
"""Faults of an attempt: the error, its likely cause and what to do."""
REOPEN: Final = ", then open the bus again"
RECONNECTING: Final = (
    "; the next request looks for the port again; requests of before the loss are not repeated"
)


def no_answer(
    request: Request[Any], fault: str, received: bytes, *, tries: int, sent: bool, diagnosis: str = ""
) -> MotorbusError:
    """The error for a request whose last attempt failed with this fault, and what was `received` then.

    `sent`: the request itself left, not only a probe. `diagnosis` is what the adapter reports, "" for nothing.
    """
    expected = () if request.expected is ANY else request.expected
    node = expected[0].node if expected else None
    kind, cause, advice = FAULTS[fault]
    unknown = bool(expected) and sent and (request.effect is not Effect.NONE or not request.repeatable)
    who = f"node {node}" if node is not None else "the bus"
    again = f" ({tries} tries)" if tries > 1 else ""
    summary = {
        "silence": f"{who} did not answer{again}",
        "checksum": f"the answer of {who} was damaged{again}",
    }.get(fault, f"no valid answer from {who}{again}")
    if unknown:
        kind = OutcomeUnknown
        summary += "; whether the write took effect is not known"
    words = CAN_WORDS if isinstance(request.wire, CanFrame) else SERIAL_WORDS
    return kind(
        summary,
        sent=request.wire,
        received=received,
        expected=f"{expected[0].length} bytes from {who}" if expected else "",
        cause=diagnosis or cause.format(**words),
        advice=advice.format(**words),
        node=node,
    )


def latched(by: str) -> Interrupted:
    """The error for a request that an emergency stop drops or refuses; `by` names the process and the time."""
    return Interrupted(
        f"the bus is stopped: emergency stop latched {by}",
        advice="when it is safe, call reset() on the bus, in the process that owns it",
    )


def stopped() -> Interrupted:
    """The error for a motion request that was waiting when its device was stopped."""
    return Interrupted(
        "the order was withdrawn: its device was stopped, or its torque switched off, before the order was done",
        cause="a stop that was requested later goes first and ends the orders that wait",
        advice="it may have been carried out before the stop, not after it; send it again if it is still wanted",
    )


def no_interlock(request: Request[Any]) -> RequestError:
    """The error for a motion request on a bus without an interlock."""
    return RequestError(
        "this bus has no gate, so it refuses requests that move a motor or switch its torque",
        sent=request.wire,
        cause="the bus was built without the gate that open() adds",
        advice="use motorbus.open(), or pass `interlock` to the bus; nothing was sent",
    )


def listen_only(request: Request[Any]) -> RequestError:
    """The error for a request while the link only listens."""
    return RequestError(
        "the bus only listens: nothing was sent",
        sent=request.wire,
        cause="it was opened listen-only, or a scan listens for the bit rate",
        advice="open the bus without listen-only",
    )


def read_only(request: Request[Any]) -> RequestError:
    """The error for a request that would change a device while the bus only reads."""
    return RequestError(
        "the bus only reads: nothing was sent",
        sent=request.wire,
        cause="`read_only` of the bus is set, as the doctor sets it",
        advice="open the bus again to write",
    )


def outlived(request: Request[Any] | None = None) -> LinkLost:
    """The error for a motion request of a procedure that began before the port was lost."""
    return LinkLost(
        "the port was lost after this procedure began, so it moves nothing any more",
        sent=b"" if request is None else request.wire,
        cause="devices may have restarted or moved meanwhile",
        advice="start it again if it is still wanted; nothing was sent",
    )


def lost(error: LinkLost, *, reconnects: bool) -> LinkLost:
    """The same error, saying whether this bus looks for the port."""
    advice = RECONNECTING if reconnects else REOPEN
    if advice not in error.advice:
        error.advice = f"{error.advice or 'check the cable'}{advice}"
    return error


def abandoned() -> Interrupted:
    """The error for a request whose caller no longer waits."""
    return Interrupted("the request was cancelled", cause="its caller was interrupted or the bus was closed")
