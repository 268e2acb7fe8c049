"""Packets of a recording, as a sequence and as columns.

A recording holds hundreds of thousands, and most questions are asked of all of them: which nodes, how many broken,
how far apart. So they are kept as columns, and a `Packet` is made when one is looked at.
"""

from __future__ import annotations

from abc import abstractmethod
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import accumulate, repeat
from typing import Any, Final, NamedTuple, TypeAlias, overload

from motorbus.core.can_frame import CanFrame
from motorbus.core.capture import ABSENT, FAULTS, KINDS, NOISE, Columns, Packet, PacketFacts
from motorbus.core.request import Data

_new = tuple.__new__
_VOID: Final = (NOISE, ABSENT, ABSENT)
Cut: TypeAlias = Callable[[bytes, Any, Any], list[bytes]]


class Mark(NamedTuple):
    """From byte `own` of one way on: add `more` for the place in the whole recording; `at` is when it came (s)."""

    own: int
    more: int
    at: float | None


class Packets(Sequence[Packet]):
    """Packets and noise in order. The columns, with one element for each:

    `start`, `data`, `node` and `code` as in `Packet`; `size` in bytes; `kind` and `fault` as numbers into `KINDS` and
    `FAULTS`; `at`, or None where no times were noted
    """

    @property
    @abstractmethod
    def start(self) -> Sequence[int] | Any: ...
    @property
    @abstractmethod
    def data(self) -> Sequence[bytes]: ...
    @property
    @abstractmethod
    def size(self) -> Sequence[int] | Any: ...
    @property
    @abstractmethod
    def kind(self) -> Sequence[int] | Any: ...
    @property
    @abstractmethod
    def node(self) -> Sequence[int] | Any: ...
    @property
    @abstractmethod
    def code(self) -> Sequence[int] | Any: ...
    @property
    @abstractmethod
    def fault(self) -> Sequence[int] | Any: ...
    @property
    @abstractmethod
    def at(self) -> Sequence[float | None] | Any: ...

    def __len__(self) -> int:
        return len(self.data)

    def __iter__(self) -> Iterator[Packet]:
        return self._from(slice(None))

    @overload
    def __getitem__(self, index: int) -> Packet: ...
    @overload
    def __getitem__(self, index: slice) -> list[Packet]: ...
    def __getitem__(self, index: int | slice) -> Packet | list[Packet]:
        if isinstance(index, slice):
            return list(self._from(index))
        place = range(len(self))[index]
        return next(self._from(slice(place, place + 1)))

    def __repr__(self) -> str:
        return f"<Packets: {len(self)}, of which {sum(map(bool, self.fault))} are noise>"

    def _from(self, which: slice) -> Iterator[Packet]:
        data = self.data[which]
        at = repeat(None, len(data)) if self.at is None else _plain(self.at[which])
        columns = (
            _plain(self.start[which]),
            data,
            map(KINDS.__getitem__, _plain(self.kind[which])),
            _plain(self.node[which]),
            _plain(self.code[which]),
            map(FAULTS.__getitem__, _plain(self.fault[which])),
            at,
        )
        return map(_new, repeat(Packet), zip(*columns, strict=True))


class Heard(Packets):
    """What a `Decoder` has found since it was last asked; the columns are lists."""

    def __init__(
        self,
        first: int,
        marks: Sequence[Mark],
        data: list[bytes],
        noise: Mapping[int, int],
        told: PacketFacts,
        frames: bool,
    ) -> None:
        self._first: Final = first
        self._marks: Final = marks
        self._data: Final = data
        self._noise: Final = noise
        self._told: Final = told
        self._frames: Final = frames

    @property
    def data(self) -> list[bytes]:
        return self._data

    @property
    def size(self) -> list[int]:
        return [*map(len, self._data)]

    @cached_property
    def _columns(self) -> list[Sequence[int]]:
        return [self._among(column, void) for column, void in zip(self._told(), _VOID, strict=True)]

    @property
    def kind(self) -> Sequence[int]:
        return self._columns[0]

    @property
    def node(self) -> Sequence[int]:
        return self._columns[1]

    @property
    def code(self) -> Sequence[int]:
        return self._columns[2]

    @cached_property
    def fault(self) -> Sequence[int]:
        faults = [0] * len(self._data)
        for place, fault in self._noise.items():
            faults[place] = fault
        return faults

    def _among(self, column: Sequence[int], void: int) -> list[int]:
        """What is said of packets, with this for the noise among them."""
        whole: list[int] = []
        told = 0
        for place in self._noise:
            taken, told = told, told + place - len(whole)
            whole += column[taken:told]
            whole.append(void)
        whole += column[told:]
        return whole

    @cached_property
    def start(self) -> Sequence[int]:
        marks = self._marks
        if len(marks) == 1 or len({mark.more for mark in marks}) == 1:
            return self._count(self._first + marks[0].more)
        return [own + mark.more for mark, owns in self._by_mark() for own in owns]

    @cached_property
    def at(self) -> list[float | None] | None:
        if all(mark.at is None for mark in self._marks):
            return None
        return [mark.at for mark, owns in self._by_mark() for _ in owns]

    def _by_mark(self) -> Iterator[tuple[Mark, Sequence[int]]]:
        owns = self._count(self._first)
        ends = [bisect_left(owns, mark.own) for mark in self._marks[1:]]
        for mark, begin, end in zip(self._marks, [0, *ends], [*ends, len(owns)], strict=True):
            yield mark, owns[begin:end]

    def _count(self, first: int) -> Sequence[int]:
        if self._frames:
            return range(first, first + len(self._data))
        places = [*accumulate(map(len, self._data), initial=first)]
        del places[-1]
        return places


class Whole(Packets):
    """All of a recording; the columns are arrays, `size` (bytes) is one more, and `data` is cut out when asked for.

    `cut` does that: bytes, starts and sizes. It is a function of a module: so all of this can be pickled.
    """

    def __init__(self, cut: Cut, recording: bytes | Sequence[Data], columns: Columns, at: Any = None) -> None:
        self._cut: Final = cut
        self._recording: Final = recording
        self._columns: Final = columns
        self._at: Final = at

    @property
    def start(self) -> Any:
        return self._columns.start

    @property
    def size(self) -> Any:
        return self._columns.size

    @property
    def kind(self) -> Any:
        return self._columns.kind

    @property
    def node(self) -> Any:
        return self._columns.node

    @property
    def code(self) -> Any:
        return self._columns.code

    @property
    def fault(self) -> Any:
        return self._columns.fault

    @property
    def at(self) -> Any:
        return self._at

    @cached_property
    def data(self) -> Sequence[bytes]:
        recording = self._recording
        if not isinstance(recording, bytes):
            return [one.flat() if isinstance(one, CanFrame) else one for one in recording]
        return self._cut(recording, self.start, self.size)

    def __len__(self) -> int:
        return len(self.start)


def _plain(column: Any) -> Any:
    """An array as Python's own numbers."""
    return column.tolist() if hasattr(column, "tolist") else column
