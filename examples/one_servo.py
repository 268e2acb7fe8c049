"""One servo, from first contact to torque off: `python one_servo.py feetech:/dev/ttyACM0 3`.

Without arguments it talks to a simulated servo.
"""

from __future__ import annotations

import sys

import motorbus


def main(address: str = "feetech:sim,ids=1-6", node: int = 3) -> None:
    with motorbus.open(address) as bus:
        servo = motorbus.feetech.Servo(bus, node)
        print(servo.identify().model, "simulated" if bus.simulated else "")
        print(f"{servo.position():.3f} rad, {servo.voltage():.1f} V, {servo.temperature():.0f} °C")
        servo.enable_torque()  # goal := present first, so it does not jump
        try:
            servo.move(servo.position() + 0.3, velocity=2.0)  # returns when it is there
            print(f"now at {servo.position():.3f} rad")
        finally:
            servo.disable_torque()


if __name__ == "__main__":
    if len(sys.argv) > 2:
        main(sys.argv[1], int(sys.argv[2]))
    else:
        main()
