"""A control loop over six servos: one sync read in, one sync write out, each cycle.

The group requests are made once and kept. Goals pass the gate like every other motion.
"""

from __future__ import annotations

import math
import sys

import motorbus


def main(address: str = "feetech:sim,ids=1-6", cycles: int = 200) -> None:
    with motorbus.open(address) as bus:
        servos = [motorbus.feetech.Servo(bus, node) for node in range(1, 7)]
        for servo in servos:
            servo.prepare()
            servo.enable_torque()
        group = motorbus.feetech.ServoGroup(servos)
        read, write = group.positions, group.write("goal_position")
        start = bus.run(read).values
        begun = bus.link.now()
        for cycle in range(cycles):
            swing = 0.2 * math.sin(2 * math.pi * cycle / cycles)
            bus.run(write([start[servo.node] + swing for servo in servos]))
            positions = bus.run(read)
            for silent in positions.missing:
                print(f"servo {silent} did not answer in cycle {cycle}")
        print(f"{cycles / (bus.link.now() - begun):.0f} cycles/s{', simulated' if bus.simulated else ''}")
        bus.run(motorbus.feetech.disable_torque_all([servo.node for servo in servos]))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "feetech:sim,ids=1-6")
