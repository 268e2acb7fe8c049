"""A line that does everything that goes wrong on one, by chance and by seed, and keeps book of it.

Order is kept: what is late holds up all that comes behind it, as a device and an adapter do. A copy comes as soon as
the wire can carry it. What reached the controller unharmed is kept, so that an acknowledgement can be held against it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from random import Random

from motorbus.core.operation import Data
from motorbus.families.stepper import wire
from motorbus.link.base import Delivery, PerfectLine, Side

BYTE = 10 / 9600
"""s for one byte on the wire."""
REQUESTS = ("unheard", "misheard", "torn")
REPLIES = (
    "lost",
    "late",
    "twice",
    "bit",
    "byte",
    "other",
    "split",
    "noise before",
    "noise behind",
    "short",
    "byte lost",
    "byte too many",
    "byte twice",
    "notice before",
    "notice behind",
    "notice inside",
    "cut",
)
NOTICES = ("notice lost", "notice late", "notice twice", "notice damaged")
EVERYTHING = (*REQUESTS, *REPLIES, *NOTICES)


class Mischief(PerfectLine):
    """Strikes with this probability, by one of these kinds; `fired` counts them, `last` is when one struck last.
    `heard` are the requests, and `noticed` the moments of the notices, that came through unharmed.

    A reply that is `late` is so by at most `late_by` (s); a copy of one comes `copy_after` it (s), or as soon as the
    wire can carry it. `cut` takes the supply away for a moment, with the reply that is about to be said.
    """

    def __init__(
        self, seed: int, share: float, *kinds: str, late_by: float = 1.5, copy_after: float | None = None
    ) -> None:
        self.random = Random(seed)
        self.share = share
        self.requests = [kind for kind in REQUESTS if kind in kinds]
        self.replies = [kind for kind in REPLIES if kind in kinds]
        self.notices = [kind for kind in NOTICES if kind in kinds]
        self.late_by = late_by
        self.copy_after = copy_after
        self.fired: Counter[str] = Counter()
        self.last = float("-inf")
        self.heard: list[bytes] = []
        self.noticed: list[float] = []
        self.cut: Callable[[], None] = lambda: None
        self._free = float("-inf")

    @property
    def count(self) -> int:
        """How many faults there were."""
        return sum(self.fired.values())

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.HOST:
            return self._to_device(data, at)
        kinds = self.notices if data == wire.NOTICE else self.replies
        kind = self._kind(kinds, at)
        pieces = self._pieces(kind, data) if kind else [(0.0, data)]
        if kind == "cut":
            self.cut()
        told = [Delivery(self._moment(at + later), Side.HOST, piece) for later, piece in pieces if piece]
        self.noticed += [one.at for one in told if one.data == wire.NOTICE]
        return told

    def _to_device(self, data: bytes, at: float) -> list[Delivery]:
        kind = self._kind(self.requests, at)
        if not kind:
            self.heard.append(data)
            return [Delivery(at, Side.DEVICE, data)]
        if kind == "unheard":
            return []
        spot = self.random.randrange(len(data))
        harmed = data[:spot] if kind == "torn" else self._struck(data, spot, self.random.randrange(1, 256))
        return [Delivery(at, Side.DEVICE, harmed)] if harmed else []

    def _kind(self, kinds: list[str], at: float) -> str:
        if not kinds or self.random.random() >= self.share:
            return ""
        kind = self.random.choice(kinds)
        self.fired[kind] += 1
        self.last = max(self.last, at)
        return kind

    def _moment(self, at: float) -> float:
        self._free = max(at, self._free)
        return self._free

    def _pieces(self, kind: str, data: bytes) -> list[tuple[float, bytes]]:
        """What comes of this, and how much later (s)."""
        spot = self.random.randrange(len(data))
        if kind in ("late", "notice late"):
            return [(self.random.uniform(0.005, self.late_by), data)]
        if kind in ("twice", "notice twice"):
            return [(0.0, data), (len(data) * BYTE if self.copy_after is None else self.copy_after, data)]
        if kind == "split":
            return [(0.0, data[:spot]), (self.random.uniform(0.001, 0.1), data[spot:])]
        return [(0.0, self._spoilt(kind, data, spot))]

    def _spoilt(self, kind: str, data: bytes, spot: int) -> bytes:
        noise = self.random.randbytes(self.random.randrange(1, 12))
        return {
            "bit": self._struck(data, spot, 1 << self.random.randrange(8)),
            "byte": self._struck(data, spot, self.random.randrange(1, 256)),
            "notice damaged": self._struck(data, spot, self.random.randrange(1, 256)),
            "other": bytes.fromhex("FFAA030D0000" if data[3:4] != b"\x0d" else "FFAA030C0000"),
            "noise before": noise + data,
            "noise behind": data + noise,
            "short": data[:spot],
            "byte lost": data[:spot] + data[spot + 1 :],
            "byte too many": data[:spot] + noise[:1] + data[spot:],
            "byte twice": data[: spot + 1] + data[spot:],
            "notice before": wire.NOTICE + data,
            "notice behind": data + wire.NOTICE,
            "notice inside": data[:spot] + wire.NOTICE + data[spot:],
        }.get(kind, b"")

    @staticmethod
    def _struck(data: bytes, spot: int, bits: int) -> bytes:
        return data[:spot] + bytes((data[spot] ^ bits,)) + data[spot + 1 :]
