"""Which exit code means what, and the one place where an exception becomes one.

A script must be able to tell "nobody answered" from "the port is busy" without reading prose, so each class of
errors has a code. `docs/reference/exit-codes.md` prints this table, and a test holds the two equal.
"""

from __future__ import annotations

import sys
from enum import IntEnum
from typing import TYPE_CHECKING, Final

from motorbus import errors

if TYPE_CHECKING:
    from collections.abc import Mapping


class Exit(IntEnum):
    """What the program says to the shell when it ends."""

    OK = 0
    FAILURE = 1
    USAGE = 2
    PORT_NOT_FOUND = 3
    PORT_BUSY = 4
    NO_REPLY = 5
    PARTIAL = 6
    DEVICE_REFUSED = 7
    UNSAFE = 8
    VERIFICATION_FAILED = 9
    CANCELLED = 10


MEANINGS: Final[Mapping[Exit, str]] = {
    Exit.OK: "done",
    Exit.FAILURE: "failed for a reason that has no code of its own",
    Exit.USAGE: "the request itself is impossible; nothing was sent",
    Exit.PORT_NOT_FOUND: "there is no such port, or it went away",
    Exit.PORT_BUSY: "another program holds the port",
    Exit.NO_REPLY: "nothing valid came in time",
    Exit.PARTIAL: "part of it was done; the rest is named on stderr",
    Exit.DEVICE_REFUSED: "a device answered and said no",
    Exit.UNSAFE: "refused as unsafe: outside the limits, or it needs --yes or --expert",
    Exit.VERIFICATION_FAILED: "what was read back is not what was written, or what was stopped was not seen to rest",
    Exit.CANCELLED: "cancelled before it was complete",
}


class NeedsConsent(errors.MotorbusError):
    """What was asked for moves far, writes EEPROM or goes past a guard, and nobody agreed. Nothing was changed."""


class Partial(errors.MotorbusError):
    """Some devices did what was asked and others did not."""


class Unforeseeable(errors.MotorbusError):
    """What a dry run would send next depends on an answer that only a real run gets."""


CODES: Final[Mapping[type[BaseException], Exit]] = {
    errors.MotorbusError: Exit.FAILURE,
    errors.LinkError: Exit.FAILURE,
    errors.LinkFull: Exit.FAILURE,
    errors.PortNotFound: Exit.PORT_NOT_FOUND,
    errors.PortBusy: Exit.PORT_BUSY,
    errors.LinkLost: Exit.PORT_NOT_FOUND,
    errors.AnotherAdapter: Exit.PORT_NOT_FOUND,
    errors.WireError: Exit.FAILURE,
    errors.FramingError: Exit.FAILURE,
    errors.ChecksumError: Exit.FAILURE,
    errors.UnexpectedReply: Exit.FAILURE,
    errors.NoReply: Exit.NO_REPLY,
    errors.DeviceError: Exit.DEVICE_REFUSED,
    errors.RequestError: Exit.USAGE,
    errors.MotionError: Exit.FAILURE,
    errors.Refused: Exit.UNSAFE,
    errors.LimitExceeded: Exit.UNSAFE,
    errors.NotHomed: Exit.UNSAFE,
    errors.Stalled: Exit.FAILURE,
    errors.Faulted: Exit.FAILURE,
    errors.Overloaded: Exit.FAILURE,
    errors.Interrupted: Exit.CANCELLED,
    errors.VerificationFailed: Exit.VERIFICATION_FAILED,
    errors.OutcomeUnknown: Exit.FAILURE,
    NeedsConsent: Exit.UNSAFE,
    Partial: Exit.PARTIAL,
    Unforeseeable: Exit.FAILURE,
    KeyboardInterrupt: Exit.CANCELLED,
    BrokenPipeError: Exit.CANCELLED,
    OSError: Exit.FAILURE,
}


def exit_code(error: BaseException) -> Exit | None:
    """The code of this error, or None for what is a defect of the program and deserves its traceback."""
    if _is_parse_error(error):
        return Exit.USAGE
    return next((CODES[kind] for kind in type(error).__mro__ if kind in CODES), None)


def _is_parse_error(error: BaseException) -> bool:
    parser = sys.modules.get("cyclopts")  # whoever raised one has imported it
    return parser is not None and isinstance(error, parser.CycloptsError)


def table() -> str:
    """The table of the documentation, in Markdown."""
    rows = [f"| {code.value} | {MEANINGS[code]} | {_raised_by(code)} |" for code in Exit]
    return "\n".join(["| code | meaning | raised by |", "|---|---|---|", *rows])


def _raised_by(code: Exit) -> str:
    names = [kind.__name__ for kind, mapped in CODES.items() if mapped is code]
    return ", ".join(f"`{name}`" for name in names)
