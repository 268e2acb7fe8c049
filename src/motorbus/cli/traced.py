"""What -vv shows: all that is sent and delivered on a bus, told by a thread of its own.

A bus hands each record over while nobody else may send. A terminal that is held by Ctrl-S, or a pipe that nobody reads,
must not keep a stop from leaving, so whoever writes there waits alone.
"""

from __future__ import annotations

import logging
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Final

from motorbus.bus.trace import Subscription, TraceRecord

if TYPE_CHECKING:
    from collections.abc import Iterator

    from motorbus.bus.base import BaseBus

LOG = logging.getLogger("motorbus.cli")
PATIENCE: Final = 1.0
"""s that the end of a command waits for what is not written yet."""


@contextmanager
def traced(bus: BaseBus) -> Iterator[None]:
    """With -vv, log all that is sent and delivered on this bus meanwhile."""
    if not LOG.isEnabledFor(logging.DEBUG):
        yield
        return
    told = _Told()
    bus.trace.add(told)
    try:
        yield
    finally:
        bus.trace.unsubscribe(told)
        told.end()


class _Told(Subscription[TraceRecord]):
    """Logs every request and delivery soon after the moment at which it happens."""

    def __init__(self) -> None:
        super().__init__(0)
        self._waiting: SimpleQueue[TraceRecord | None] = SimpleQueue()
        self._thread = Thread(target=self._tell, name="motorbus -vv", daemon=True)
        self._thread.start()

    def put(self, record: TraceRecord) -> None:
        self._waiting.put(record)

    def end(self) -> None:
        """Nothing more comes; what is there is written, if somebody takes it."""
        self._waiting.put(None)
        self._thread.join(PATIENCE)

    def _tell(self) -> None:
        while (record := self._waiting.get()) is not None:
            shown = record.data.hex(" ").upper() if isinstance(record.data, bytes) else record.data
            LOG.debug("%s %s", record.direction, shown)
