"""The errors of motorbus.

    MotorbusError
    ├── LinkError            the port: cannot open, busy, lost                    (also OSError)
    │   ├── PortNotFound     there is no such port
    │   ├── PortBusy         another program holds it; `owner` names it
    │   ├── LinkFull         it takes no more data at present
    │   └── LinkLost         it was open and went away
    │       └── AnotherAdapter   and another adapter is there in its place
    ├── WireError            bytes came that are not an answer; they are attached
    │   ├── FramingError     no frame could be made of them
    │   ├── ChecksumError    a frame, but its checksum is wrong
    │   └── UnexpectedReply  a good frame that answers no request (echo, foreign, wrong content)
    ├── NoReply              nothing valid came in time                           (also TimeoutError)
    ├── DeviceError          the device answered and refused: `node`, `code`, `register`
    ├── RequestError         the caller asked for something impossible            (also ValueError)
    ├── MotionError          motion refused or ended early
    │   ├── Refused          the position is old or doubtful, or the axis must not move now: `reason`
    │   │   └── LimitExceeded    the goal lies outside the limits, or the limits are unknown
    │   ├── NotHomed         the reference is not known
    │   ├── Stalled          it stopped moving before it was there
    │   ├── Faulted          its device lost its torque or restarted: `reason`; until it is cleared
    │   ├── Overloaded       it pushes too hard for too long, or is too hot: `reason`
    │   └── Interrupted      a stop or a cancellation came in between
    ├── VerificationFailed   written, read back, and different
    └── OutcomeUnknown       sent, and whether it took effect cannot be known

A message has a summary, and what was sent, received and expected, the likely cause and what to do, where they are
known. The parts are attributes too.
"""

from __future__ import annotations


class MotorbusError(Exception):
    """Base of every error of this package. `summary` is one line; the other parts may be empty."""

    unmoved = False
    """True where it is certain that nothing has moved; False: it may have."""
    so_far: object = None
    """The part of the result that exists, as the trajectory that `teach` has recorded; None without one."""

    def __init__(
        self,
        summary: str,
        *,
        sent: object = b"",
        received: object = b"",
        expected: str = "",
        cause: str = "",
        advice: str = "",
        node: int | None = None,
    ) -> None:
        super().__init__(summary)
        self.sent = sent
        self.received = received
        self.expected = expected
        self.cause = cause
        self.advice = advice
        self.node = node

    @property
    def summary(self) -> str:
        """What happened, in one line."""
        return str(self.args[0])

    @summary.setter
    def summary(self, text: str) -> None:
        self.args = (text,)

    def parts(self) -> list[tuple[str, str]]:
        """The known parts after the summary, each with its name."""
        parts = (
            ("sent", _shown(self.sent)),
            ("received", _shown(self.received)),
            ("expected", self.expected),
            ("likely cause", self.cause),
            ("what to do", self.advice),
        )
        return [(name, text) for name, text in parts if text]

    def __str__(self) -> str:
        return "\n".join([self.summary, *(f"  {name}: {text}" for name, text in self.parts())])


def _shown(data: object) -> str:
    if isinstance(data, bytes | bytearray):
        return data.hex(" ").upper()
    return str(data) if data else ""


class LinkError(MotorbusError, OSError):
    """The port cannot be opened, is held by another program, or went away."""


class PortNotFound(LinkError):
    """There is no such port, or what has its name is none."""


class PortBusy(LinkError):
    """Another program holds the port; `owner` is its process id where it is known."""

    owner: int | None = None


class LinkFull(LinkError):
    """The port takes no more data at present; nothing of this data was sent."""


class LinkLost(LinkError):
    """The port was open and is gone (unplugged, connection closed)."""


class AnotherAdapter(LinkLost):
    """The port is gone, and another adapter has its name. Nothing was sent to it."""


class WireError(MotorbusError):
    """Bytes came in time but are not the answer; `received` holds them."""


class FramingError(WireError):
    """No frame could be made of the bytes."""


class ChecksumError(WireError):
    """A whole frame came and its checksum is wrong."""


class UnexpectedReply(WireError):
    """A good frame that is not the answer: an echo, another node's, or wrong content."""


class NoReply(MotorbusError, TimeoutError):
    """Nothing valid came before the deadline."""


class DeviceError(MotorbusError):
    """The device answered and refused. `code` is its own number, `register` what was asked for."""

    def __init__(self, summary: str, *, code: int = 0, register: str = "", **parts: object) -> None:
        super().__init__(summary, **parts)  # type: ignore[arg-type]
        self.code = code
        self.register = register


class RequestError(MotorbusError, ValueError):
    """The request itself is impossible: unknown or read-only register, value out of range. Nothing was sent."""

    unmoved = True


class MotionError(MotorbusError):
    """Motion was refused or ended early."""


class Refused(MotionError):
    """Motion was refused before anything was sent.

    `reason`: "limits", "step" (too far from the present position), "velocity", "stale" or "suspect" (position),
    "fault", "lease" or "unattended".
    """

    unmoved = True

    def __init__(self, summary: str, *, reason: str = "", **parts: object) -> None:
        super().__init__(summary, **parts)  # type: ignore[arg-type]
        self.reason = reason


class LimitExceeded(Refused):
    """The goal lies outside the limits, is not finite, or no limits are known. Nothing was sent.

    `at`: the first time (s from the beginning) at which a trajectory leaves the limits; None otherwise.
    """

    at: float | None = None

    def __init__(self, summary: str, *, reason: str = "limits", **parts: object) -> None:
        super().__init__(summary, reason=reason, **parts)


class NotHomed(MotionError):
    """The reference position is not known."""


class Stalled(MotionError):
    """It stopped moving before it was in position."""


class Faulted(MotionError):
    """The device of an axis has restarted or lost its torque; the axis gets no motion until the fault is cleared.

    `reason`: "restart" (its supply dipped) or "torque_lost" (its own protection, or another program).
    """

    def __init__(self, summary: str, *, reason: str = "", **parts: object) -> None:
        super().__init__(summary, **parts)  # type: ignore[arg-type]
        self.reason = reason


class Overloaded(MotionError):
    """Its motor pushed too hard for too long, off its goal, or is too hot: `reason` is "load" or "heat"."""

    def __init__(self, summary: str, *, reason: str = "", **parts: object) -> None:
        super().__init__(summary, **parts)  # type: ignore[arg-type]
        self.reason = reason


class Interrupted(MotionError):
    """A stop or a cancellation came in between."""


class VerificationFailed(MotorbusError):
    """What was read back differs from what was written."""


class OutcomeUnknown(MotorbusError):
    """The request was sent and no evidence says whether it took effect."""


def unread(why: MotorbusError, *, node: int, what: str = "the write") -> OutcomeUnknown:
    """The error for a request that was sent and could not be read back; `why` is the cause."""
    return OutcomeUnknown(
        f"{why.summary}; whether {what} took effect is not known",
        sent=why.sent,
        received=why.received,
        expected=why.expected,
        cause=why.cause,
        advice=why.advice,
        node=node,
    )
