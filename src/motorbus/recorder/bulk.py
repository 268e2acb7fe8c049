"""A whole recording taken apart at once. The only file that imports numpy, and only when a recording is taken apart.

It gives what a `Decoder` gives that is fed the same, many times as fast; where a family has no rules for arrays, or
numpy is not there and nobody insists on it, a `Decoder` does the work.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from motorbus.core.capture import FAULTS, KINDS, Columns, Packet
from motorbus.core.family import Family
from motorbus.core.operation import CanFrame
from motorbus.errors import MotorbusError
from motorbus.recorder.decoder import Decoder, checked, fitting
from motorbus.recorder.heard import captures_of, family_of
from motorbus.recorder.packets import Whole

_MISSING = "numpy is not installed, so a recording cannot be taken apart at once"


def decode(
    family: str | Family,
    recording: bytes | Sequence[CanFrame],
    way: str = "",
    at: Sequence[float] | None = None,
) -> Whole:
    """All packets and all noise of a recording, in arrays.

    `recording` are all bytes of a serial line, or all frames of a CAN bus and, if they are known, their times `at`
    (s), one for each frame. `way` as in `Decoder`. Raises RequestError for an unknown family or way and for what is no
    recording of such a bus, MotorbusError where numpy is not installed.
    """
    spoken = family_of(family) if isinstance(family, str) else family
    frames = spoken.link.kind == "frames"
    for one in recording if frames and not isinstance(recording, bytes) else (recording,):
        fitting(frames, one)
    checked(way)
    np = _numpy()
    bulk = captures_of(spoken).bulk
    times = None if at is None else np.asarray(at, float)
    whole = recording if frames else bytes(recording)  # type: ignore[arg-type]
    if bulk is not None and len(whole):
        return Whole(whole, bulk(np, whole, way), times)
    packets = _fed(spoken, whole, way)
    return Whole([packet.data for packet in packets], _columns(np, packets), times)


def can_decode() -> bool:
    """Is numpy there?"""
    try:
        return find_spec("numpy") is not None
    except ValueError:  # it is barred in sys.modules
        return False


def _numpy() -> Any:
    try:
        import numpy
    except ImportError as error:
        raise MotorbusError(
            _MISSING, advice="pip install 'motorbus[numpy]', or feed it to a Decoder"
        ) from error
    return numpy


def _fed(family: Family, recording: bytes | Sequence[CanFrame], way: str) -> list[Packet]:
    """The same by a `Decoder`."""
    decoder = Decoder(family, way)
    pieces = [recording] if isinstance(recording, bytes) else recording
    return [*(packet for piece in pieces for packet in decoder.feed(piece)), *decoder.flush()]


def _columns(np: Any, packets: Sequence[Packet]) -> Columns:
    rows = [
        (one.start, len(one.data), KINDS.index(one.kind), one.node, one.code, FAULTS.index(one.fault))
        for one in packets
    ]
    return Columns(*np.array(rows, np.int64).reshape(-1, len(Columns._fields)).T)
