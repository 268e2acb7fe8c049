"""USB adapters: which one it is, from its USB ids, and how long it holds a byte back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

USB_TIME = 0.003  # s; one USB full-speed frame each way and the host's own time
DEVICE_LATENCY = 0.004  # s; adapters without a timer deliver bytes within 2 to 4 ms
WINDOWS_LATENCY = 0.019  # s; Windows does not tell the latency timer, so FTDI's 16 ms is assumed
TERMINAL_LATENCY = 0.002  # s; a pseudo-terminal has no adapter, but two processes are scheduled
PSEUDO_TERMINALS = ("/dev/pts/", "/dev/ttys")
FAST_TIMER = 1  # ms; the lowest FTDI latency timer

ADAPTERS: Final[Mapping[tuple[int | None, int | None], str]] = {
    (0x1A86, 0x55D3): "CH343: usual on FEETECH and Waveshare servo boards",  # WCH driver ch343ser_linux
    (0x1A86, 0x7523): "CH340: usual on FEETECH URT boards and RS-485 sticks",  # Linux ch341.c
    (0x0403, 0x6001): "FT232R: usual in USB-RS485 cables; check its latency timer",  # Linux ftdi_sio_ids.h
    (0x10C4, 0xEA60): "CP210x: usual on ESP32 boards",  # Linux cp210x.c
    (0x0483, 0x5740): "STM32: usual on controller boards with own USB",  # craigm26/OpenCastor#527
}
"""What an adapter probably is, by vendor and product."""


class PortInfo(NamedTuple):
    """A serial port of this machine.

    `stable` is its name under /dev/serial/by-id, which does not depend on the order of plugging; "" where there is
    none. `guess` says what the adapter probably is; "" for unknown ids. `part` tells the ports of one adapter apart.
    """

    device: str
    stable: str
    vid: int | None
    pid: int | None
    serial_number: str
    manufacturer: str
    product: str
    guess: str
    part: tuple[object, ...] = ()

    @property
    def adapter(self) -> str:
        """The USB adapter with its part: equal for the same one at another place; "" for no USB adapter."""
        if self.vid is None:
            return ""
        mark = f" with the serial number {self.serial_number}" if self.serial_number else ""
        part = f", port {self.part}" if any(self.part) else ""
        return f"the adapter {self.vid:04x}:{self.pid or 0:04x}{mark}{part}"

    @property
    def description(self) -> str:
        """Manufacturer and product as the adapter reports them."""
        return " ".join(part for part in (self.manufacturer, self.product) if part)


def device_latency(device: str, sysfs: Path = Path("/sys")) -> tuple[float, tuple[str, ...]]:
    """Latency (s) of the adapter of a serial port, and a warning with the remedy where its latency timer is slow."""
    file = sysfs / "class" / "tty" / Path(device).name / "device" / "latency_timer"
    try:
        timer = int(file.read_text())  # ms for which an FTDI adapter collects bytes
    except (OSError, ValueError):  # another adapter
        return (TERMINAL_LATENCY if device.startswith(PSEUDO_TERMINALS) else DEVICE_LATENCY), ()
    latency = timer / 1000 + USB_TIME
    if timer <= FAST_TIMER:
        return latency, ()
    command = f"echo {FAST_TIMER} > /sys/bus/usb-serial/devices/{Path(device).name}/latency_timer"
    rule = f'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{{latency_timer}}="{FAST_TIMER}"'
    warning = (
        f"its latency timer is {timer} ms, which allows about {1000 // (timer + 1)} reads a second; set it to"
        f" {FAST_TIMER} ms: as root, {command}; permanently, in /etc/udev/rules.d/99-motorbus.rules: {rule}"
    )
    return latency, (warning,)
