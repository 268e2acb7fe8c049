"""A simulated bus at work on somebody else's CAN channel, in a thread: what it hears, says, and leaves behind."""

from __future__ import annotations

import threading
from contextlib import closing

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.errors import LinkLost, RequestError
from motorbus.link.base import Line
from motorbus.simulation.faults import FaultyLine
from motorbus.simulation.served import LinkClient, Served, check_harmless, join
from tests.simulation.links import QueueLink
from tests.simulation.parrots import ANSWER, Parrots
from tests.support.noisy_line import NoisyLine

FRAME = CanFrame(0x601, b"\1\2")
REPLY = CanFrame(0x601 ^ ANSWER, b"\1\2")


@pytest.mark.parametrize("descriptor", [False, True])
def test_devices_answer_on_the_channel(descriptor: bool) -> None:
    link = QueueLink(descriptor=descriptor)
    with Served(Parrots(), LinkClient(link)):
        for _ in range(3):
            link.arrive(FRAME)
            assert link.next_sent() == REPLY
    assert link.closed


def test_an_adapter_that_is_lost_is_told_when_the_bus_is_left() -> None:
    link = QueueLink()
    served = Served(Parrots(), LinkClient(link))
    link.is_lost = True
    link.arrive(FRAME)
    with served.still():  # returns though the thread has ended
        pass
    with pytest.raises(LinkLost):
        served.close()
    served.close()
    assert link.closed


def test_nothing_happens_while_it_is_held_still() -> None:
    bus, link = Parrots(), QueueLink()
    with Served(bus, LinkClient(link)) as served:
        with served.still():
            link.arrive(FRAME)
            bus.poke()
            assert bus.heard == []
        assert link.next_sent() == REPLY
        with served.still():
            assert len(bus.heard) == 1


def test_the_line_can_be_changed_at_any_time() -> None:
    link = QueueLink()
    with Served(Parrots(), LinkClient(link)) as served:
        line: Line = NoisyLine(1, duplicate=1.0)
        served.line = line
        assert served.line is line
        link.arrive(FRAME)
        assert [link.next_sent(), link.next_sent()] == [REPLY, REPLY]


def test_the_clock_of_the_devices_goes_on_where_it_stood() -> None:
    bus, link = Parrots(), QueueLink()
    with Served(bus, LinkClient(link), start=5.0) as served:
        link.arrive(FRAME)
        link.next_sent()
        assert 5.0 <= bus.heard[0][0] <= served.now() < 5.0 + 60.0


def test_it_leaves_no_thread_behind() -> None:
    before = threading.active_count()
    served = Served(Parrots(), LinkClient(QueueLink()))
    served.close()
    assert threading.active_count() == before


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "socket://127.0.0.1:1", "sim", ""])
def test_only_can_channels_can_be_joined(port: str) -> None:
    with pytest.raises(RequestError, match="no CAN channel"):
        join(port)


def test_a_channel_is_opened_as_a_host_would(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    def open_link(port: str, **options: object) -> QueueLink:
        asked.append((port, options))
        return QueueLink()

    monkeypatch.setattr("motorbus.link.url.open_can", open_link)
    with closing(join("can://virtual/here", 250_000, 500_000, fd=False)):
        pass
    expected = {"rate": 250_000, "default_rate": 500_000, "options": {"fd": False}, "shared": True}
    assert asked == [("can://virtual/here", expected)]


# On a bus that may have real devices.


def test_a_line_that_does_harm_is_refused_where_devices_may_be_real() -> None:
    link = QueueLink(no_wire=False, name="can://socketcan/can0")
    with pytest.raises(RequestError, match="can://socketcan/can0: faults are refused"):
        Served(Parrots(), LinkClient(link), line=FaultyLine("1%: drop"))
    with Served(Parrots(), LinkClient(link)) as served:
        before = served.line
        for harmful in (NoisyLine(1), FaultyLine("1%: drop")):
            with pytest.raises(RequestError, match="may have real devices; nothing was changed"):
                served.line = harmful
        assert served.line is before
        served.line = FaultyLine()  # nothing goes wrong by that
        link.arrive(FRAME)
        assert link.next_sent() == REPLY


def test_what_is_asked_before_a_channel_is_opened() -> None:
    for there in ("can://virtual/here", "can://socketcan/vcan0"):
        check_harmless(there)
    for there in ("can://socketcan/can0", "can://slcan/dev/nothing"):
        with pytest.raises(RequestError, match="faults are refused"):
            check_harmless(there)
    check_harmless("/dev/nothing")  # no channel: to join it is refused
