"""Many simulated arms at once, each on a bus of its own, in time of their own: `python fleet.py ARMS SERVOS`.

Every arm is an ordinary bus, so what drives one of them drives a real one. All wait for the same moments, so there is
one time for the whole fleet. It says how many times as fast as real time that is, by processor time: a few arms are
faster, thousands of servos on real buses are slower, for each of them is driven, judged and checked as a real one.
"""

from __future__ import annotations

import math
import sys
import time
from contextlib import ExitStack

import motorbus

MOST = 50
"""Servos of an arm: more do not tell their positions in one packet, for a stop would have to wait for all of them."""


def main(arms: int = 5, servos: int = 6, seconds: float = 4.0) -> None:
    with ExitStack() as stack:
        started = time.process_time()
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
        prepared, cycles = time.process_time(), round(2 * seconds)
        for cycle in range(cycles):
            goal = math.pi + 0.5 * math.sin(cycle)
            for sim, bus, arm in fleet:
                sim.wait(begun + cycle / 2)  # two cycles in a second of the fleet
                bus.run(motorbus.feetech.ServoGroup(arm).write("goal_position")([goal] * servos))
        found: list[float] = []
        for sim, bus, arm in fleet:
            sim.wait(begun + cycles / 2 + 1.0)
            found += bus.run(motorbus.feetech.ServoGroup(arm).positions).values.values()
        took = time.process_time() - prepared
    furthest = max(abs(position - goal) for position in found)
    speed = (cycles / 2 + 1) / took
    print(f"{len(found)} axes within {furthest:.3f} rad of their goals, simulated")
    print(f"prepared in {prepared - started:.3g} s of processor time, which is not counted below")
    print(f"{speed:.3g} times real time (above 1: so many times faster than real time)")


def numbers(words: list[str]) -> list[int]:
    """How many arms, and how many servos of each. Ends the program with exit code 2 for anything else."""
    try:
        found = [int(word) for word in words]
    except ValueError:
        found = [0]
    if len(found) > 2 or min(found, default=1) < 1 or max(found[1:], default=1) > MOST:
        print(
            f"fleet.py: {' '.join(words)!r}: expected a number of arms from 1 on and of servos from 1 to {MOST}, "
            "as in `python fleet.py 500 20`",
            file=sys.stderr,
        )
        sys.exit(2)
    return found


if __name__ == "__main__":
    main(*numbers(sys.argv[1:]))
