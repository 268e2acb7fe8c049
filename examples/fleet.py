"""Many simulated arms at once, each on a bus of its own, faster than they would move: `python fleet.py 500 20`.

Every arm is an ordinary bus, so what drives one of them drives a real one. All wait for the same moments, so there is
one time for the whole fleet.
"""

from __future__ import annotations

import math
import sys
import time
from contextlib import ExitStack

import motorbus


def main(arms: int = 5, servos: int = 6, seconds: float = 4.0) -> None:
    with ExitStack() as stack:
        sims = [
            stack.enter_context(motorbus.simulate("feetech", ids=tuple(range(servos)))) for _ in range(arms)
        ]
        fleet = []
        for sim in sims:
            bus = stack.enter_context(motorbus.open(sim.url))
            fleet.append((sim, bus, [motorbus.feetech.Servo(bus, node) for node in range(servos)]))
        for _, _, arm in fleet:
            for servo in arm:
                servo.prepare()
                servo.enable_torque()
        begun = max(sim.now for sim in sims)
        started, cycles = time.process_time(), round(2 * seconds)
        for cycle in range(cycles):
            goal = math.pi + 0.5 * math.sin(cycle)
            for sim, bus, arm in fleet:
                sim.wait(begun + cycle / 2)  # two cycles in a second of the fleet
                bus.run(motorbus.feetech.sync_write_positions(arm, [goal] * servos))
        found: list[float] = []
        for sim, bus, arm in fleet:
            sim.wait(begun + cycles / 2 + 1.0)
            found += bus.run(motorbus.feetech.sync_read_positions(arm)).values.values()
        took = time.process_time() - started
    furthest = max(abs(position - goal) for position in found)
    print(f"{len(found)} axes within {furthest:.3f} rad of their goals, simulated")
    print(f"{(cycles / 2 + 1) / took:.0f} times faster than real time")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
