"""How a device is addressed when its id or the rate has changed."""

from __future__ import annotations

import pytest

from motorbus import families
from motorbus.cli.identity import address


@pytest.mark.parametrize(
    ("bus", "node", "rate", "there"),
    [
        ("feetech:/dev/ttyACM0", 7, 0, "feetech:/dev/ttyACM0#7"),
        ("feetech:/dev/ttyACM0", None, 500_000, "feetech:/dev/ttyACM0,baud=500000"),
        ("feetech:/dev/ttyACM0,baud=500000", None, 1_000_000, "feetech:/dev/ttyACM0"),
        ("feetech:/dev/ttyACM0,baud=500000", 7, 115_200, "feetech:/dev/ttyACM0,baud=115200#7"),
        ("kst:can://slcan/dev/ttyACM0", 38, 1_000_000, "kst:can://slcan/dev/ttyACM0,bitrate=1000000#38"),
    ],
)
def test_addresses(bus: str, node: int | None, rate: int, there: str) -> None:
    assert address(bus, families.load(bus.partition(":")[0]), node=node, rate=rate) == there
