"""No read of a KST servo returns a value of another request, whatever happens to the replies."""

from __future__ import annotations

from random import Random

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import MotorbusError
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.conftest import Rounds
from tests.families.kst.bench import Bench


class FalseReplies(PerfectLine):
    """Sends false replies in place of some or before them, the same for the same seed."""

    def __init__(self, probability: float) -> None:
        self.random = Random(7)
        self.probability = probability
        self.count = 0
        self.last = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            return super().carry(sender, data, at)
        assert isinstance(data, CanFrame)
        frames = [data]
        if len(data.data) == 8 and self.random.random() < self.probability:
            self.count += 1
            frames = self.random.choice([[], [data], self._false(data), [*self._false(data), data]])
            at += self.random.uniform(0.001, 0.5) * (frames == [data])
        self.last = max(at, self.last)  # a late reply delays the next ones
        return [Delivery(self.last, Side.HOST, one) for one in frames]

    def _false(self, frame: CanFrame) -> list[CanFrame]:
        """Another index, another sub-index, an acknowledgement: each with another value."""
        data, value = frame.data, bytes((frame.data[4] ^ 0x55,)) + frame.data[5:]
        index, subindex = data[:1] + b"\x03\x60" + data[3:4] + value, data[:3] + b"\x01" + value
        return [frame._replace(data=one) for one in (index, subindex, b"\x60" + data[1:4] + bytes(4))]


@pytest.mark.timeout(900)
@pytest.mark.parametrize("probability", [0.0, 0.06])
def test_read_returns_the_value_of_its_own_request(probability: float, rounds: Rounds) -> None:
    """The servo stands elsewhere before each read, and reports its position on the identifier of its replies."""
    line = FalseReplies(probability)
    with Bench(profile="kst-ext", line=line) as bench:
        bench.servo().write(report_interval=0.005)
        bench.link.write(CanFrame(5, b"\1\0"))
        servo, total, failed = bench.servo(), rounds(100_000, 1_000), 0
        for count in range(total):
            bench[5].raw_position = raw = count * 719 % 1800 - 900
            try:
                assert servo.read_raw("present_position") == {"present_position": raw}
            except MotorbusError:
                failed += 1
        assert bench.bus.statistics.other["notices"] > total / 100
        assert (line.count > total / 100) is bool(probability)
        assert failed <= probability * total * 5
