"""What devices say unasked reaches whoever listens, and disturbs nothing: no exchange, no trust, no other node."""

from __future__ import annotations

from motorbus.core.family import Family
from motorbus.core.request import Data, Notification
from motorbus.core.steps import WaitFor
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.support.subjects import vectors
from tests.support.world import IDS, reports, sent, world

NODE = IDS[0]


class Chattering(PerfectLine):
    """Lets devices say something unasked before and after each of their replies, and says how often."""

    def __init__(self, notices: list[Data]) -> None:
        self.notices = notices
        self.fired = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        replies = super().carry(sender, data, at)
        if sender is Side.HOST:
            return replies
        self.fired += 1
        chatter = [Delivery(at, Side.HOST, notice) for notice in self.notices]
        return [*chatter, *replies, *chatter]


def said_unasked(family: Family) -> list[Data]:
    return [
        vector.data
        for vector in vectors(family.name)
        if vector.direction == "status"
        and any(isinstance(event, Notification) for event in family.open().receiver().feed(vector.data))
    ]


def test_notices_disturb_nothing(reporter: Family) -> None:
    line = Chattering([])
    with world(reporter, line=line) as there:
        looked = []
        for line.notices in ([], said_unasked(reporter)):
            device = there.device(NODE)
            with sent(there.bus) as frames:
                values = [
                    device.ping(),
                    device.identify(),
                    device.read(),
                    there.bus.run(reporter.open().scan(there.ids)),
                ]
            looked.append((values, frames))
        assert line.fired
        assert looked[0] == looked[1]
        assert there.bus.statistics.other["notices"] >= line.fired


def test_a_notice_names_its_node_and_reaches_who_listens(reporter: Family) -> None:
    expected = reports(reporter)
    line = Chattering(said_unasked(reporter))
    with world(reporter, line=line) as there:
        heard = there.bus.notices.subscribe()
        assert there.device(NODE).ping() is True
        there.link.advance(0.1)
        assert there.device(NODE).ping() is True
        arrived = list(heard)[: len(expected)]
        assert [notice._replace(at=0.0) for notice in arrived] == expected
        assert all(0.0 < notice.at <= there.link.now() for notice in arrived)
    assert {notice.node for notice in expected} <= set(there.ids)


def test_who_listens_in_vain_goes_on_in_time(reporter: Family) -> None:
    async def listening() -> Notification | None:
        return await WaitFor(lambda notice: True, 0.5)

    with world(reporter) as there:
        begun = there.link.now()
        assert there.bus.run(listening()) is None
        assert 0.5 <= there.link.now() - begun < 0.6
