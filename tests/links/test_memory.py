"""The memory link: virtual time that advances only inside read, air time, and an adapter that is unplugged."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Thread

import pytest

from motorbus.core.can_bits import bits
from motorbus.core.can_frame import CanFrame
from motorbus.core.family import SimulatedNode
from motorbus.core.request import Data
from motorbus.errors import LinkLost
from motorbus.link.memory import MemoryLink

DELAY = 0.001
PING = bytes.fromhex("ff ff 01 02 01 fb")


class Mirror:
    """A simulated bus that sends bytes back reversed after `delay` seconds, and a frame with its id plus one."""

    def __init__(self, delay: float = DELAY) -> None:
        self.delay = delay
        self.received: list[tuple[float, Data]] = []
        self.coming: list[tuple[float, Data]] = []
        self.nodes: Mapping[int, SimulatedNode] = {}

    def receive(self, data: Data, at: float) -> None:
        self.received.append((at, data))
        said = data._replace(id=data.id + 1) if isinstance(data, CanFrame) else data[::-1]
        self.coming.append((at + self.delay, said))

    def advance(self, to: float) -> list[tuple[float, Data]]:
        ready = [item for item in self.coming if item[0] <= to]
        self.coming = [item for item in self.coming if item[0] > to]
        return ready

    def due(self) -> float | None:
        return min((when for when, _ in self.coming), default=None)

    def tune(self, rate: int) -> None: ...


def test_time_moves_only_inside_read_and_to_the_event() -> None:
    link = MemoryLink(Mirror())
    assert (link.read(0.25), link.now(), link.due()) == ([], 0.25, float("inf"))
    link.write(PING)
    assert link.due() == link.now() == 0.25, "the request reaches the device"
    assert link.read(1.0) == [PING[::-1]]
    assert link.now() == 0.25 + DELAY
    link.write(PING)
    link.advance(1.0)
    assert link.due() < link.now(), "what has come waits to be read"


def test_bytes_take_their_time_each_way_and_queue() -> None:
    mirror = Mirror()
    link = MemoryLink(mirror, rate=1_000_000, pace=True)
    link.write(bytes(8))
    link.write(bytes(8))
    assert link.read(1.0) == [bytes(8)]
    assert [at for at, _ in mirror.received] == pytest.approx([80e-6, 160e-6])
    assert link.now() == pytest.approx(80e-6 + DELAY + 80e-6)


def test_frames_share_one_wire_in_both_directions() -> None:
    mirror = Mirror(delay=0.0)
    link = MemoryLink(mirror, rate=1_000_000, pace=True)
    asked, answered = CanFrame(0x625, b"\x55"), CanFrame(0x5A5, b"\x55")
    mirror.coming = [(0.0, answered)]
    link.write(asked)
    assert link.read(1.0) == [answered]
    assert link.now() == pytest.approx((bits(asked) + bits(answered)) * 1e-6)


def test_an_unplugged_adapter_is_a_lost_link_and_nothing_old_comes_back() -> None:
    link = MemoryLink(Mirror(delay=0.0))
    link.write(b"old")
    link.unplug()
    for use in (lambda: link.write(PING), lambda: link.read(1.0)):
        with pytest.raises(LinkLost, match="unplugged"):
            use()
    link.plug()
    link.write(PING)
    assert [link.read(1.0), link.read(1.0)] == [[PING[::-1]], []]
    link.unplug(at=link.now() + DELAY / 2)
    with pytest.raises(LinkLost):
        link.read(2.0)


def test_on_the_real_clock_it_waits_and_closing_ends_a_wait() -> None:
    link = MemoryLink(Mirror(), virtual=False)
    begin = link.now()
    link.write(PING)
    assert link.read(begin + 30) == [PING[::-1]]
    assert link.now() >= begin + DELAY
    lost: list[LinkLost] = []

    def wait() -> None:
        try:
            link.read(float("inf"))
        except LinkLost as error:
            lost.append(error)

    reader = Thread(target=wait)
    reader.start()
    link.close()
    link.close()
    reader.join()
    assert "closed" in lost[0].summary
