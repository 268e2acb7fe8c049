"""One servo, two with one id, or none."""

from __future__ import annotations

import pytest

from motorbus.core.can_frame import ERROR_FLAG, CanFrame
from motorbus.core.request import Data
from motorbus.errors import RequestError
from motorbus.families.kst.driver.identity import Presence, look, survey
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.families.kst.bench import abort, bench, node, play

ASK = "605#4000300000000000"


def test_one_look() -> None:
    assert play(look(node()), (ASK, "4f00300005000000")) == Presence(100.001, 1, 5)
    assert play(look(node()), (ASK, None)).answered is False
    refused = play(look(node()), (ASK, abort(0x3000, 0x0602_0000)))
    assert (refused.answered, refused.reads_back) == (True, None)
    assert play(look(node()), (ASK, ["4f00300005000000"] * 2)).several is True
    assert play(look(node()), (ASK, "4b02600005000000")).answered is False, "a late answer to something else"


def test_one_servo_is_one() -> None:
    with bench() as there:
        found = there.run(survey(there.servo()))
        assert (found.answered, found.several, found.reads_back, found.errors) == (True, False, 5, False)
        assert there.run(survey(there.servo(6))).answered is False


def test_a_second_answer_shows() -> None:
    with bench(duplicate="5", duplicate_delay=0.0002) as there:
        assert there.run(survey(there.servo())).several is True


def test_answers_that_break_each_other_show() -> None:
    with bench(ids=(5, 5)) as there:
        there.simulator.servos[1].raw_position = 3
        found = there.run(survey(there.servo()))
        assert (found.most, found.errors, found.several) == (1, True, True)


class NoErrors(PerfectLine):
    """An adapter that tells of no bus errors, as most that speak slcan."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if isinstance(data, CanFrame) and data.id & ERROR_FLAG:
            return []
        return super().carry(sender, data, at)


def test_answers_that_break_each_other_show_where_no_errors_are_told() -> None:
    with bench(ids=(5, 5), line=NoErrors()) as there:
        there.simulator.servos[1].raw_position = 3
        found = there.run(survey(there.servo()))
        assert (found.most, found.errors, found.torn, found.several) == (1, False, True, True)
        with pytest.raises(RequestError, match="its id comes every time, its position never"):
            there.servo().provision(new_id=9)
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}


def test_errors_without_any_answer_may_be_the_bit_rate() -> None:
    with bench(bit_rate=250_000) as there:
        found = there.run(survey(there.servo()))
        assert (found.answered, found.errors, found.several) == (False, True, False)
