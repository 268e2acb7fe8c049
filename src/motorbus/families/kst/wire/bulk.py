"""All frames of a whole recording at once.

Frames that say the same kind of thing are looked at once, by `said`; so what is told is what a `recording.Recording`
tells that is fed the same. numpy comes as an argument, so that nothing is loaded with this file.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import FAULTS, NOISE, Columns
from motorbus.families.kst.wire.frames import LENGTH
from motorbus.families.kst.wire.said import said

_FOREIGN: Final = FAULTS.index("foreign")
_HEAD: Final = 5
"""Bytes before the data in `CanFrame.flat()`."""


def frames_in(np: Any, frames: Sequence[CanFrame], way: str = "") -> Columns:
    """Each of these frames, as a `Recording` tells it. Frames that say the same kind of thing are looked at once."""
    identifiers, datas = [frame.id for frame in frames], [frame.data for frame in frames]
    sizes = np.array([*map(len, datas)])
    heads = np.frombuffer(b"".join([data[:4].ljust(4, b"\0") for data in datas]), np.uint8).reshape(-1, 4)
    first, second, third, fourth = heads.astype(np.int64).T
    names = np.array(identifiers, np.int64) << 5 | np.minimum(sizes, LENGTH + 1) << 1 | (third | fourth == 0)
    looks = names << 16 | first << 8 | second
    _, one, which = np.unique(looks, return_index=True, return_inverse=True)
    kind, node, mask, code = np.array([said(frames[place]) for place in one.tolist()]).T[:, which]
    heads_code = (first << 24 | third << 16 | second << 8 | fourth) & mask
    fault = np.where(kind == NOISE, _FOREIGN, 0)
    return Columns(np.arange(len(frames)), sizes + _HEAD, kind, node, np.where(mask, heads_code, code), fault)
