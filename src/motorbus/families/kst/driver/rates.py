"""At which bit rate is this bus? Listen at each; speak only where that can harm nobody.

The rate as shipped is "provisional" (the manual), so it must be found, and finding it by speaking at wrong rates
breaks the frames of a bus that is running. So nothing is sent unless somebody says that the bus is isolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from motorbus.core.family import Found
from motorbus.core.steps import Emit, Exclusive, Progress, SetBitrate, with_cleanup
from motorbus.errors import LinkError, LinkLost, RequestError
from motorbus.families.kst import wire
from motorbus.families.kst.driver.dialect import PLAIN, Dialect
from motorbus.families.kst.driver.identity import code_of
from motorbus.families.kst.driver.listening import Heard, heard
from motorbus.families.kst.driver.refusals import above_zero
from motorbus.families.kst.driver.scanning import Skipped, at_one_rate
from motorbus.families.kst.table import RATES

LISTEN: Final = 1.0
"""s at each rate; traffic of 1 Hz and more is heard."""


class BitRates(NamedTuple):
    """What a search found.

    `rate` (bit/s) is None when it is not known; `heard` says what was heard at each rate that was listened to; `found`
    are the servos that answered, where anything was sent.
    """

    rate: int | None
    heard: dict[int, Heard]
    found: tuple[Found, ...] = ()


async def scan_bit_rates(
    dialect: Dialect = PLAIN,
    *,
    rates: Sequence[int] = RATES,
    isolated: bool = False,
    seconds: float = LISTEN,
) -> BitRates:
    """Find the bit rate of a bus: `seconds` of listening at each rate, then, only with `isolated`, asking.

    A frame that comes whole proves a rate, and the search ends. Errors rule one out. Where all are silent nothing is
    sent unless the caller says that the bus is isolated: that no machine depends on it. A rate that the adapter lacks
    is left out and reported as `Skipped`. The rate is set again at the end. Raises RequestError for an
    impossible rate, and for an adapter that cannot just listen unless `isolated`.
    """
    for rate in rates:
        code_of(rate)
    above_zero("seconds", seconds, "s")
    present = await SetBitrate(0)
    search = _searched(dialect, tuple(rates), isolated, seconds)
    return await Exclusive(with_cleanup(search, lambda: SetBitrate(present)))


async def _searched(dialect: Dialect, rates: Sequence[int], isolated: bool, seconds: float) -> BitRates:
    verdicts: dict[int, Heard] = {}
    unable: LinkError | None = None
    for number, rate in enumerate(rates):
        try:
            verdicts[rate] = await heard(dialect, rate, seconds)
        except LinkLost:
            raise
        except (
            LinkError
        ) as error:  # it cannot listen, or does not have this rate, as slcan does not have 800k
            unable = error
            await Emit(Skipped(rate, error.summary))
            continue
        if verdicts[rate] is Heard.TRAFFIC:
            return BitRates(rate, verdicts)
        await Emit(Progress(number + 1, len(rates), f"{rate} bit/s: {verdicts[rate].value}"))
    if unable is not None and not verdicts:
        if not isolated:
            raise _cannot_listen(unable) from unable
        verdicts = dict.fromkeys(rates, Heard.SILENCE)
    return await _asked(dialect, verdicts) if isolated else BitRates(None, verdicts)


async def _asked(dialect: Dialect, verdicts: dict[int, Heard]) -> BitRates:
    """The first rate at which somebody answers, of those at which no errors were heard."""
    for rate in [rate for rate, verdict in verdicts.items() if verdict is Heard.SILENCE]:
        try:
            await SetBitrate(rate)
        except LinkLost:
            raise
        except LinkError:  # an adapter need not have every rate
            continue
        found = await at_one_rate(dialect, wire.NODES, rate, broadcast=True, careful=True)
        if found:
            return BitRates(rate, verdicts, tuple(found))
    return BitRates(None, verdicts)


def _cannot_listen(error: LinkError) -> RequestError:
    return RequestError(
        "this adapter cannot listen without taking part, so its bit rate is not searched for",
        cause=error.summary,
        expected="an adapter with a listen-only mode, or a bus on which nothing depends",
        advice="if nothing depends on this bus, say isolated=True; nothing was sent",
    )
