"""Why an exchange failed, in words: what was sent, what came, what was expected, the likely cause, what to do."""

from __future__ import annotations

from typing import Any

from motorbus.bus.ticket import Flight
from motorbus.core.operation import ANY, CanFrame, Effect, Exchange
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

CAUSES = {
    "silence": (
        "no such id on this bus, another {rate}, no power, or a loose cable{bus}",
        "`motorbus scan BUS` lists who answers; add `{flag} all` to try every rate",
    ),
    "checksum": (
        "bytes changed on the way: a long or loose cable, missing ground, or two nodes with one id",
        "check the wiring; `motorbus scan BUS` shows whether two nodes share an id",
    ),
    "framing": (
        "the line carries something else: another {rate}, another program, electrical noise",
        "check the {rate} and that nothing else talks on this bus",
    ),
    "surplus": (
        "more bytes came than were asked for: two nodes with one id, an echo, or another host on the bus",
        "make sure that one program alone talks on this bus and that every id is there once",
    ),
    "echo": (
        "the adapter began, or ceased, to hand back what is sent",
        "check the adapter; open the bus again",
    ),
    "unexpected": (
        "the node sent a reply that belongs to another request: an old one that came late, or another host's",
        "make sure that one program alone talks on this bus",
    ),
    "early": (
        "the reply came sooner than it can travel: it is the answer to an earlier request",
        "nothing to do if it is rare; the value was not used",
    ),
}
ERRORS: dict[str, type[MotorbusError]] = {
    "silence": NoReply,
    "checksum": ChecksumError,
    "framing": FramingError,
    "surplus": UnexpectedReply,
    "echo": UnexpectedReply,
    "unexpected": UnexpectedReply,
    "early": UnexpectedReply,
}

SOUGHT = "it is looked for again whenever something is asked for; nothing of before is sent again"


WORDS = {
    "serial": {"rate": "baud rate", "flag": "--baud", "bus": ""},
    "CAN": {"rate": "bit rate", "flag": "--bitrate", "bus": ", a bus without its two terminating resistors"},
}
"""What things are called on a serial line, and on a CAN bus."""
TOLD = {
    (kind, line): (cause.format(**words), advice.format(**words))
    for kind, (cause, advice) in CAUSES.items()
    for line, words in WORDS.items()
}


def fault(flight: Flight) -> str:
    """The kind of failure of this try, a key of `CAUSES`."""
    if flight.spoiled:
        return flight.spoiled
    if flight.surplus:
        return "surplus"
    if not flight.noise:
        return "silence"
    kinds = [kind for kind, _ in flight.noise]
    return "checksum" if "checksum" in kinds else kinds[0] if kinds[0] in CAUSES else "silence"


def error(flight: Flight, kind: str, tries: int, said: str = "") -> MotorbusError:
    """The exception for an exchange that failed for good; `said` is what the adapter has to say of it, if anything."""
    exchange = flight.exchange
    dues = () if exchange.replies is ANY else exchange.replies
    node = dues[0].node if dues else None
    changes = exchange.effect is not Effect.NONE or not exchange.repeatable
    made = OutcomeUnknown if changes and dues and flight.left else ERRORS[kind]
    who = f"node {node}" if node is not None else "the bus"
    again = f" ({tries} tries)" if tries > 1 else ""
    if kind == "silence":
        what = f"{who} did not answer{again}"
    elif kind == "checksum":
        what = f"the answer of {who} was damaged{again}"
    else:
        what = f"no valid answer from {who}{again}"
    if made is OutcomeUnknown:
        what += "; whether the write took effect is not known"
    cause, advice = TOLD[kind, "CAN" if isinstance(exchange.request, CanFrame) else "serial"]
    return made(
        what,
        sent=exchange.request,
        received=_received(flight) if flight.noise or flight.got else b"",
        expected=f"{dues[0].length} bytes from {who}" if dues else "",
        cause=said or cause,
        advice=advice,
        node=node,
    )


def _received(flight: Flight) -> bytes:
    noise = [bytes(data) for _, data in flight.noise]
    return b"".join([*noise, *(reply.data for reply in flight.got.values())])


def latched(by: str) -> Interrupted:
    """The error for whatever an emergency stop drops or refuses; `by` says which process asked for it, and when."""
    return Interrupted(
        f"the bus is stopped: emergency stop latched {by}",
        advice="when it is safe, call reset() on the bus, in the process that owns it",
    )


def withdrawn() -> Interrupted:
    """The error for an order that was still on its way when its device was told to let go."""
    return Interrupted(
        "the order was withdrawn: its device was told to stop, or to let go, before the order was through",
        cause="a torque-off, or another stop, that was asked for later overtook it and ends it",
        advice="it may have been carried out before the stop, but not after it; give it again if it is still wanted",
    )


def ungated(exchange: Exchange[Any]) -> RequestError:
    """The error for an order on a bus that nobody has given a gate."""
    return RequestError(
        "this bus has no gate, so it refuses whatever moves a motor or switches its torque",
        sent=exchange.request,
        cause="the bus was built by hand, without the gate that open() puts in",
        advice="use motorbus.open(), or give the bus an `admit`; nothing was sent",
    )


def sought(error: LinkLost) -> LinkLost:
    """The same error, of a link that is looked for again; one that says so itself is left as it is."""
    if SOUGHT not in error.advice:
        advice = error.advice.removesuffix(", then open the bus anew") or "see to the other end"
        error.advice = f"{advice}; {SOUGHT}"
    return error


def outlived(exchange: Exchange[Any] | None = None) -> LinkLost:
    """The error for an order of what began before the link was lost."""
    return LinkLost(
        "the port was gone since this was begun, so it moves nothing any more",
        sent=b"" if exchange is None else exchange.request,
        cause="what was to be done may no longer be right: nobody knows what happened meanwhile",
        advice="begin it anew if it is still wanted; nothing of this was sent",
    )


def listening(exchange: Exchange[Any]) -> RequestError:
    """The error for an exchange while the link only listens."""
    return RequestError(
        "the bus only listens: nothing was sent",
        sent=exchange.request,
        cause="it was opened listen-only, or an operation listens for the bit rate",
        advice="open the bus without listen-only to speak on it",
    )


def cancelled() -> Interrupted:
    """The error for an exchange whose caller no longer waits."""
    return Interrupted("the exchange was abandoned", cause="its caller was interrupted or the bus was closed")
