"""The memory link: virtual time that moves only inside read, air time, and every fault of the noisy line."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Thread

import pytest

from motorbus.core.family import SimulatedNode
from motorbus.core.operation import CanFrame, Data
from motorbus.errors import LinkError, LinkLost
from motorbus.link.base import Delivery, Link, Side
from motorbus.link.memory import MemoryLink, NoisyLine

DELAY = 0.001
PING = bytes.fromhex("ff ff 01 02 01 fb")


class Parrot:
    """A simulated bus that says everything back, reversed, after `delay` seconds; a frame with its id plus one."""

    def __init__(self, delay: float = DELAY) -> None:
        self.delay = delay
        self.rate = 0
        self.heard: list[tuple[float, Data]] = []
        self.coming: list[tuple[float, Data]] = []
        self.nodes: Mapping[int, SimulatedNode] = {}

    def receive(self, data: Data, at: float) -> None:
        self.heard.append((at, data))
        said = data._replace(id=data.id + 1) if isinstance(data, CanFrame) else data[::-1]
        self.coming.append((at + self.delay, said))

    def advance(self, to: float) -> list[tuple[float, Data]]:
        ready = [item for item in self.coming if item[0] <= to]
        self.coming = [item for item in self.coming if item[0] > to]
        return ready

    def due(self) -> float | None:
        return min((when for when, _ in self.coming), default=None)

    def tune(self, rate: int) -> None:
        self.rate = rate


def drain(link: MemoryLink, seconds: float = 10.0) -> list[Data]:
    """Everything that arrives within this time."""
    end = link.now() + seconds
    arrived: list[Data] = []
    while link.now() < end:
        arrived += link.read(end)
    return arrived


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


def test_it_starts_when_told() -> None:
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


# -- air time ---------------------------------------------------------------------------------------------------


def test_eight_bytes_at_one_megabaud_take_eighty_microseconds_each_way() -> None:
    parrot = Parrot()
    link = MemoryLink(parrot, rate=1_000_000, pace=True)
    link.write(bytes(8))
    assert link.read(1.0) == [bytes(8)]
    assert [at for at, _ in parrot.heard] == [pytest.approx(80e-6)]
    assert link.now() == pytest.approx(80e-6 + DELAY + 80e-6)


def test_a_second_request_queues_behind_the_first() -> None:
    parrot = Parrot()
    link = MemoryLink(parrot, rate=9600, pace=True)
    link.write(bytes(11))
    link.write(bytes(11))
    drain(link)
    assert [at for at, _ in parrot.heard] == pytest.approx([110 / 9600, 220 / 9600])


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
    link.write(CanFrame(1, bytes(8)))
    link.write(CanFrame(1, b"", extended=True))
    drain(link)
    assert [at for at, _ in parrot.heard] == pytest.approx([111e-6, 178e-6])


def test_without_pace_bytes_arrive_at_once() -> None:
    parrot = Parrot()
    link = MemoryLink(parrot, rate=9600)
    link.write(bytes(226))
    drain(link)
    assert [at for at, _ in parrot.heard] == [0.0]


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


def test_a_closed_link_says_so_and_closing_again_does_nothing() -> None:
    link = MemoryLink(Parrot())
    link.close()
    link.close()
    with pytest.raises(LinkLost, match="closed"):
        link.read(1.0)


def test_a_runaway_writer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motorbus.link.memory.BACKLOG", 3)
    link = MemoryLink(Parrot())
    for _ in range(3):
        link.write(PING)
    with pytest.raises(LinkError, match="nobody reads"):
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


# -- the noisy line ---------------------------------------------------------------------------------------------

PROBABILITIES = ["loss", "duplicate", "corrupt", "lose_byte", "insert_byte", "double_byte", "late"]


def exchanges(line: NoisyLine, count: int = 200) -> list[tuple[float, list[Data]]]:
    """What comes back for so many requests, and when."""
    link = MemoryLink(Parrot(), line=line)
    told = []
    for number in range(count):
        link.write(bytes([number, 1, 2, 3]))
        arrived = link.read(link.now() + 0.01)
        told.append((link.now(), arrived))
    return told


@pytest.mark.parametrize("fault", PROBABILITIES)
def test_a_fault_fires_and_changes_what_arrives(fault: str) -> None:
    line = NoisyLine(1, **{fault: 0.1})  # type: ignore[arg-type]
    assert exchanges(line) != exchanges(NoisyLine(1))
    assert 5 <= line.count(fault) <= 40
    assert {fired.to for fired in line.fired} == {Side.HOST}


@pytest.mark.parametrize(
    ("fault", "possible"),
    [
        ("loss", [[]]),
        ("duplicate", [[b"abcd", b"abcd"]]),
        ("lose_byte", [[b"bcd"], [b"acd"], [b"abd"], [b"abc"]]),
        ("double_byte", [[b"aabcd"], [b"abbcd"], [b"abccd"], [b"abcdd"]]),
    ],
)
def test_what_a_fault_does(fault: str, possible: list[list[Data]]) -> None:
    line = NoisyLine(3, **{fault: 1.0})  # type: ignore[arg-type]
    seen = [[delivery.data for delivery in line.carry(Side.DEVICE, b"abcd", 0.0)] for _ in range(100)]
    assert all(arrived in possible for arrived in seen)
    assert all(arrived in seen for arrived in possible)


def test_corruption_changes_exactly_one_byte() -> None:
    line = NoisyLine(1, corrupt=1.0)
    for _ in range(500):
        [delivery] = line.carry(Side.DEVICE, b"abcd", 0.0)
        assert isinstance(delivery.data, bytes)
        assert sum(a != b for a, b in zip(delivery.data, b"abcd", strict=True)) == 1


def test_an_inserted_byte_is_one_more() -> None:
    line = NoisyLine(1, insert_byte=1.0)
    [delivery] = line.carry(Side.DEVICE, b"abcd", 0.0)
    assert isinstance(delivery.data, bytes)
    assert len(delivery.data) == 5


def test_a_frame_is_corrupted_in_its_data() -> None:
    line = NoisyLine(1, corrupt=1.0)
    [delivery] = line.carry(Side.DEVICE, CanFrame(5, b"\x00"), 0.0)
    assert isinstance(delivery.data, CanFrame)
    assert (delivery.data.id, delivery.data.data != b"\x00", len(delivery.data.data)) == (5, True, 1)


def test_a_frame_without_data_passes() -> None:
    line = NoisyLine(1, corrupt=1.0, lose_byte=1.0, split=True)
    assert [d.data for d in line.carry(Side.DEVICE, CanFrame(5, b""), 0.0)] == [CanFrame(5, b"")]
    assert line.fired == []


def test_a_late_packet_holds_up_what_follows() -> None:
    line = NoisyLine(1, late=1.0, late_by=(0.1, 0.2))
    [late] = line.carry(Side.DEVICE, b"late", 0.0)
    line.late = 0.0
    [next_one] = line.carry(Side.DEVICE, b"next", 0.05)
    assert 0.1 <= late.at <= 0.2
    assert next_one.at == late.at


def test_a_late_packet_can_be_overtaken() -> None:
    line = NoisyLine(1, late=1.0, late_by=(0.1, 0.2), overtake=True)
    [late] = line.carry(Side.DEVICE, b"late", 0.0)
    line.late = 0.0
    [next_one] = line.carry(Side.DEVICE, b"next", 0.05)
    assert 0.1 <= late.at <= 0.2
    assert next_one.at == 0.05


def test_delay_keeps_the_order() -> None:
    line = NoisyLine(1, delay=0.1)
    moments = [line.carry(Side.DEVICE, b"x", number * 0.001)[0].at for number in range(100)]
    assert moments == sorted(moments)
    assert line.count("delay") > 0


def test_the_host_hears_its_echo() -> None:
    line = NoisyLine(1, echo=True)
    link = MemoryLink(Parrot(), line=line)
    link.write(PING)
    assert drain(link) == [PING, PING[::-1]]
    assert line.count("echo") == 1


def test_the_echo_suffers_the_same_faults() -> None:
    line = NoisyLine(1, echo=True, loss=1.0)
    assert line.carry(Side.HOST, PING, 0.0) == [Delivery(0.0, Side.DEVICE, PING)]


def test_split_pieces_come_in_order_and_whole() -> None:
    line = NoisyLine(1, split=True)
    link = MemoryLink(Parrot(), line=line)
    for _ in range(50):
        link.write(PING)
        pieces = drain(link, 0.01)
        assert b"".join(piece for piece in pieces if isinstance(piece, bytes)) == PING[::-1]
    assert line.count("split") > 25


def test_faults_strike_the_side_they_are_meant_for() -> None:
    line = NoisyLine(1, loss=1.0, toward=Side.DEVICE)
    assert line.carry(Side.HOST, PING, 0.0) == []
    assert len(line.carry(Side.DEVICE, PING, 0.0)) == 1
    both = NoisyLine(1, loss=1.0, toward=None)
    assert both.carry(Side.HOST, PING, 0.0) + both.carry(Side.DEVICE, PING, 0.0) == []


def test_the_same_seed_gives_the_same_bytes_at_the_same_moments() -> None:
    def everything(seed: int) -> NoisyLine:
        return NoisyLine(
            seed,
            delay=0.002,
            loss=0.1,
            duplicate=0.1,
            corrupt=0.1,
            lose_byte=0.1,
            insert_byte=0.1,
            double_byte=0.1,
            late=0.1,
            echo=True,
            split=True,
            toward=None,
        )

    assert exchanges(everything(7)) == exchanges(everything(7))
    assert exchanges(everything(7)) != exchanges(everything(8))


def test_what_fired_says_when_and_what() -> None:
    line = NoisyLine(1, loss=1.0)
    line.carry(Side.DEVICE, b"abcd", 2.5)
    assert line.fired == [(2.5, "loss", Side.HOST, b"abcd")]
