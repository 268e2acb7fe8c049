"""What `--rate`, `--seconds` and `--smooth` say: every command with one refuses the same figures, in the same words."""

from __future__ import annotations

from motorbus.core.units import GREATEST_RATE, LEAST_RATE
from motorbus.errors import RequestError


def check_rate(rate: float) -> None:
    """Raise RequestError for a rate (Hz) at which nobody can do anything. Nothing was sent."""
    if not LEAST_RATE <= rate <= GREATEST_RATE:
        raise RequestError(
            f"--rate {rate:g}: it cannot be done so often",
            expected=f"cycles per second: {LEAST_RATE:g} to {GREATEST_RATE:g}",
            advice="nothing was sent",
        )


def check_seconds(span: float | None, advice: str = "leave it out to go on until Enter or Ctrl-C") -> None:
    """Raise RequestError, with this advice, for a time (s) that is none; None is one left out. Nothing was sent."""
    if span is not None and not span > 0:
        raise RequestError(
            f"--seconds {span:g}: not above 0",
            expected="s, above 0, as 10 or 1500ms",
            advice=f"{advice}; nothing was sent",
        )


def check_smooth(smooth: float) -> None:
    """Raise RequestError for a frequency (Hz) by which nothing can be smoothed; 0 is for nothing. Nothing was sent."""
    if smooth and not LEAST_RATE <= smooth <= GREATEST_RATE:
        raise RequestError(
            f"--smooth {smooth:g}: nothing can be smoothed by that",
            expected=f"Hz: {LEAST_RATE:g} to {GREATEST_RATE:g}, or 0 for nothing",
            advice="nothing was sent",
        )
