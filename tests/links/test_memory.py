"""The memory link: virtual time that advances only inside read, air time, and an adapter that is unplugged."""

from __future__ import annotations

from threading import Thread

import pytest

from motorbus.core.can_bits import bits
from motorbus.core.can_frame import CanFrame
from motorbus.errors import LinkLost
from motorbus.link.memory import MemoryLink
from tests.links.parrot import DELAY, PING, Parrot, drain

# -- virtual time -----------------------------------------------------------------------------------------------


def test_time_moves_only_inside_read_and_to_the_event() -> None:
    link = MemoryLink(Parrot())
    link.write(PING)
    assert link.now() == 0.0
    assert link.read(1.0) == [PING[::-1]]
    assert link.now() == DELAY


def test_read_without_an_answer_ends_at_the_moment_asked_for() -> None:
    link = MemoryLink(Parrot())
    assert link.read(0.25) == []
    assert link.now() == 0.25


def test_due_is_the_next_event() -> None:
    link = MemoryLink(Parrot())
    assert link.due() == float("inf")
    link.write(PING)
    assert link.due() == link.now(), "the request reaches the device"
    link.read(0.0)
    assert link.due() == DELAY
    link.advance(1.0)
    assert link.due() < link.now(), "what has come waits to be read"
    link.read(0.0)
    assert link.due() == float("inf")


# -- air time ---------------------------------------------------------------------------------------------------


def test_eight_bytes_at_one_megabaud_take_eighty_microseconds_each_way() -> None:
    parrot = Parrot()
    link = MemoryLink(parrot, rate=1_000_000, pace=True)
    link.write(bytes(8))
    assert link.read(1.0) == [bytes(8)]
    assert [at for at, _ in parrot.received] == [pytest.approx(80e-6)]
    assert link.now() == pytest.approx(80e-6 + DELAY + 80e-6)


def test_a_second_request_queues_behind_the_first() -> None:
    parrot = Parrot()
    link = MemoryLink(parrot, rate=9600, pace=True)
    link.write(bytes(11))
    link.write(bytes(11))
    drain(link)
    assert [at for at, _ in parrot.received] == pytest.approx([110 / 9600, 220 / 9600])


def test_frames_share_one_wire_in_both_directions() -> None:
    parrot = Parrot(delay=0.0)
    link = MemoryLink(parrot, rate=1_000_000, pace=True)
    asked, answered = CanFrame(0x625, b"\x55"), CanFrame(0x5A5, b"\x55")
    parrot.coming = [(0.0, answered)]
    link.write(asked)
    assert link.read(1.0) == [answered]
    assert link.now() == pytest.approx((bits(asked) + bits(answered)) * 1e-6)


# -- gone and back ----------------------------------------------------------------------------------------------


def test_an_unplugged_adapter_is_a_lost_link() -> None:
    link = MemoryLink(Parrot())
    link.unplug()
    with pytest.raises(LinkLost, match="unplugged"):
        link.write(PING)
    with pytest.raises(LinkLost, match="unplugged"):
        link.read(1.0)


def test_plugged_again_it_works_and_nothing_old_comes() -> None:
    link = MemoryLink(Parrot(delay=0.0))
    link.write(b"old")
    link.unplug()
    link.plug()
    link.write(PING)
    assert drain(link) == [PING[::-1]]


def test_it_can_vanish_between_request_and_reply() -> None:
    link = MemoryLink(Parrot())
    link.unplug(at=DELAY / 2)
    link.write(PING)
    with pytest.raises(LinkLost):
        link.read(1.0)
    assert link.now() == DELAY / 2


def test_a_closed_link_is_lost_and_may_be_closed_again() -> None:
    link = MemoryLink(Parrot())
    link.close()
    link.close()
    with pytest.raises(LinkLost, match="closed"):
        link.read(1.0)


# -- the real clock ---------------------------------------------------------------------------------------------


def test_on_the_real_clock_it_waits_for_the_answer() -> None:
    link = MemoryLink(Parrot(), virtual=False)
    begin = link.now()
    link.write(PING)
    assert link.read(begin + 30) == [PING[::-1]]
    assert link.now() >= begin + DELAY


def test_on_the_real_clock_closing_wakes_a_waiting_reader() -> None:
    link = MemoryLink(Parrot(), virtual=False)
    lost: list[LinkLost] = []

    def wait() -> None:
        try:
            link.read(float("inf"))
        except LinkLost as error:
            lost.append(error)

    reader = Thread(target=wait)
    reader.start()
    link.close()
    reader.join()
    assert len(lost) == 1
