"""The same machine from asyncio: each method is awaited, so other tasks can run meanwhile."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import motorbus

HERE = Path(__file__).with_name("motorbus.toml")


async def main(path: str | Path = HERE) -> None:
    async with motorbus.AsyncRobot.load(path, ["arm", "head"]) as robot:
        moving = asyncio.create_task(robot.move({"elbow": 0.4, "tilt": 0.2}))
        ticks = 0
        while not moving.done():
            await asyncio.sleep(0.05)
            ticks += 1
        print(await moving)
        print(f"meanwhile this task was not held up: {ticks > 3}")
        positions = await robot.positions("head")
        print(", ".join(f"{name} {position:.2f} rad" for name, position in positions.items()))


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:2]))
