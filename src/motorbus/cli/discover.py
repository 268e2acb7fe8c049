"""`motorbus scan`, `info`, `init`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter
from msgspec import Struct

from motorbus.cli.output import emit, progress
from motorbus.cli.target import Common, open_bus
from motorbus.core.family import Found
from motorbus.core.steps import Progress


class Device(Struct, frozen=True):
    """A device that answered a scan."""

    id: int
    rate: int
    model: str = ""
    firmware: str = ""


class ScanResult(Struct, frozen=True, tag="scan"):
    """The devices of a bus."""

    bus: str
    devices: list[Device]


def scan(
    bus: str = "",
    /,
    *,
    ids: Annotated[str, Parameter(help="Ids to ask, as 1-6+9.")] = "",
    rates: Annotated[str, Parameter(help="Rates in bit/s, as 1M+500k, or all.")] = "",
    common: Common = Common(),
) -> None:
    """Find the devices on a bus.

    Examples:

        motorbus scan
        motorbus scan feetech:/dev/ttyACM0
        motorbus scan feetech:/dev/ttyACM0 --rates all
    """
    from motorbus.core import units
    from motorbus.session.address import parse_ids

    with open_bus(common, bus) as opened, progress("scan") as advance:
        if rates == "all":
            asked = opened.family.link.rates
        else:
            asked = tuple(units.rate(rate) for rate in rates.split("+") if rate)

        def report(event: object) -> None:
            if isinstance(event, Progress):
                advance(event.done, event.total, event.what)
            elif opened.report is not None and not isinstance(event, Found):
                opened.report(event)

        found = opened.run(opened.driver.scan(parse_ids(ids) if ids else (), asked), report)
    devices = [
        Device(
            one.node,
            one.rate,
            one.identity.model if one.identity else "?",
            one.identity.firmware if one.identity else "",
        )
        for one in found
    ]
    emit(ScanResult(bus, devices), common)
