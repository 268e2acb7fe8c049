"""A CAN link without an adapter: two queues, with a descriptor to wait on or without."""

from __future__ import annotations

import os
import queue
import time

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.errors import LinkError, LinkLost

PATIENCE = 10.0


class QueueLink:
    """What `link.can` would open: `arrive` puts a frame on the bus, `next_sent` takes what was sent to it."""

    latency = 0.0
    paced = virtual = simulated = False
    warnings: tuple[str, ...] = ()

    def __init__(
        self,
        *,
        descriptor: bool = False,
        name: str = "can://queue/0",
        rate: int = 500_000,
        no_wire: bool = True,
    ) -> None:
        self.name = name
        self.rate = rate
        self.no_wire = no_wire
        self.closed = False
        self.is_lost = False
        self.is_full = False
        self._arrived: queue.Queue[Data] = queue.Queue()
        self._sent: queue.Queue[Data] = queue.Queue()
        self._pipe = os.pipe() if descriptor else None

    def arrive(self, frame: CanFrame) -> None:
        self._arrived.put(frame)
        if self._pipe:
            os.write(self._pipe[1], b".")

    def next_sent(self) -> Data:
        return self._sent.get(timeout=PATIENCE)

    def nothing_sent(self) -> bool:
        return self._sent.empty()

    def now(self) -> float:
        return time.monotonic()

    def write(self, data: Data) -> None:
        if self.is_lost:
            raise LinkLost(f"{self.name} is gone")
        if self.is_full:
            self.is_full = False
            raise LinkError(f"{self.name} is full")
        self._sent.put(data)

    def read(self, until: float) -> list[Data]:
        try:
            frame = self._arrived.get(timeout=max(1e-9, until - time.monotonic()))
        except queue.Empty:
            return []
        if self._pipe:
            os.read(self._pipe[0], 1)
        return [frame]

    def tune(self, rate: int) -> None:
        self.rate = rate

    def fileno(self) -> int | None:
        return self._pipe[0] if self._pipe else None

    def close(self) -> None:
        if not self.closed and self._pipe:
            for end in self._pipe:
                os.close(end)
        self.closed = True
