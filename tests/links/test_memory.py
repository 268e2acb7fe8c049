"""The memory link: virtual time that moves only inside read, air time, and an adapter that is pulled."""

from __future__ import annotations

from random import Random
from threading import Thread

import pytest

from motorbus.core.can_bits import bits
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import LinkError, LinkLost
from motorbus.link.base import Link, PerfectLine
from motorbus.link.memory import MemoryLink
from tests.links.parrot import DELAY, PING, Parrot, drain

# -- virtual time -----------------------------------------------------------------------------------------------


def test_it_is_a_link() -> None:
    link: Link = MemoryLink(Parrot())
    assert (link.simulated, link.virtual, link.paced, link.fileno()) == (True, True, False, None)


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


@pytest.mark.parametrize("until", [DELAY, 0.0, -1.0, float("-inf")])
def test_asking_with_a_moment_in_the_past_does_not_wait(until: float) -> None:
    link = MemoryLink(Parrot())
    link.read(DELAY)
    link.write(PING)
    assert link.read(until) == []
    assert link.now() == DELAY


def test_what_has_arrived_is_there_for_a_read_in_the_past() -> None:
    link = MemoryLink(Parrot())
    link.write(PING)
    link.advance(1.0)
    assert (link.now(), link.read(0.0)) == (1.0, [PING[::-1]])


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


def test_the_clock_starts_at_a_given_moment() -> None:
    link = MemoryLink(Parrot(), start=17.0)
    link.write(PING)
    assert link.read(20.0) == [PING[::-1]]
    assert link.now() == 17.0 + DELAY


def test_frames_travel_like_bytes() -> None:
    link = MemoryLink(Parrot())
    link.write(CanFrame(0x625, b"\x40"))
    assert link.read(1.0) == [CanFrame(0x626, b"\x40")]


def test_the_simulator_learns_the_rate() -> None:
    parrot = Parrot()
    link = MemoryLink(parrot, rate=500_000)
    assert parrot.rate == 500_000
    link.tune(76_800)
    assert (parrot.rate, link.rate) == (76_800, 76_800)


def test_equal_moments_keep_their_order() -> None:
    link = MemoryLink(Parrot(delay=0.0))
    for number in range(10):
        link.write(bytes([number]))
    assert drain(link) == [bytes([number]) for number in range(10)]


class Carrier(PerfectLine):
    """Does the same as the perfect line, piece by piece."""


@pytest.mark.parametrize("seed", range(20))
def test_what_arrives_at_once_comes_as_it_would_piece_by_piece(seed: int) -> None:
    said = []
    for line in (PerfectLine(), Carrier()):
        random, parrot = Random(seed), Parrot(delay=0.002)
        link = MemoryLink(parrot, line=line)
        seen: list[tuple[float, list[Data], int]] = []
        for number in range(60):
            for _ in range(random.randrange(3)):
                link.write(bytes([number, random.randrange(256)]))
                link.rest(link.now() + random.choice([0.0, 0.0005, 0.003]))
            arrived = link.read(link.now() + random.choice([0.0, 0.001, 0.002, 0.01]))
            seen.append((link.now(), arrived, len(parrot.received)))
        said.append(seen)
    assert said[0] == said[1]


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


def test_replies_of_one_moment_queue_behind_each_other() -> None:
    link = MemoryLink(Parrot(delay=0.0), rate=1_000_000, pace=True)
    parrot = link.simulator
    assert isinstance(parrot, Parrot)
    parrot.coming = [(0.0, bytes(10)), (0.0, bytes(20))]
    moments = []
    for _ in range(2):
        link.read(1.0)
        moments.append(link.now())
    assert moments == pytest.approx([100e-6, 300e-6])


def test_a_frame_takes_its_bits() -> None:
    parrot = Parrot()
    link = MemoryLink(parrot, rate=1_000_000, pace=True)
    frames = [CanFrame(0x625, bytes(8)), CanFrame(0x625, b"", extended=True)]
    for frame in frames:
        link.write(frame)
    drain(link)
    first, second = map(bits, frames)
    assert [at for at, _ in parrot.received] == pytest.approx([first * 1e-6, (first + second) * 1e-6])


def test_frames_share_one_wire_in_both_directions() -> None:
    parrot = Parrot(delay=0.0)
    link = MemoryLink(parrot, rate=1_000_000, pace=True)
    asked, answered = CanFrame(0x625, b"\x55"), CanFrame(0x5A5, b"\x55")
    parrot.coming = [(0.0, answered)]
    link.write(asked)
    assert link.read(1.0) == [answered]
    assert link.now() == pytest.approx((bits(asked) + bits(answered)) * 1e-6)


def test_a_simulator_that_paces_by_itself_makes_a_paced_link() -> None:
    parrot = Parrot()
    parrot.paced = True  # type: ignore[attr-defined]
    link = MemoryLink(parrot)
    link.write(PING)
    assert link.paced
    link.read(1.0)
    assert link.now() == DELAY, "and the link adds nothing"


def test_without_pace_bytes_arrive_at_once() -> None:
    parrot = Parrot()
    link = MemoryLink(parrot, rate=9600)
    link.write(bytes(226))
    drain(link)
    assert [at for at, _ in parrot.received] == [0.0]


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


def test_a_program_that_only_writes_gets_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motorbus.link.memory.BACKLOG", 3)
    link = MemoryLink(Parrot())
    for _ in range(3):
        link.write(PING)
    with pytest.raises(LinkError, match="replies are not read"):
        link.write(PING)


# -- the real clock ---------------------------------------------------------------------------------------------


def test_on_the_real_clock_it_waits_for_the_answer() -> None:
    link = MemoryLink(Parrot(), virtual=False)
    begin = link.now()
    link.write(PING)
    assert link.read(begin + 30) == [PING[::-1]]
    assert link.now() >= begin + DELAY


def test_on_the_real_clock_a_writer_wakes_a_waiting_reader() -> None:
    link = MemoryLink(Parrot(), virtual=False)
    arrived: list[Data] = []
    reader = Thread(target=lambda: arrived.extend(link.read(link.now() + 30)))
    reader.start()
    link.write(PING)
    reader.join()
    assert arrived == [PING[::-1]]


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
