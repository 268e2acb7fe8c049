"""A machine by its file: axes of three families, moved together in rad and m; each is left as the file says."""

from __future__ import annotations

import sys
from pathlib import Path

import motorbus

HERE = Path(__file__).with_name("motorbus.toml")


def main(path: str | Path = HERE) -> None:
    with motorbus.Robot.load(path) as robot:
        machine = robot.describe()
        simulated = all(bus.simulated for bus in machine.buses.values())
        print(f"{machine.name}: {len(machine.axes)} axes{', simulated' if simulated else ''}")
        for name, axis in machine.axes.items():
            print(f"{name}: {axis.model}, {', '.join(axis.commands)}")
        robot.set_position("slide", 0.0)  # it reports no position: a person has seen it there, or home it
        moved = robot.move({"shoulder": -0.3, "pan": 0.2, "slide": 0.02}, duration=1.0)
        print(moved)
        for name, end in moved.axes.items():
            print(f"{name} at {end.position:.2f}{', estimated' if end.estimated else ''}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
