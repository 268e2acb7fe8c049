"""A KST CAN servo moves there and back: `python can_servo.py kst:can://slcan/dev/ttyACM0 0x25`.

Without arguments it talks to a simulated servo. These servos have no torque switch: they hold from power-up on.
"""

from __future__ import annotations

import math
import sys

import motorbus


def main(address: str = "kst:sim,ids=0x25", node: int = 0x25) -> None:
    with motorbus.open(address) as bus:
        servo = motorbus.kst.Servo(bus, node)
        print(servo.identify().model, "simulated" if bus.simulated else "")
        for degrees in (10.9, -0.8, 0.0):
            servo.move(math.radians(degrees))  # returns when it is there
            print(f"at {math.degrees(servo.position()):.1f}°")


if __name__ == "__main__":
    if len(sys.argv) > 2:
        main(sys.argv[1], int(sys.argv[2], 0))
    else:
        main()
