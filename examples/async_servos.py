"""Six servos at once from asyncio: the same verbs, awaited. A silent servo does not hold up the others."""

from __future__ import annotations

import asyncio
import sys

import motorbus


async def main(address: str = "feetech:sim,ids=1-6") -> None:
    async with motorbus.open_async(address) as bus:
        servos = {node: motorbus.feetech.AsyncServo(bus, node) for node in range(1, 8)}
        positions = await asyncio.gather(*(s.position() for s in servos.values()), return_exceptions=True)
        for node, position in zip(servos, positions, strict=True):
            if isinstance(position, motorbus.NoReply):
                print(f"{node}: no reply")
            elif isinstance(position, BaseException):
                raise position
            else:
                print(f"{node}: {position:.3f} rad")


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:2]))
