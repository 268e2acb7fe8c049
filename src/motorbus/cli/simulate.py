"""`motorbus simulate`: devices that any program can open, on a pseudo-terminal or a socket, until Ctrl-C."""

from __future__ import annotations

import difflib
import gc
import os
import signal
import time
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from cyclopts import App, Parameter

from motorbus import families, session
from motorbus.cli import faulty
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.core import units
from motorbus.errors import RequestError
from motorbus.link.lock import served_by_simulator
from motorbus.simulation.clients import CanClient, Door
from motorbus.simulation.control import ControlSocket
from motorbus.simulation.faulted import SCHEMA, Faulted
from motorbus.simulation.faults import Script, World
from motorbus.simulation.listener import TcpListener, TcpPort, parse_endpoint
from motorbus.simulation.mount import Mount, Place
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.served import check_harmless, join
from motorbus.simulation.slcan import SlcanAdapter

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from motorbus.core.family import Family

app = App(
    name="simulate",
    help_epilogue="""Prints one line when it is ready, then serves until Ctrl-C or SIGTERM, and
removes its link and its control socket. Told no way to the bus, it says which
pseudo-terminal it has made. --tcp without a host binds 127.0.0.1; there is no
login. The control socket takes one order a line:
status, power-cycle [ID], unplug ID, plug ID, set-input ID INPUT on|off,
faults [SCRIPT|off], help, supply ID VOLTS, heat ID DEGREES (of servos), and
for the shaft of a FEETECH servo block ID [LOW HIGH], push ID ANGLE,
load ID PERCENT, release ID (of a KST servo load and release).

A CAN bus is served by the slcan protocol on --link and --tcp, and may be
served in several ways at once: what one program sends, the others see.

--faults takes a script of what goes wrong, one fault a line or between
semicolons, or a file with one: `exchange 17 byte 3: drop`, `1% of bytes:
corrupt`, `at 2.5 s: unplug 0.5`. `--faults help` lists all of them. What
happened is printed to stderr, and at the end how to have it again and which
of them have not happened; --quiet leaves that out. With --can they are refused
unless that bus is made of programs alone: virtual, udp_multicast, or socketcan
with vcan0.

A quirk of the family may be given as a flag: --profile kst-ext.

Examples:

    motorbus simulate feetech --ids 1-6 --model sts3215 --link /tmp/arm
    motorbus simulate feetech --ids 1-6 --tcp 4000 --pace
    motorbus simulate feetech --link /tmp/arm --control /tmp/arm.control
    motorbus simulate feetech --link /tmp/arm --broadcast-ping in_turn
    motorbus simulate kst --ids 0x25,0x26 --profile kst-ext --link /tmp/can
    motorbus simulate feetech --link /tmp/arm --faults "seed 1; 1%: delay 0.1"
    motorbus simulate stepper --link /tmp/stepper --pace --reply-fault lost""",
)

Flag = Annotated[bool, Parameter(negative="")]
Faults = Annotated[str | None, Parameter(help="What goes wrong: a script, or a file with one, or help.")]
Switched = Annotated[
    tuple[str, ...], Parameter(help="NAME=VALUE, how they behave where real ones differ.", negative="")
]
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
    "quiet",
    "switch",
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
    quiet: Annotated[Flag, Parameter(help="Do not print to stderr which faults happened.")] = False,
    switch: Switched = (),
    output: Annotated[Output, Parameter(parse=False)],
    **flags: Annotated[str, Parameter(help="A switch of the family, as --NAME VALUE.")],
) -> Exit:
    """Serve simulated devices on a pseudo-terminal or a socket."""
    output.simulated = True
    found = families.load(family)
    if faults == "help":
        return faulty.listed(output)
    script = _script(faults, can, found)
    options, settings = _sorted(found, {**_switched(switch), **flags})
    simulator = found.simulator(session.parse_ids(ids), model, **options)
    asked = _rate(found, baud, bitrate)
    usual: int = getattr(simulator, "usual_rate", None) or found.link.rate
    rate = asked or usual
    simulator.tune(rate)
    if usual != found.link.rate and found.link.kind == "bytes":
        settings["baud"] = str(rate)  # these devices ship with another rate than most of their family
    with ExitStack() as stack:
        stop = stack.enter_context(_until_signalled())
        served = _served(stack, found, Ways(link, tcp, can), asked)
        controls = [stack.enter_context(closing(ControlSocket(control, simulator)))] if control else []
        world = World(simulator, now=time.monotonic())
        places = [place for place, _ in served]
        mount = Mount(world, *places, pace=rate if pace else None, rate=rate, attendants=controls)
        faulted = _faulted(mount, world, script, controls)
        buses = [f"{family}:{port}{_appended(settings, port, asked)}" for _, port in served]
        gc.collect()  # before the ready line: the first request is answered without this delay
        gc.freeze()  # hundreds of devices live as long as this; to look through them again and again makes replies late
        _ready(output, buses, family, sorted(simulator.nodes), ids)
        _serve(mount, stop, faulted, None if quiet else output)
        _ended(output, faulted)
    return Exit.OK


def _script(said: str | None, can: str, family: Family) -> Script:
    """What is to go wrong. Raises RequestError for a bad script, and for any where real devices may be."""
    script = faulty.from_option(said)
    if script.faults and can and family.link.kind == "frames":
        check_harmless(f"can://{can}")
    return script


def _faulted(mount: Mount, world: World, script: Script, controls: Iterable[ControlSocket]) -> Faulted:
    """What is to go wrong, and those who may change it."""
    faulted = Faulted(mount, world)
    faulted.set(script)
    for control in controls:
        control.faults = faulted
    return faulted


def _ready(output: Output, buses: Sequence[str], family: str, nodes: Sequence[int], ids: str) -> None:
    """The line that a caller waits for."""
    facts = {"bus": buses[0], "buses": buses, "family": family, "ids": nodes, "pid": os.getpid()}
    output.document("motorbus.simulate/1", facts)
    count = f"{len(nodes)} {family} device{'' if len(nodes) == 1 else 's'}"
    output.text(f"ready: {' and '.join(buses)}  (simulated: {count}, ids {ids})")


def _serve(mount: Mount, stop: int, faulted: Faulted, output: Output | None) -> None:
    """Serve until `stop` turns readable; print to stderr which faults happened, unless there is no output."""
    if output is None:
        mount.serve(stop)
        return
    _note(output, faulted.news())
    while not mount.step(stop):
        _note(output, (*faulted.news(), *faulted.remarks(time.monotonic())))
    _note(output, (*faulted.news(), *faulted.remarks(time.monotonic())))
    _note(output, (*faulted.rest(), *filter(None, [faulted.replay()]), *faulted.unhappened()))


def _ended(output: Output, faulted: Faulted) -> None:
    """With --json, what came of the faults, if there was ever a script."""
    if faulted.used:
        output.document(SCHEMA, faulted.facts())


def _note(output: Output, lines: Iterable[str]) -> None:
    for line in lines:
        output.note(line, limit=None)  # it may hold a script to be used again


def _served(stack: ExitStack, family: Family, ways: Ways, bitrate: int) -> list[tuple[Place, str]]:
    """Where clients come in, and what a host calls each."""
    if family.link.kind == "frames":
        return list(_frames(stack, ways, bitrate, family.link.rate))
    return [_bytes(stack, ways)]


def _bytes(stack: ExitStack, ways: Ways) -> tuple[Place, str]:
    """The open port, and what a host calls it."""
    if ways.can:
        raise RequestError("these devices speak on a serial line, not on CAN", expected="--link or --tcp")
    if ways.tcp and ways.link:
        raise RequestError("a serial line is served on --link or on --tcp, not on both")
    if ways.tcp:
        listener = stack.enter_context(closing(TcpListener(*parse_endpoint(ways.tcp))))
        stack.enter_context(served_by_simulator(listener.url))
        return listener, listener.url
    terminal = stack.enter_context(closing(PtyMaster()))
    if ways.link is None:
        return terminal, terminal.slave_name
    terminal.symlink(ways.link)
    return terminal, str(ways.link)


def _frames(stack: ExitStack, ways: Ways, said: int, usual: int) -> Iterator[tuple[Place, str]]:
    """Every way to the CAN bus, and what a host calls it."""
    if ways.link or not any(ways):
        terminal = stack.enter_context(closing(PtyMaster()))
        if ways.link:
            terminal.symlink(ways.link)
        name = ways.link.absolute() if ways.link else terminal.slave_name
        yield CanClient(terminal, SlcanAdapter()), f"can://slcan{name}"
    if ways.tcp:
        door = Door(TcpPort(*parse_endpoint(ways.tcp)), SlcanAdapter)
        stack.enter_context(served_by_simulator(f"socket://{door.port.address}"))
        yield stack.enter_context(closing(door)), f"can://slcan/socket://{door.port.address}"
    if ways.can:
        yield stack.enter_context(closing(join(f"can://{ways.can}", said, usual))), f"can://{ways.can}"


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


def _switched(texts: Sequence[str]) -> dict[str, str]:
    pairs = [text.partition("=")[::2] for text in texts]
    if not all(name and value for name, value in pairs):
        raise RequestError(
            f"--switch {' '.join(texts)}: not NAME=VALUE", expected="as broadcast-ping=in_turn"
        )
    return dict(pairs)


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
def _until_signalled() -> Iterator[int]:
    """A descriptor that turns readable at SIGINT or SIGTERM, which end nothing by themselves meanwhile."""
    readable, writable = os.pipe()
    names = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(name, lambda number, frame: os.write(writable, b"!") and None) for name in names]
    try:
        yield readable
    finally:
        for name, handler in zip(names, before, strict=True):
            signal.signal(name, handler)
        os.close(readable)
        os.close(writable)
