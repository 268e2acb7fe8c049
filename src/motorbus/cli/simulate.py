"""`motorbus simulate`: simulated devices on a port that any program can open. `motorbus demo`."""

from __future__ import annotations

import gc
import os
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter
from msgspec import Struct

from motorbus.cli.common import Common
from motorbus.cli.output import emit, note
from motorbus.cli.target import key_values
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from motorbus.core.family import Family
    from motorbus.simulation.faults import Script
    from motorbus.simulation.server import Port

SCRIPT_LIMIT: Final = 1 << 20  # bytes of a file of faults


class Simulated(Struct, frozen=True, tag="simulate"):
    """A simulated bus that is ready: its addresses."""

    bus: str
    buses: list[str]
    ids: list[int]
    pid: int


def simulate(
    family: Annotated[str, Parameter(group="Parameters")],
    /,
    *,
    ids: Annotated[str, Parameter(help="Ids, as 1-6 or 1,4,7.")] = "1",
    model: Annotated[str, Parameter(help="Model; without it the usual one.")] = "",
    link: Annotated[Path | None, Parameter(help="Link to the pseudo-terminal.")] = None,
    tcp: Annotated[str, Parameter(help="[HOST:]PORT of a socket; 127.0.0.1 without HOST.")] = "",
    can: Annotated[str, Parameter(help="CAN bus, as socketcan/vcan0.")] = "",
    control: Annotated[Path | None, Parameter(help="Local socket for orders, as `unplug 3`.")] = None,
    pace: Annotated[bool, Parameter(help="Frames take their time on the wire.")] = False,
    faults: Annotated[str, Parameter(help="Faults, as '1%: drop', or a file of faults.")] = "",
    common: Common = Common(),
) -> None:
    """Serve simulated devices until Ctrl-C. Quirks of the devices are -o NAME=VALUE.

    Examples:

        motorbus simulate feetech --ids 1-6 --link /tmp/arm
        motorbus simulate kst --ids 0x25 -o profile=kst-ext --link /tmp/can
        motorbus simulate feetech --tcp 4000 --faults "1%: drop"
    """
    from motorbus import families
    from motorbus.session.address import parse_ids
    from motorbus.simulation.can_channel import may_have_wire
    from motorbus.simulation.control import ControlSocket
    from motorbus.simulation.server import Server, faults_on_wire

    found = families.load(family)
    script = _script(faults)
    if script.faults and can and may_have_wire(f"can://{can}"):
        raise faults_on_wire(f"can://{can}")
    options, settings = _sort_options(found, common)
    simulator = found.simulator(parse_ids(ids), model, **options)
    is_can = found.link.kind == "frames"
    rate: int = getattr(simulator, "usual_rate", None) or found.link.rate
    if rate != found.link.rate and not is_can:
        settings["baud"] = str(rate)
    suffix = "".join(f",{name}={value}" for name, value in settings.items())
    with ExitStack() as stack:
        served = _open_ports(stack, found, link, tcp, can)
        server = Server(simulator, *(port for port, _ in served), rate=rate, slcan=is_can, pace=pace)
        stack.enter_context(closing(server))
        server.set_faults(script)
        if control:
            stack.enter_context(closing(ControlSocket(control, server)))
        buses = [f"{family}:{name}{suffix}" for _, name in served]
        gc.collect()  # a collection would delay replies
        gc.freeze()
        with suppress(KeyboardInterrupt):
            if common.json:
                emit(Simulated(buses[0], buses, sorted(simulator.nodes), os.getpid()), common)
            else:
                print(f"ready: {' and '.join(buses)} (simulated, ids {ids})", flush=True)
            server.serve()
        if server.faults.count:
            note(f"faults: {server.faults.count} happened")


def _script(text: str) -> Script:
    """The faults in this text, or in the file of this name. Raises RequestError."""
    from motorbus.simulation.faults import EXAMPLE, Script, parse

    if not text:
        return Script()
    file = Path(text)
    if len(text) < 256 and file.is_file():
        with file.open("rb") as opened:
            text = opened.read(SCRIPT_LIMIT).decode("utf-8-sig", errors="replace")
    script = parse(text)
    if not script.faults:
        raise RequestError("--faults: no fault in it", expected="a script or a file", advice=EXAMPLE)
    return script


def _sort_options(family: Family, common: Common) -> tuple[dict[str, str], dict[str, str]]:
    """The options of the simulator, and those that a host needs in the address; some are both."""
    given = key_values(common)
    options = {one.name for one in family.simulator_options()}
    settings = {one.name for one in family.link.settings}
    for name in given:
        if name not in options | settings:
            raise RequestError(
                f"simulated {family.name} devices have no option {name!r}",
                expected=f"one of {', '.join(sorted(options | settings))}",
            )
    return (
        {name: value for name, value in given.items() if name in options},
        {name: value for name, value in given.items() if name in settings},
    )


def _open_ports(
    stack: ExitStack, family: Family, link: Path | None, tcp: str, can: str
) -> list[tuple[Port, str]]:
    """The open ports, each with the port in an address of a host."""
    from motorbus.simulation.can_channel import CanChannel
    from motorbus.simulation.pty import PtyMaster
    from motorbus.simulation.tcp import TcpPort, parse_endpoint

    is_can = family.link.kind == "frames"
    if can and not is_can:
        raise RequestError(f"{family.name} devices are on a serial line", expected="--link or --tcp")
    if link and tcp and not is_can:
        raise RequestError("a serial line has one port", expected="--link or --tcp")
    found: list[tuple[Port, str]] = []
    if link or not (tcp or can):
        terminal = stack.enter_context(closing(PtyMaster(link)))
        name = str(Path(terminal.name).absolute()) if is_can else terminal.name
        found.append((terminal, f"can://slcan{name}" if is_can else name))
    if tcp:
        port = stack.enter_context(closing(TcpPort(*parse_endpoint(tcp))))
        found.append((port, f"can://slcan/{port.name}" if is_can else port.name))
    if can:
        channel = CanChannel(f"can://{can}", family.link.rate, family.link.rate)
        found.append((stack.enter_context(closing(channel)), channel.name))
    return found
