"""Every command that writes, with --dry-run, to servos of every map and of none: nothing is sent.

They acknowledge nothing (status return level 0), so no reply identifies the receiver of a write.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import motorbus
from tests.cli.conftest import Run
from tests.cli.feetech.models import MODELS

COMMANDS = """
write BUS#1 max_temperature=65
write BUS#1 goal_position=HERE led_mask=1
write BUS#1 torque_limit=50%
move BUS#1=HERE
move BUS#1=HERE BUS#2=HERE --no-wait
torque on BUS
torque off BUS
torque off BUS#1
stop BUS
set-id BUS#1 7
set-baud BUS#1 500k
recover BUS
calibrate BUS#1
calibrate BUS#1 --to 90deg
feetech reset BUS#1
feetech mode BUS#1 position
feetech mode BUS#1 velocity
feetech mode BUS#1 pwm
feetech mode BUS#1 step
feetech mode BUS#1 current
feetech recover-overload BUS#1
""".strip().splitlines()
ALWAYS = ("torque on", "stop", "calibrate", "set-id", "feetech mode")
UNKNOWN = {"firmware": "9.9"}


@pytest.mark.parametrize("name", [*MODELS, "unknown"])
def test_it_sends_nothing_and_has_no_defect(name: str, run: Run, state_folder: Path) -> None:
    model, options = MODELS.get(name, "sts3215"), {} if name in MODELS else UNKNOWN
    with motorbus.simulate("feetech", ids="1-2", model=model, servo_baud=1_000_000, **options) as servos:
        for one in (servos[1], servos[2]):
            one.memory["status_return_level"] = 0
        before = [bytes(servos[node].memory.live[:56]) for node in (1, 2)]
        for command in COMMANDS:
            ran = run(*command.replace("BUS", servos.url).replace("HERE", "3.0").split(), "--dry-run")
            assert ran.code in (0, 2, 7, 8), f"{command}: {ran.err}"  # done, or refused
            assert [bytes(servos[node].memory.live[:56]) for node in (1, 2)] == before, command
            if name == "sts" and command != "feetech mode BUS#1 current" and command.startswith(ALWAYS):
                assert "would send" in ran.out, command


def test_what_was_withheld_from_one_device_hides_nothing_of_the_next(run: Run) -> None:
    """A write without a reply names no device: the next device is asked all the same."""
    with motorbus.simulate("feetech", ids="1-2") as servos:
        for node in (1, 2):
            servos[node].memory["status_return_level"] = 0
        for command in ("torque on", "stop"):
            frames = run(*command.split(), servos.url, "--dry-run", "--json").document["withheld"]
            assert [one["data"][6:8] for one in frames] == ["01", "02"]
