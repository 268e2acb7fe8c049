"""`motorbus simulate`: devices that any program can open, on a pseudo-terminal or a socket, until Ctrl-C."""

from __future__ import annotations

import difflib
import gc
import os
import signal
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

from cyclopts import App, Parameter

from motorbus import families, session
from motorbus.cli.exits import Exit
from motorbus.cli.files import usable
from motorbus.cli.output import Output
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.simulation.can_channel import CanChannel, may_have_wire
from motorbus.simulation.control import ControlSocket
from motorbus.simulation.faults import EXAMPLE, KINDS, Script, parse
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.server import Port, Server, faults_on_wire
from motorbus.simulation.tcp import TcpPort, parse_endpoint

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from motorbus.core.family import Family

app = App(
    name="simulate",
    help_epilogue="""Prints one line when it is ready, then serves until Ctrl-C or SIGTERM, and
removes its link and its control socket. Told no way to the bus, it says which
pseudo-terminal it has made. --tcp without a host binds 127.0.0.1; there is no
login. The control socket takes one order a line and replies with JSON:
status, power-cycle [ID], unplug ID, plug ID, supply ID VOLTS, heat ID DEGREES,
set-input ID INPUT on|off, faults [SCRIPT|off], help, and for the shaft of a
FEETECH servo block ID [LOW HIGH], push ID ANGLE, load ID PERCENT, release ID
(of a KST servo load and release).

A CAN bus is served by the slcan protocol on --link and --tcp, and may be
served in several ways at once: what one program sends, the others see.

--faults takes a script of what goes wrong, one fault a line or between
semicolons, or a file with one: `exchange 17: drop`, `1%: corrupt`,
`at 2.5 s: unplug 0.5`. `--faults help` lists all of them. With --can they are
refused unless that bus is made of programs alone: virtual, udp_multicast, or
socketcan with vcan0.

A quirk of the family may be given as a flag: --profile kst-ext.

Examples:

    motorbus simulate feetech --ids 1-6 --model sts3215 --link /tmp/arm
    motorbus simulate feetech --ids 1-6 --tcp 4000 --pace
    motorbus simulate feetech --link /tmp/arm --control /tmp/arm.control
    motorbus simulate feetech --link /tmp/arm --broadcast-ping in_turn
    motorbus simulate kst --ids 0x25,0x26 --profile kst-ext --link /tmp/can
    motorbus simulate feetech --link /tmp/arm --faults "seed 1; 1%: delay 0.1"
    motorbus simulate stepper --link /tmp/stepper --pace --select relabel""",
)

Flag = Annotated[bool, Parameter(negative="")]
Faults = Annotated[str | None, Parameter(help="What goes wrong: a script, or a file with one, or help.")]
MAX_SCRIPT: Final = 1 << 20
"""Bytes of a file with a script."""
_OWN = (
    "ids",
    "model",
    "link",
    "tcp",
    "can",
    "pace",
    "baud",
    "bitrate",
    "control",
    "faults",
)


class Ways(NamedTuple):
    """By which ways a bus is to be reached; "" and None: not by this one."""

    link: Path | None = None
    tcp: str = ""
    can: str = ""


@app.default
def simulate(
    family: Annotated[str, Parameter(help="Whose devices, as feetech")],
    /,
    *,
    ids: Annotated[str, Parameter(help="Their ids, as 1-6 or 1,4,7.")] = "1",
    model: Annotated[str, Parameter(help="Their model; the usual one of the family when left out.")] = "",
    link: Annotated[Path | None, Parameter(help="A symbolic link to make to the pseudo-terminal.")] = None,
    tcp: Annotated[str, Parameter(help="HOST:PORT or PORT, to serve a socket.")] = "",
    can: Annotated[str, Parameter(help="INTERFACE/CHANNEL of a CAN bus to join, as socketcan/vcan0.")] = "",
    pace: Annotated[Flag, Parameter(help="Bytes and frames take their time, as on a wire.")] = False,
    baud: Annotated[str, Parameter(help="The rate of a serial line until a client sets one.")] = "",
    bitrate: Annotated[str, Parameter(help="The rate of a CAN bus until a client sets one.")] = "",
    control: Annotated[Path | None, Parameter(help="A local socket to make, which takes orders.")] = None,
    faults: Faults = None,
    output: Annotated[Output, Parameter(parse=False)],
    **flags: Annotated[str, Parameter(help="A switch of the family, as --NAME VALUE.")],
) -> Exit:
    """Serve simulated devices on a pseudo-terminal or a socket."""
    output.simulated = True
    found = families.load(family)
    if faults == "help":
        return _list_faults(output)
    script = _script(faults)
    if script.faults and can and may_have_wire(f"can://{can}"):
        raise faults_on_wire(f"can://{can}")
    options, settings = _sorted(found, flags)
    simulator = found.simulator(session.parse_ids(ids), model, **options)
    asked = _rate(found, baud, bitrate)
    usual: int = getattr(simulator, "usual_rate", None) or found.link.rate
    rate = asked or usual
    is_can = found.link.kind == "frames"
    if usual != found.link.rate and not is_can:
        settings["baud"] = str(rate)  # these devices ship with another rate than most of their family
    with ExitStack() as stack:
        served = _open_ports(stack, found, Ways(link, tcp, can), asked)
        ports = [port for port, _ in served]
        server = Server(simulator, *ports, rate=rate, slcan=is_can, pace=pace)
        stack.enter_context(closing(server))
        server.set_faults(script)
        stack.enter_context(_stopped_by_signals(server))
        if control:
            stack.enter_context(closing(ControlSocket(control, server)))
        buses = [f"{family}:{name}{_appended(settings, name, asked)}" for _, name in served]
        gc.collect()  # before the ready line: the first request is answered without this delay
        gc.freeze()  # hundreds of devices live as long as this; to look through them again and again makes replies late
        _ready(output, buses, family, sorted(simulator.nodes), ids)
        server.serve()
        if server.faults.count:
            output.note(f"faults: {server.faults.count} happened")
    return Exit.OK


def _script(text: str | None) -> Script:
    """The faults in this text or in the file of this name. Raises RequestError."""
    if text is None:
        return Script()
    file = Path(text)
    if len(text) < 256 and file.is_file():
        with usable(file, "read"), file.open("rb") as opened:
            text = opened.read(MAX_SCRIPT).decode("utf-8-sig", errors="replace")
    script = parse(text)
    if not script.faults:
        raise RequestError("--faults: there is no fault in it", expected="a script or a file", advice=EXAMPLE)
    return script


def _list_faults(output: Output) -> Exit:
    """Every kind of fault with its arguments."""
    rows = [{"fault": f"{name}{kind.form}", "effect": kind.help} for name, kind in KINDS.items()]
    output.document("motorbus.faults/2", {"faults": rows})
    output.table("Faults", ["fault", "effect"], [list(row.values()) for row in rows])
    return Exit.OK


def _ready(output: Output, buses: Sequence[str], family: str, nodes: Sequence[int], ids: str) -> None:
    """The line that a caller waits for."""
    facts = {"bus": buses[0], "buses": buses, "family": family, "ids": nodes, "pid": os.getpid()}
    output.document("motorbus.simulate/1", facts)
    count = f"{len(nodes)} {family} device{'' if len(nodes) == 1 else 's'}"
    output.text(f"ready: {' and '.join(buses)}  (simulated: {count}, ids {ids})")


def _open_ports(stack: ExitStack, family: Family, ways: Ways, rate: int) -> list[tuple[Port, str]]:
    """The open ports, and what a host calls each."""
    is_can = family.link.kind == "frames"
    if not is_can and ways.can:
        raise RequestError("these devices speak on a serial line, not on CAN", expected="--link or --tcp")
    if not is_can and ways.tcp and ways.link:
        raise RequestError("a serial line is served on --link or on --tcp, not on both")
    found: list[tuple[Port, str]] = []
    if ways.link or not any(ways):
        terminal = stack.enter_context(closing(PtyMaster(ways.link)))
        name = str(Path(terminal.name).absolute()) if is_can else terminal.name
        found.append((terminal, f"can://slcan{name}" if is_can else name))
    if ways.tcp:
        port = stack.enter_context(closing(TcpPort(*parse_endpoint(ways.tcp))))
        found.append((port, f"can://slcan/{port.name}" if is_can else port.name))
    if ways.can:
        channel = CanChannel(f"can://{ways.can}", rate, family.link.rate)
        found.append((stack.enter_context(closing(channel)), channel.name))
    return found


def _rate(family: Family, baud: str, bitrate: str) -> int:
    """What was said, in bit/s, 0 for nothing. Devices on CAN have the rates of their table and no others."""
    right, wrong = ("bitrate", "baud") if family.link.kind == "frames" else ("baud", "bitrate")
    given = {"baud": baud, "bitrate": bitrate}
    if given[wrong]:
        raise RequestError(f"--{wrong} is not for {family.name} devices", expected=f"--{right}")
    rate = units.rate(given[right]) if given[right] else 0
    known = family.link.rates
    if rate and right == "bitrate" and known and rate not in known:
        raise RequestError(
            f"--bitrate {given[right]}: no {family.name} device has this rate",
            expected=f"one of {', '.join(map(str, known))}",
        )
    return rate


def _appended(settings: Mapping[str, str], port: str, bitrate: int) -> str:
    """The options that a host needs to open the bus as it is served here."""
    options = {**settings, **({"bitrate": str(bitrate)} if bitrate and "://slcan/" in port else {})}
    return "".join(f",{name}={value}" for name, value in options.items())


def _sorted(family: Family, given: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """What the simulator takes, and what belongs into the address of the bus. Some do both."""
    asked = {name.replace("-", "_"): value for name, value in given.items()}
    options = {option.name for option in family.simulator_options()}
    settings = {option.name for option in family.link.settings}
    for name in asked:
        if name not in options | settings:
            raise _unknown(name, family.name, options | settings)
    return (
        {name: value for name, value in asked.items() if name in options},
        {name: value for name, value in asked.items() if name in settings},
    )


def _unknown(name: str, family: str, known: Iterable[str]) -> RequestError:
    near = difflib.get_close_matches(name, [*known, *_OWN], n=3)
    return RequestError(
        f"{family} has no switch {name!r}",
        expected=f"perhaps {' or '.join(near)}" if near else "",
        advice=f"one of {', '.join(sorted(known))}",
    )


@contextmanager
def _stopped_by_signals(server: Server) -> Iterator[None]:
    """SIGINT and SIGTERM end the server, and nothing else meanwhile."""
    names = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(name, lambda number, frame: server.stop()) for name in names]
    try:
        yield
    finally:
        for name, handler in zip(names, before, strict=True):
            signal.signal(name, handler)
