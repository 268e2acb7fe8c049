"""A model of each register map."""

from __future__ import annotations

from typing import Final

MODELS: Final = {
    "sts": "sts3215",
    "smbl": "sm85blhv",
    "smcl": "sm60-360m",
    "scs": "scs0009",
    "scs2": "scs215-2",
    "hls": "hls3925",
}
