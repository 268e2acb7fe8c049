"""A machine by its file: axes of three families, moved together in rad and m; each is left as the file says."""

from __future__ import annotations

import sys
from pathlib import Path

import motorbus

HERE = Path(__file__).with_name("motorbus.toml")


def main(path: str | Path = HERE) -> None:
    with motorbus.Robot.load(path) as robot:
        print(f"{robot.machine.name}: {len(robot.axes)} axes{', simulated' if robot.simulated else ''}")
        for name, axis in robot.axes.items():
            print(f"{name}: {', '.join(sorted(axis.capabilities))}")
        robot["slide"].declare(0.0)  # nothing tells where it is: homing would, or a person who has seen it
        moved = robot.move({"shoulder": -0.3, "pan": 0.2, "slide": 0.02}, duration=1.0)
        print(moved)
        for name, position in robot.positions(["shoulder", "pan", "slide"]).items():
            print(f"{name} at {position:.3f}{', estimated' if moved.axes[name].estimated else ''}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
