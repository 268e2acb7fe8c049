"""Serves simulated devices on a real port until SIGTERM; prints `{"bus": ADDRESS, "buses": [ADDRESS]}` when ready.

A child of the tests: it needs no shell command. Flags are those of `motorbus simulate`; further ones are quirks.
"""

from __future__ import annotations

import gc
import json
import signal
from argparse import ArgumentParser
from pathlib import Path

from motorbus import families
from motorbus.session import parse_ids
from motorbus.simulation.control import ControlSocket
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.server import Port, Server
from motorbus.simulation.tcp import TcpPort, parse_endpoint


def main() -> None:
    parser = ArgumentParser()
    parser.add_argument("family")
    for flag in ("ids", "model", "link", "tcp", "control", "faults"):
        parser.add_argument(f"--{flag}", default="1" if flag == "ids" else "")
    parser.add_argument("--pace", action="store_true")
    given, rest = parser.parse_known_args()
    names = [flag.removeprefix("--").replace("-", "_") for flag in rest[::2]]
    quirks = dict(zip(names, rest[1::2], strict=True))
    family = families.load(given.family)
    simulator = family.simulator(parse_ids(given.ids), given.model, **quirks)
    ports: list[Port] = []
    buses = []
    is_can = family.link.kind == "frames"
    if given.link:
        terminal = PtyMaster(given.link)
        ports.append(terminal)
        name = str(Path(terminal.name).absolute())
        buses.append(f"{family.name}:can://slcan{name}" if is_can else f"{family.name}:{name}")
    if given.tcp:
        port = TcpPort(*parse_endpoint(given.tcp))
        ports.append(port)
        buses.append(f"{family.name}:can://slcan/{port.name}" if is_can else f"{family.name}:{port.name}")
    rate = getattr(simulator, "usual_rate", None) or family.link.rate
    if rate != family.link.rate and not is_can:
        buses = [f"{bus},baud={rate}" for bus in buses]
    server = Server(simulator, *ports, rate=rate, slcan=is_can, pace=given.pace)
    server.set_faults(given.faults)
    control = ControlSocket(given.control, server) if given.control else None
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: server.stop())
    gc.collect()
    gc.freeze()
    print(json.dumps({"bus": buses[0], "buses": buses}), flush=True)
    server.serve()
    if control is not None:
        control.close()
    server.close()
    for each in ports:
        each.close()


if __name__ == "__main__":
    main()
