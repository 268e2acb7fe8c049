"""ftservo-python-sdk, the vendor's newer SDK, used as its examples use it."""

from __future__ import annotations

from bench.contenders.feetech_servo_sdk import FeetechServoSdk, check, open_port, sdk
from bench.measure import main
from bench.workloads import NODES


class FtservoSdk(FeetechServoSdk):
    """Its handler for STS servos owns the port."""

    def __init__(self, port: str) -> None:
        self.packets = sdk.sms_sts(open_port(port))
        self.positions = sdk.GroupSyncRead(self.packets, 56, 2)
        self.goals = sdk.GroupSyncWrite(self.packets, 42, 2)
        for node in NODES:
            self.positions.addParam(node)

    def read(self) -> int:
        value, result, _ = self.packets.ReadPos(1)
        check(result)
        return int(value)


if __name__ == "__main__":
    main(FtservoSdk)
