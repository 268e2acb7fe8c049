"""Two servos with one id whose answers break each other, with an adapter that reports no bus errors."""

from __future__ import annotations

import pytest

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.families.kst.bench import bench


class NoErrors(PerfectLine):
    """An adapter that tells of no bus errors, as most that speak slcan."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if isinstance(data, CanFrame) and data.id & ERROR_FLAG:
            return []
        return super().carry(sender, data, at)


def test_provision_refuses_two_servos_where_no_errors_are_reported() -> None:
    with bench(ids=(5, 5), line=NoErrors()) as there:
        there.simulator.servos[1].raw_position = 3
        with pytest.raises(RequestError, match="its id comes every time, its position never"):
            there.servo().provision(new_id=9)
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}
