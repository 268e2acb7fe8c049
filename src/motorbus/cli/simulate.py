"""`motorbus simulate`: devices that any program can open, on a pseudo-terminal or a socket, until Ctrl-C."""

from __future__ import annotations

import os
import signal
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus import families, session
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.errors import RequestError
from motorbus.link.pty import PtyMaster
from motorbus.simulation.control import ControlSocket
from motorbus.simulation.listener import TcpListener, parse_endpoint
from motorbus.simulation.mount import Mount

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from motorbus.core.family import Family
    from motorbus.simulation.mount import Endpoint

app = App(
    name="simulate",
    help_epilogue="""Prints one line when it is ready, then serves until Ctrl-C or SIGTERM, and
removes its link and its control socket. Without --link and --tcp it says which
pseudo-terminal it has made. --tcp without a host binds 127.0.0.1; there is no
login. The control socket takes one order a line: status, power-cycle [ID],
unplug ID, plug ID, help.

Examples:

    motorbus simulate feetech --ids 1-6 --model sts3215 --link /tmp/arm
    motorbus simulate feetech --ids 1-6 --tcp 4000 --pace
    motorbus simulate feetech --link /tmp/arm --control /tmp/arm.control
    motorbus simulate feetech --link /tmp/arm --switch broadcast_ping=in_turn
    motorbus simulate feetech --switches""",
)

Flag = Annotated[bool, Parameter(negative="")]


@app.default
def simulate(
    family: Annotated[str, Parameter(help="Whose devices, as feetech")],
    /,
    *,
    ids: Annotated[str, Parameter(help="Their ids, as 1-6 or 1,4,7.")] = "1",
    model: Annotated[str, Parameter(help="Their model; the usual one of the family when left out.")] = "",
    link: Annotated[Path | None, Parameter(help="A symbolic link to make to the pseudo-terminal.")] = None,
    tcp: Annotated[str, Parameter(help="HOST:PORT or PORT, to serve a socket instead.")] = "",
    pace: Annotated[Flag, Parameter(help="Bytes take their time, as on a wire.")] = False,
    baud: Annotated[int, Parameter(help="The rate of the wire until a client sets one.")] = 0,
    control: Annotated[Path | None, Parameter(help="A local socket to make, which takes orders.")] = None,
    switch: Annotated[
        tuple[str, ...], Parameter(help="NAME=VALUE, how they behave where real ones differ.", negative="")
    ] = (),
    switches: Annotated[Flag, Parameter(help="List the switches of the family and end.")] = False,
    output: Annotated[Output, Parameter(parse=False)],
) -> Exit:
    """Serve simulated devices on a pseudo-terminal or a socket."""
    output.simulated = True
    found = families.load(family)
    if switches:
        return _list(found, output)
    simulator = found.simulator(session.parse_ids(ids), model, **_switched(switch))
    rate = baud or found.link.rate
    simulator.tune(rate)
    with ExitStack() as stack:
        stop = stack.enter_context(_until_signalled())
        endpoint, port = _endpoint(stack, link, tcp)
        controls = [stack.enter_context(closing(ControlSocket(control, simulator)))] if control else []
        kind, paced = found.link.kind, rate if pace else None
        mount = Mount(simulator, endpoint, pace=paced, rate=rate, kind=kind, attendants=controls)
        nodes = sorted(simulator.nodes)
        facts = {"bus": f"{family}:{port}", "family": family, "ids": nodes, "pid": os.getpid()}
        output.document("motorbus.simulate/1", facts)
        output.text(f"ready: {family}:{port}  (simulated: {len(nodes)} {family} devices, ids {ids})")
        mount.serve(stop)
    return Exit.OK


def _endpoint(stack: ExitStack, link: Path | None, tcp: str) -> tuple[Endpoint, str]:
    """The open port, and what a host calls it."""
    if tcp and link:
        raise RequestError("a bus is served on --link or on --tcp, not on both")
    if tcp:
        listener = stack.enter_context(closing(TcpListener(*parse_endpoint(tcp))))
        return listener, listener.url
    terminal = stack.enter_context(closing(PtyMaster()))
    if link is None:
        return terminal, terminal.slave_name
    terminal.symlink(link)
    return terminal, str(link)


def _switched(texts: Sequence[str]) -> dict[str, str]:
    pairs = [text.partition("=")[::2] for text in texts]
    if not all(name and value for name, value in pairs):
        raise RequestError(f"--switch {' '.join(texts)}: not NAME=VALUE", advice="--switches lists them")
    return dict(pairs)


def _list(family: Family, output: Output) -> Exit:
    options = [(option.name, str(option.default), option.help) for option in family.link.options]
    facts = [dict(zip(("name", "default", "help"), option, strict=True)) for option in options]
    output.document("motorbus.switches/1", {"switches": facts})
    output.table(f"Switches of {family.name}", ["switch", "default", "what it does"], options)
    return Exit.OK


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
