"""What a movement was ended by, where that is that its lease was lost: whoever gave the order is told so."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from motorbus.errors import Interrupted, MotorbusError, Refused
from motorbus.motion.safety.gate import Gate


def blamed(error: MotorbusError, buses: Iterable[Any]) -> MotorbusError:
    """The error that says why: a movement that was ended because the lease was lost says so, and so do its notes.

    `buses` are those that it was on.
    """
    ended = isinstance(error, Interrupted) or (isinstance(error, Refused) and error.reason == "lease")
    gates = (bus.interlock for bus in buses if isinstance(bus.interlock, Gate)) if ended else ()
    loss = next((loss for gate in gates if (loss := gate.loss()) is not None), None)
    if loss is None:
        return error
    for note in getattr(error, "__notes__", ()):
        loss.add_note(note)
    loss.node = error.node
    return loss


def raise_blamed(error: MotorbusError, buses: Iterable[Any]) -> None:
    """Raise what it was ended by, where that is the loss of the lease."""
    why = blamed(error, buses)
    if why is not error:
        raise why from error
