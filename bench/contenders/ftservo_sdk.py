"""The vendor's newer SDK from the package index, ftservo-python-sdk 2.0.1, used as its examples use it."""

from __future__ import annotations

import scservo_sdk as sdk  # type: ignore[import-not-found]

from bench import memory
from bench.contenders.newer_sdk import NewerSdk
from bench.contenders.sdk_port import MemoryPort
from bench.loop import main
from bench.workloads import Workload


class FtservoSdk(NewerSdk):
    """Its handler for STS servos."""

    def __init__(self, port: str, workload: Workload) -> None:
        if port == memory.PORT:
            opened = MemoryPort(workload)
        else:
            opened = sdk.PortHandler(port)
            if not opened.openPort() or not opened.setBaudRate(1_000_000):
                raise OSError(f"cannot open {port}")
        super().__init__(sdk, sdk.sms_sts(opened), workload)

    def read(self, prepared: object) -> int:
        position, result, _error = self.packets.ReadPos(1)
        if result:
            raise OSError(f"the SDK says {result}")
        return int(position)

    def _word(self, value: int) -> list[int]:
        return [self.packets.scs_lobyte(value), self.packets.scs_hibyte(value)]


if __name__ == "__main__":
    main(FtservoSdk)
