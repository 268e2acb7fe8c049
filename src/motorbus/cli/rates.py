"""What `--rate` and `--smooth` say: every command that takes one refuses the same figures, in the same words."""

from __future__ import annotations

from typing import Final

from motorbus.errors import RequestError

HIGHEST: Final = 1e6
"""Hz; on the quickest bus there is one byte takes longer than such a cycle."""
LOWEST: Final = 1e-6
"""Hz; a cycle in eleven days."""


def check_rate(rate: float) -> None:
    """Raise RequestError for a rate (Hz) at which nobody can do anything. Nothing was sent."""
    if not LOWEST <= rate <= HIGHEST:
        raise RequestError(
            f"--rate {rate:g}: it cannot be done so often",
            expected=f"cycles per second: {LOWEST:g} to {HIGHEST:g}",
            advice="nothing was sent",
        )


def check_smooth(smooth: float) -> None:
    """Raise RequestError for a frequency (Hz) by which nothing can be smoothed; 0 is for nothing. Nothing was sent."""
    if smooth and not LOWEST <= smooth <= HIGHEST:
        raise RequestError(
            f"--smooth {smooth:g}: nothing can be smoothed by that",
            expected=f"Hz: {LOWEST:g} to {HIGHEST:g}, or 0 for nothing",
            advice="nothing was sent",
        )
