"""The Metronome family: copy this package to begin your own. README.md describes the servo and the steps."""

from __future__ import annotations

from typing import Final

from motorbus.core.device import AsyncDevice, AsyncRunner, BlockingDevice, BlockingRunner, device_method
from motorbus.core.family import DeviceTypes, Family, LinkSpec

from . import driver
from .protocol import RATE
from .registers import TABLE


class _Methods(driver.Node):
    _family = "template"
    ping = device_method(driver.ping)
    identify = device_method(driver.identify)
    read = device_method(driver.read)
    write = device_method(driver.write)
    position = device_method(driver.position)
    telemetry = device_method(driver.telemetry)
    move = device_method(driver.move)
    enable_torque = device_method(driver.enable_torque)
    disable_torque = device_method(driver.disable_torque)
    stop = device_method(driver.stop)


class Servo(_Methods, BlockingDevice):
    """A Metronome on a blocking bus."""

    def __init__(self, bus: BlockingRunner, node: int) -> None:
        driver.Node.__init__(self, node)
        BlockingDevice.__init__(self, bus)


class AsyncServo(_Methods, AsyncDevice):
    """A Metronome on an async bus."""

    def __init__(self, bus: AsyncRunner, node: int) -> None:
        driver.Node.__init__(self, node)
        AsyncDevice.__init__(self, bus)


FAMILY: Final = Family(
    name="template",
    link=LinkSpec("bytes", RATE, (RATE, 250_000)),
    registers={TABLE.name: TABLE},
    devices=DeviceTypes(Servo, AsyncServo),
    driver=driver.MetronomeDriver,
    simulator_module=f"{__name__}.simulator",
)
