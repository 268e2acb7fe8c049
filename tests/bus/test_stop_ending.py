"""A process that ends while its bus is being stopped does not leave the motors half stopped."""

from __future__ import annotations

import subprocess
import sys

ENDING = """
import atexit, motorbus
sim = motorbus.simulate("feetech", ids="1", clock="real")
bus = motorbus.open(sim.url)
atexit.register(lambda: print(sum(one.direction == "tx" for one in trace) // 2))
motorbus.feetech.Servo(bus, 1).enable_torque()
sim[1].unplug()  # so that all five rounds are needed, each with a frame for all and one for node 1
trace = bus.trace.subscribe()
bus.trigger_estop()
"""


def test_a_process_that_ends_lets_a_stop_that_has_begun_come_to_its_end() -> None:
    done = subprocess.run(
        [sys.executable, "-c", ENDING], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "5", "")
