"""The parts of the measurement know a stop by its bytes, and what nobody takes is lost as on a wire."""

from __future__ import annotations

import os

from bench.estop_parts import STOP_FRAMES, _pass_on
from motorbus import families


def test_these_are_the_bytes_with_which_the_families_begin_a_stop() -> None:
    begun = [families.load(name).stop({}).exchanges[0].request for name in ("feetech", "stepper")]
    for frame, request in zip(STOP_FRAMES, begun, strict=True):
        assert isinstance(request, bytes)
        assert request.startswith(frame)


def test_what_has_no_room_is_lost() -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    for _ in range(100):
        _pass_on(writer, bytes(4096))
    _pass_on(-1, b"nobody")
    assert os.read(reader, 4096) == bytes(4096)
    os.close(reader)
    os.close(writer)
