"""What `--rate`, `--seconds`, `--duration`, `--smooth` say: all commands refuse the same figures in the same words."""

from __future__ import annotations

from motorbus.core.units import MAX_RATE, MIN_RATE, parse
from motorbus.errors import RequestError


def check_rate(rate: float) -> None:
    """Raise RequestError for a rate (Hz) at which nobody can do anything. Nothing was sent."""
    if not MIN_RATE <= rate <= MAX_RATE:
        raise RequestError(
            f"--rate {rate:g}: it cannot be done so often",
            expected=f"cycles per second: {MIN_RATE:g} to {MAX_RATE:g}",
            advice="nothing was sent",
        )


def time_of(
    text: str, flag: str = "--seconds", advice: str = "leave it out to go on until Enter or Ctrl-C"
) -> float:
    """The time (s) that was typed behind a flag. Raises RequestError, with this advice, for one that is none."""
    advice = f"{advice}; nothing was sent"
    try:
        span = parse(text, "time")
    except RequestError as error:
        error.summary, error.advice = f"{flag}: {error.summary}", advice
        raise
    if not span > 0:
        raise RequestError(
            f"{flag} {text}: not above 0", expected="s, above 0, as 10 or 1500ms", advice=advice
        )
    return span


def check_smooth(smooth: float) -> None:
    """Raise RequestError for a frequency (Hz) by which nothing can be smoothed; 0 is for nothing. Nothing was sent."""
    if smooth and not MIN_RATE <= smooth <= MAX_RATE:
        raise RequestError(
            f"--smooth {smooth:g}: nothing can be smoothed by that",
            expected=f"Hz: {MIN_RATE:g} to {MAX_RATE:g}, or 0 for nothing",
            advice="nothing was sent",
        )
