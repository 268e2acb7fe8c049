"""`motorbus ports`: which serial ports there are, and which of them look like an adapter for motors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli.output import Output

if TYPE_CHECKING:
    from motorbus.link.usb_adapters import PortInfo

app = App(
    name="ports",
    help_epilogue="""The stable name stays the same when other adapters are plugged in; prefer it in
scripts.

Examples:

    motorbus ports
    motorbus ports --json""",
)


@app.default
def ports(*, output: Annotated[Output, Parameter(parse=False)]) -> None:
    """List the serial ports of this machine and what hangs on them."""
    seen(output)


def seen(output: Output) -> list[PortInfo]:
    """Show the ports that there are; and those."""
    from motorbus.link import serial

    found = serial.ports()
    output.document("motorbus.ports/1", {"ports": [_facts(port) for port in found]})
    if not found:
        output.note("no serial port found; `motorbus demo` needs none")
        return found
    rows = [
        (port.device, _usb(port.vid, port.pid), port.description, port.guess, port.stable) for port in found
    ]
    output.table("Serial ports", ["device", "usb", "description", "looks like", "stable name"], rows)
    return found


def _facts(port: PortInfo) -> dict[str, object]:
    return {**port._asdict(), "description": port.description}


def _usb(vid: int | None, pid: int | None) -> str:
    return "" if vid is None or pid is None else f"{vid:04x}:{pid:04x}"
