"""Who else is there: nobody whose second id would obey unseen, the id as shipped always asked, a miss no silence."""

from __future__ import annotations

import pytest

import motorbus
from motorbus.core.can_frame import CanFrame
from motorbus.core.steps import Progress
from motorbus.errors import RequestError
from motorbus.families.feetech.driver import Node
from motorbus.families.feetech.driver.others import others_than


def test_the_id_as_shipped_is_asked_although_nobody_names_it() -> None:
    with motorbus.simulate("feetech", ids="1+3+4+9") as simulation, motorbus.open(simulation.url) as bus:
        events: list[object] = []
        assert bus.run(others_than(Node(3), [3, 4, 5], ()), report=events.append) == [4, 1]
        assert [event.total for event in events if isinstance(event, Progress)] == [4] * 4


def test_one_that_misses_the_first_question_is_asked_again() -> None:
    with motorbus.simulate("feetech", ids="3+4") as simulation, motorbus.open(simulation.url) as bus:
        receive = simulation.simulator.receive
        missed: list[bytes] = []

        def deaf(data: bytes | CanFrame, at: float) -> None:
            assert isinstance(data, bytes)
            if data[2] == 4 and not missed:
                missed.append(data)
            else:
                receive(data, at)

        simulation.simulator.receive = deaf  # type: ignore[method-assign]
        assert bus.run(others_than(Node(3), [3, 4], ())) == [4]
        assert missed


@pytest.mark.parametrize(
    ("second", "ids", "refused"), [(1, (7, 3, 1), True), (9, (7, 9), False), (20, (7, 3), False)]
)
def test_a_second_id_is_refused_where_it_is_somebody_elses(
    second: int, ids: tuple[int, ...], refused: bool
) -> None:
    with motorbus.simulate("feetech", ids="3+9", model="sts3215+hls3925") as simulation:
        simulation[9].memory["second_id"] = second
        with motorbus.open(simulation.url) as bus:
            if refused:
                with pytest.raises(RequestError, match="servo 9 has 1 as its second id"):
                    bus.run(others_than(Node(3), [9], ids))
            else:
                assert bus.run(others_than(Node(3), [9], ids)) == [9]
