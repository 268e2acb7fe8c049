"""Ours on CAN, by its public calls; several nodes by one blocking bus that keeps as many in flight as it may."""

from __future__ import annotations

from collections.abc import Callable

import motorbus
from bench.can_loop import BITRATE, main
from motorbus import kst
from motorbus.core.steps import gather

COUNTS_PER_RADIAN = 10 * 57.29577951308232


class Motorbus:
    """One open bus; servos made once."""

    def __init__(self, port: str, nodes: tuple[int, ...]) -> None:
        self.bus = motorbus.open(f"kst:can://slcan{port},bitrate={BITRATE}")
        self.servos = [kst.Servo(self.bus, node) for node in nodes]

    def read(self, count: int) -> list[list[int]]:
        """So many positions of each node, raw."""
        values: list[list[float]] = [[] for _ in self.servos]
        if len(self.servos) == 1:
            position = self.servos[0].position
            values[0] += [position() for _ in range(count)]
        else:
            self._together(count, values)
        return [[round(value * COUNTS_PER_RADIAN) for value in one] for one in values]

    def _together(self, count: int, values: list[list[float]]) -> None:
        verb = kst.Servo.position.function

        async def endless(servo: kst.Servo, keep: Callable[[float], None]) -> None:
            for _ in range(count):
                keep(await verb(servo))

        async def together() -> None:
            pairs = zip(self.servos, values, strict=True)
            await gather(*[endless(servo, found.append) for servo, found in pairs])

        self.bus.run(together())

    def close(self) -> None:
        self.bus.close()


if __name__ == "__main__":
    main(Motorbus)
