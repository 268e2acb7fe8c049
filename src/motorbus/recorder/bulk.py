"""A whole recording taken apart at once. The only file that imports numpy, and only when a recording is taken apart.

It gives what a `Decoder` gives that is fed the same, many times as fast; where a family has no rules for arrays, or
numpy is not there and nobody insists on it, a `Decoder` does the work.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import FAULTS, KINDS, Columns, Packet
from motorbus.core.family import Family
from motorbus.core.register import shown
from motorbus.core.request import Data
from motorbus.core.spans import cut_out
from motorbus.errors import MotorbusError, RequestError
from motorbus.recorder.decoder import Decoder, checked, fitting, timed
from motorbus.recorder.heard import captures_of, spoken
from motorbus.recorder.packets import Whole

_MISSING = "numpy is not installed, so a recording cannot be taken apart at once"


def decode(
    family: str | Family,
    recording: bytes | Sequence[CanFrame],
    way: str = "",
    at: Sequence[float] | None = None,
) -> Whole:
    """All packets and all noise of a recording, in arrays.

    `recording` are all bytes of a serial line, or all frames of a CAN bus. `at` are, if they are known, the times (s)
    when each byte or each frame came, as many as there are; a packet has that of its first byte, as if a `Decoder` had
    been fed byte by byte. `way` as in `Decoder`. Raises RequestError for an unknown family or way, for what is no
    recording of such a bus, and for times that are more or fewer or not finite; MotorbusError where numpy is not
    installed.
    """
    whose = spoken(family)
    frames = whose.link.kind == "frames"
    for one in _rows(recording) if frames else (recording,):
        fitting(frames, one)
    checked(way)
    np = _numpy()
    bulk = captures_of(whose).bulk
    whole = recording if frames else bytes(recording)  # type: ignore[arg-type]
    times = None if at is None else _times(np, at, len(whole), "frames" if frames else "bytes")
    kept: bytes | Sequence[Data] = whole
    if bulk is not None and len(whole):
        columns = bulk(np, whole, way)
    else:
        packets = _fed(whose, whole, way)
        kept, columns = [packet.data for packet in packets], _columns(np, packets)
    return Whole(_cut, kept, columns, None if times is None else times[columns.start])


def can_decode() -> bool:
    """Is numpy there?"""
    try:
        return find_spec("numpy") is not None
    except ValueError:  # it is barred in sys.modules
        return False


def _rows(recording: object) -> Sequence[object]:
    """One after the other, as frames are kept. Raises RequestError for what has no order, or comes only once."""
    if isinstance(recording, Sequence) and not isinstance(recording, str | bytes | bytearray | memoryview):
        return recording
    if isinstance(recording, bytes | bytearray | memoryview):
        fitting(True, recording)
    raise RequestError(
        f"{shown(recording)} is no recording of a CAN bus",
        expected="a list of CanFrame",
        advice="make a list of them, or feed them to a Decoder one by one",
    )


def _times(np: Any, at: Any, count: int, what: str) -> Any:
    """As an array. Raises RequestError where they are not as many, or one is no finite number."""
    try:
        times = np.asarray(at)
    except (TypeError, ValueError):  # rows within rows
        times = np.empty(())
    if times.ndim != 1:
        raise RequestError(
            f"at: {shown(at)} is no row of times", expected=f"a list, one for each of {count} {what}"
        )
    if len(times) != count:
        raise RequestError(
            f"at: {len(times)} times for {count} {what}",
            expected="as many of the one as of the other",
            advice="where only pieces have a time, feed them to a Decoder with theirs",
        )
    plain = times.dtype.kind in "iuf" and (times is at or bool not in {*map(type, at)})
    if not plain or not np.isfinite(times).all():
        for one in at:
            timed(one)
    return times.astype(float)


def _cut(recording: bytes, starts: Any, sizes: Any) -> list[bytes]:
    return cut_out(_numpy(), recording, starts, sizes)


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
