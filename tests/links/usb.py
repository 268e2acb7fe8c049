"""USB adapters as the kernel and serialx tell of them."""

from __future__ import annotations

import serialx


def usb_port(**changes: object) -> serialx.SerialPortInfo:
    about: dict[str, object] = {
        "device": "/dev/serial/by-id/usb-1a86_USB_Single_Serial_585A-if00",
        "resolved_device": "/dev/ttyACM0",
        "vid": 0x1A86,
        "pid": 0x55D3,
        "serial_number": "585A0076891",
        "manufacturer": None,
        "product": "USB Single Serial",
        "bcd_device": None,
        "interface_description": None,
        "interface_num": 0,
    }
    return serialx.SerialPortInfo(**{**about, **changes})  # type: ignore[arg-type]
