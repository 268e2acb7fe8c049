"""A process that ends while its bus is being stopped does not leave the motors half stopped."""

from __future__ import annotations

import subprocess
import sys

ENDING = """
import atexit, motorbus
bus = motorbus.open(motorbus.simulate("feetech", ids="1", clock="real").url)
atexit.register(lambda: print(bus.stopper.outcome.acknowledged))
motorbus.feetech.Servo(bus, 1).enable_torque()
bus.trigger_estop()
"""


def test_a_process_that_ends_lets_a_stop_that_has_begun_come_to_its_end() -> None:
    done = subprocess.run(
        [sys.executable, "-c", ENDING], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "(1,)", "")
