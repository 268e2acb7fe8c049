"""USB adapters as the kernel and serialx tell of them."""

from __future__ import annotations

from pathlib import Path

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


def fake_usb(root: Path) -> tuple[Path, Path]:
    """The kernel's tree for one CDC adapter, and its device nodes."""
    usb = root / "sys" / "devices" / "usb1" / "1-1"
    interface = usb / "1-1:1.0"
    interface.mkdir(parents=True)
    (root / "sys" / "bus" / "usb").mkdir(parents=True)
    for name, text in {
        "idVendor": "0483",
        "idProduct": "5740",
        "bcdDevice": "0200",
        "serial": "3669",
        "manufacturer": "STM",
        "product": "Virtual ComPort",
    }.items():
        (usb / name).write_text(f"{text}\n")
    (interface / "bInterfaceNumber").write_text("00\n")
    (interface / "subsystem").symlink_to(root / "sys" / "bus" / "usb")
    (interface / "driver").mkdir()
    terminal = root / "sys" / "class" / "tty" / "ttyACM3"
    terminal.mkdir(parents=True)
    (terminal / "device").symlink_to(interface)
    by_id = root / "dev" / "serial" / "by-id"
    by_id.mkdir(parents=True)
    (root / "dev" / "ttyACM3").touch()
    (by_id / "usb-STM_3669-if00").symlink_to("../../ttyACM3")
    return root / "sys", root / "dev"
