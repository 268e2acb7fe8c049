"""A link that is gone, and may come again: what is known of that, and what is forgotten when it is there.

While it is gone every exchange fails at once, and nothing waits for it: what was asked for then may be wrong later, and
an order that comes by surprise is the worst of all. Whoever turns the crank has it looked for. When it is there again
nothing older is believed, for whatever is behind it may have started anew (decision record 0034).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from motorbus.bus import verdict
from motorbus.bus.known import Known
from motorbus.bus.pace import Pace
from motorbus.bus.ticket import Retune, Ticket
from motorbus.errors import LinkError, LinkLost, MotorbusError
from motorbus.link.base import Renewable

if TYPE_CHECKING:
    from motorbus.bus.turns import Turns


class Absence:
    """What the turns of a bus know of a link that is opened anew when it was lost.

    `renewal` is that link, None where a loss is the end; `gone` is why it has to be opened anew, None while it is
    there; `losses` counts how often it was lost; `anew` are told, with the lock held, that it is there again.
    `untuned`: its rate was changed while it was gone, as a scan does that ends at the rate at which it began.
    """

    rate: int
    known: Known
    listening: bool
    listen_only: bool
    renewal: Renewable | None = None
    gone: LinkLost | None = None
    losses = 0
    untuned = False
    anew: tuple[Callable[[], None], ...] = ()

    def _was_gone(self, error: LinkError) -> bool:
        """Note a loss, where this is one; was the link gone before?"""
        before = self.gone is not None and self.renewal is not None
        if self.renewal is not None and isinstance(error, LinkLost):
            self.gone = verdict.sought(error)
            self.losses += not before
            self.known.forget()  # a stop must not hold anybody where it was before
        return before

    def _fate(self, ticket: Ticket, away: bool, error: LinkError) -> tuple[Any, LinkError | None]:
        """What becomes of a ticket that waits when the link is lost, or is `away`: all but a change of rate fail."""
        if not (away and isinstance(ticket, Retune)):
            return None, error
        before, tune = self.rate, ticket.tune
        if tune.rate:
            self.rate, self.listening = tune.rate, tune.listen_only or self.listen_only
            self.untuned = True
        return before, None


def back(turns: Turns) -> bool:
    """Is the link there? One that is gone is looked for, if that is due; while it is not there, all that waits fails.

    Not to be called with the lock of the turns held: opening a port takes its time, and nobody is to wait for that.
    """
    gone, renewal, losses = turns.gone, turns.renewal, turns.losses
    if gone is None or renewal is None:
        return True
    try:
        renewal.renew(losses)
    except LinkError as error:
        with turns.lock:
            if turns.losses == losses and turns.gone is not None:
                turns.lost(error)
        return turns.gone is None
    with turns.lock:
        if turns.losses == losses and turns.gone is not None:
            _renewed(turns, renewal)
    return True


def rest(turns: Turns, until: float) -> None:
    """Let time pass without the link: at most until then, or until it is worth looking for it again."""
    renewal = turns.renewal
    if renewal is None:
        return
    with turns.lock:
        moment = min(until, turns.due())
    renewal.rest(moment)
    with turns.lock:
        turns.expire(renewal.now())


def _renewed(turns: Turns, link: Renewable) -> None:
    """It is there again: nothing that was known of what is behind it holds any more, but who was there."""
    turns.latency = link.latency
    turns.receiver = turns.family.receiver()
    turns.echo.doubt_anew()
    turns.trust.doubt_everyone(link.now(), turns.family.quiet_time(turns.rate))
    turns.known.forget()
    if turns.pace is not None:
        turns.pace = Pace(turns.pace.certain)
    turns.gone = None
    for tell in turns.anew:
        tell()
    if turns.untuned:
        _tune(turns, link)


def _tune(turns: Turns, link: Renewable) -> None:
    """It was opened as it was when it was lost; here it is set to what was asked for since."""
    turns.untuned = False
    try:
        link.tune(turns.rate, turns.listening)
    except MotorbusError as error:
        turns.rate = link.rate
        if isinstance(error, LinkError):
            turns.lost(error)
