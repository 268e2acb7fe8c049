"""What the tests of the straight way share: a line that strikes, and exchanges as a control loop keeps them.

Status packets that begin at the same moment reach the host as one delivery, as those of a train do on a real port.
"""

from __future__ import annotations

from math import inf
from typing import Any

from motorbus.bus.course import Course
from motorbus.bus.loosed import Loosed
from motorbus.bus.pump import Bus
from motorbus.core.aimed import Aim, Aimed
from motorbus.core.operation import UNLIKE, Data, Due, Exchange, Goal, Unlike
from motorbus.families.feetech import FAMILY, wire
from motorbus.link.base import Delivery, PerfectLine, Side
from motorbus.link.memory import MemoryLink
from tests.bus.responder import Responder, position
from tests.bus.script import admit_all

LATE = 0.06
"""s that a late answer takes: longer than anybody waits for it."""


class Train(Responder):
    """Says at once all that it has to say at one moment."""

    def advance(self, to: float) -> list[tuple[float, Data]]:
        together: dict[float, bytes] = {}
        for at, data in super().advance(to):
            assert isinstance(data, bytes)
            together[at] = together.get(at, b"") + data
        return list(together.items())


def packets(data: bytes) -> list[bytes]:
    """The status packets of a train."""
    found, start = [], 0
    while start < len(data):
        end = start + 4 + data[start + 3]
        found.append(data[start:end])
        start = end
    return found


def damaged(packet: bytes) -> bytes:
    return packet[:-1] + bytes((packet[-1] ^ 1,))


def alarmed(packet: bytes) -> bytes:
    return wire.encode_status(packet[2], 4, packet[5:-1])


def struck(fault: str, data: bytes) -> list[tuple[float, bytes]]:
    """What becomes of these packets, and how much later (s): the whole train, its last one, or each by itself."""
    *begin, last = packets(data)
    first = b"".join(begin)
    return {
        "drop": [],
        "drop last": [(0.0, first)] if first else [],
        "corrupt": [(0.0, damaged(data))],
        "late": [(LATE, data)],
        "late last": [(0.0, first), (LATE, last)] if first else [(LATE, last)],
        "apart": [(0.0, packet) for packet in packets(data)],
        "double": [(0.0, data), (0.0, data)],
        "doubled": [(0.0, data + data)],
        "split": [(0.0, data[:3]), (0.0001, data[3:])],
        "bytes": [(number * 1e-5, data[number : number + 1]) for number in range(len(data))],
        "split short": [(0.0, data[:3])],
        "split late": [(0.0, data[:3]), (LATE, data[3:])],
        "split surplus": [(0.0, data[:3]), (0.0001, data[3:]), (0.00011, b"\0")],
        "split damaged": [(0.0, data[:3]), (0.0001, damaged(data[3:]))],
        "split among": [(0.0, data[:3]), (0.0001, data[3:] + b"\xff\xff")],
        "merge": [(0.0, data + b"\xff\xff")],
        "surplus": [(0.0, data), (0.0002, data)],
        "foreign": [(0.0, b"\x12\x34"), (0.0, data)],
        "alarm": [(0.0, alarmed(packets(data)[0]) + data[len(packets(data)[0]) :])],
        "alarm last": [(0.0, first + alarmed(last))],
        "odd": [(0.0, first + wire.encode_status(last[2], 0, last[5:-1] + b"\0"))],
    }.get(fault, [(0.0, data)])


FAULTS = (
    *("drop", "drop last", "corrupt", "late", "late last", "apart", "double", "doubled", "split", "merge"),
    *("surplus", "foreign", "alarm", "alarm last"),
    *("bytes", "split short", "split late", "split surplus", "split damaged", "split among"),
    *("odd", "echo"),
)


class Struck(PerfectLine):
    """A line that keeps what was written, and does the next fault to what comes back.

    `struck` counts the answers that did not come as they were sent.
    """

    def __init__(self) -> None:
        self.sent: list[Data] = []
        self.fault = ""
        self.struck = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.HOST:
            self.sent.append(data)
            heard = [Delivery(at, Side.HOST, data)] if self.fault == "echo" else []
            self.fault = "" if heard else self.fault
            return super().carry(sender, data, at) + heard
        assert isinstance(data, bytes)
        fault, self.fault = self.fault, ""
        pieces = struck(fault, data)
        self.struck += pieces != [(0.0, data)]
        return [Delivery(at + later, Side.HOST, piece) for later, piece in pieces]


def kept(*nodes: int, longer: bool = False) -> Exchange[Any]:
    """Two bytes at 56 of each, or three, by turns; kept as a control loop does. The second is what was put there."""
    count = 3 if longer else 2
    dues = tuple(Due(node, node, 6 + count) for node in nodes)
    size = 6 + count

    def read(answer: Any) -> Any:
        return [(reply.key, reply.data[4], *reply.data[5:7]) for reply in answer.replies], answer.missing

    def whole(data: bytes, at: float) -> Any | Unlike:
        parts = [data[start : start + size] for start in range(0, len(data), size)]
        if len(parts) != len(nodes):
            return UNLIKE
        for node, part in zip(nodes, parts, strict=True):
            if part != wire.encode_status(node, 0, part[5 : 5 + count]):
                return UNLIKE
        return [(node, 0, *part[5:7]) for node, part in zip(nodes, parts, strict=True)], ()

    request = wire.read(nodes[0], 56, count) if len(nodes) == 1 else wire.sync_read(56, count, nodes)
    return Exchange(
        request,
        dues,
        read,
        repeatable=True,
        tells_position=True,
        whole=whole,
        other=lambda: kept(*nodes, longer=not longer),
    )


def _goals(raws: Any) -> tuple[Goal, ...]:
    return tuple(Goal(node, "position", 0.1, -1.0, 1.0) for node in (1, 2))


def never_refused(_: Any) -> None:
    return None


AIM = Aim((1, 2), _goals, never_refused)


def order() -> Aimed:
    """What a control loop sends two nodes, and nobody answers."""
    return Aimed(wire.sync_write(42, [(1, b"\x07\x00"), (2, b"\x07\x00")]), AIM, (7, 7))


def passing(_: Any) -> bool:
    return True


def one_behind_the_other(bus: Bus, read: Any, begins: float = -inf, between: Any = None) -> Any:
    """Two volleys, of which the second leaves right behind the answer to the first where it can, or a while later.

    Something else may be asked in `between`.
    """
    volley = Loosed(bus, (order(), read))
    behind = volley.behind((order(),), begins, passing)
    told = volley.land(behind)
    if between is not None:
        told.append(bus.run(between))
    if behind is None or (behind.at is None and not volley.leave(behind)):
        volley = Loosed(bus, (order(), read))
    return told, volley.land()


def struck_bus(**options: Any) -> tuple[Bus, Train, Struck]:
    """A bus without an echo on which nodes 1 to 6 have been heard, what answers on it, and its line."""
    line, simulator = Struck(), Train()
    bus = Bus(MemoryLink(simulator, line=line, **options), FAMILY, admit=admit_all)
    bus.turns.echo.excluded()
    for node in range(1, 7):
        bus.run(position(node))
    return bus, simulator, line


class Landings:
    """Counts the courses that land, by their nodes; `lengths` are those of their replies, in order."""

    def __init__(self, monkeypatch: Any) -> None:
        self.ids: list[tuple[int, ...]] = []
        self.lengths: list[int] = []
        lands = Course.lands

        def landed(course: Course, data: Data, at: float) -> None:
            self.ids.append(course.ids)
            self.lengths.append(course.length)
            lands(course, data, at)

        monkeypatch.setattr(Course, "lands", landed)

    @property
    def groups(self) -> list[tuple[int, ...]]:
        """Those with several nodes."""
        return [ids for ids in self.ids if len(ids) > 1]
