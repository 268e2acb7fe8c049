"""The old and the new server give every program the same bytes. It goes with the old one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from typing import Any

import pytest

from motorbus import families
from motorbus.simulation.clients import CanClient, Door
from motorbus.simulation.listener import TcpListener
from motorbus.simulation.listener import TcpPort as OldTcpPort
from motorbus.simulation.mount import Mount
from motorbus.simulation.pty import PtyMaster as OldPtyMaster
from motorbus.simulation.slcan import SlcanAdapter as OldAdapter
from motorbus.simulation_new.pty import PtyMaster
from motorbus.simulation_new.tcp import TcpPort
from tests.simulation_new.programs import Program, on_pty, on_tcp, serving
from tests.support.mounts import served

RATES = {"feetech": 1_000_000, "kst": 500_000}
IDS = {"feetech": (1, 2, 3), "kst": (0x25, 0x26)}
QUIET = 0.15  # s without a byte end a reply

SERIAL = [
    "FF FF 01 02 01 FB",
    "FF FF FE 02 01 FE",
    "FF FF 02 04 02 38 02 BD",
    "FF FF FE 07 82 38 02 01 02 03 38",
    "FF FF 01 04 03 37 00 C0 FF FF 02 02 01 FA",
    "FF FF 01 04 03 0D 41 A9",
    "FF FF 01 09 03 2A 00 08 00 00 E8 03 D5",
    "FF FF 01 02 01 00",
    "00 FF FF FF 01 02 01 FB 55",
    "FF FF 01 04 02 00 FD FB",
]
SLCAN = [
    b"C\rS6\r\rO\rO\r",
    b"V\rN\rF\r",
    b"t62584002600000000000\r",
    b"t62684002600000000000\rt62584002600000000000\r",
    b"T0000062584002600000000000\r",
    b"t62584002600000000000",
    b"\rt625\r?\r",
    b"Z1\rZ0\r",
    b"t60084002600000000000\r",
    b"C\rt62584002600000000000\r",
]


@contextmanager
def old(family: str, terminal: bool) -> Iterator[Program]:
    simulator = families.load(family).simulator(IDS[family])
    is_can = family == "kst"
    with ExitStack() as stack:
        place: Any
        if terminal:
            place = master = stack.enter_context(closing(OldPtyMaster()))
            place = CanClient(master, OldAdapter()) if is_can else master
        elif is_can:
            place = stack.enter_context(closing(Door(OldTcpPort(), OldAdapter)))
        else:
            place = stack.enter_context(closing(TcpListener()))
        simulator.tune(RATES[family])
        stack.enter_context(served(Mount(simulator, place, rate=RATES[family])))
        if terminal:
            port = PtyMaster.__new__(PtyMaster)
            port.link, port.slave_name = None, master.slave_name
            yield stack.enter_context(on_pty(port))
        else:
            yield stack.enter_context(on_tcp(place.port if is_can else place))


@contextmanager
def new(family: str, terminal: bool) -> Iterator[Program]:
    simulator = families.load(family).simulator(IDS[family])
    port: Any = PtyMaster() if terminal else TcpPort()
    with (
        serving(simulator, port, slcan=family == "kst", rate=RATES[family]),
        on_pty(port) if terminal else on_tcp(port) as program,
    ):
        yield program


@pytest.mark.parametrize("terminal", [True, False], ids=["pty", "tcp"])
@pytest.mark.parametrize("family", ["feetech", "kst"])
def test_the_same_bytes(family: str, terminal: bool) -> None:
    dialogues = []
    for side in (old, new):
        with side(family, terminal) as program:
            replies = []
            for request in SLCAN if family == "kst" else SERIAL:
                program.send(request.hex() if isinstance(request, bytes) else request)
                replies.append(listen(program))
            dialogues.append(replies)
    assert dialogues[0] == dialogues[1]
    assert sum(map(bool, dialogues[0])) > 5


def listen(program: Program) -> str:
    """All bytes until it is quiet."""
    found = ""
    while piece := program.receive(1, QUIET):
        found += piece
    return found
