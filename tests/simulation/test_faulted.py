"""Faults of a simulation that is served: set before and while it runs, told, not too much of them, and had again."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import pytest

from motorbus import families
from motorbus.errors import RequestError
from motorbus.simulation.clients import CanClient
from motorbus.simulation.faulted import Faulted, read_order
from motorbus.simulation.faults import World
from motorbus.simulation.listener import TcpListener, TcpPort
from motorbus.simulation.mount import Mount, Place
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.served import LinkClient
from motorbus.simulation.slcan import SlcanAdapter
from tests.simulation.links import QueueLink
from tests.support.mounts import PATIENCE, asked, served

PING, PONG = "FF FF 01 02 01 FB", "FF FF 01 02 00 FC"


class Hall:
    """A mount with faults that a test steps by itself, so that nothing else changes them meanwhile."""

    def __init__(self, place: Place, family: str = "feetech", **options: object) -> None:
        simulator: Any = families.load(family).simulator((1,), "", **options)
        self.slept = 0.0  # s that a test has added to the clock
        self.world = World(simulator, now=self.clock())
        rate = None if isinstance(place, TcpListener) else families.load(family).link.rate
        self.mount = Mount(self.world, place, rate=rate, clock=self.clock)
        self.faulted = Faulted(self.mount, self.world)

    def clock(self) -> float:
        return time.monotonic() + self.slept


@contextmanager
def reached(hall: Hall, port: TcpListener | TcpPort) -> Iterator[socket.socket]:
    with served(hall.mount), socket.create_connection((port.host, port.port), timeout=PATIENCE) as client:
        yield client


def test_a_bad_script_leaves_the_one_that_is_set() -> None:
    with closing(TcpListener()) as listener:
        hall = Hall(listener)
        hall.faulted.set("exchange 2: drop")
        line = hall.mount.course.line
        for wrong in ("exchange 1: explode", "exchange 1: power-cycle 9"):
            with pytest.raises(RequestError):
                hall.faulted.set(wrong)
        for nothing in ("seed 3", "# nothing"):
            with pytest.raises(RequestError, match="no fault in it"):
                read_order(hall.faulted, nothing)
        assert hall.mount.course.line is line
        assert read_order(hall.faulted, "off") is None
        assert hall.mount.course.line is not line
        assert (read_order(hall.faulted, "") or {})["script"] == ""
        with pytest.raises(RequestError, match="takes no faults"):
            read_order(None, "")


def test_chance_gets_a_seed_that_is_told() -> None:
    with closing(TcpListener()) as listener:
        hall = Hall(listener)
        hall.faulted.set("50%: drop")
        seed = hall.faulted.script.seed
        assert seed is not None
        hall.faulted.set("seed 5; 100%: duplicate")
        with reached(hall, listener) as client:
            assert asked(client.fileno(), PING, 12) == f"{PONG} {PONG}"
        assert hall.faulted.replay() == (
            "faults: 1 happened, by the seed 5; the same again: --faults 'seed 5; 100%: duplicate'"
        )


def test_a_terminal_without_a_name_cannot_be_pulled() -> None:
    with closing(PtyMaster()) as terminal:
        assert "nobody would find" in CanClient(terminal, SlcanAdapter()).fixed
        with pytest.raises(RequestError, match=r"(?s)no port.*symbolic link"):
            Hall(terminal).faulted.set("exchange 1: unplug 1")


def test_what_has_not_happened_is_named_with_what_there_was_instead() -> None:
    with closing(TcpListener()) as listener:
        hall = Hall(listener)
        script = "exchange 1 packet 2: drop; exchange 9: drop; at 0 s: delay 1; at 600 s: drop; at 700 s: power-cycle 1"
        hall.faulted.set(f"seed 1; {script}; 1e-9%: drop; 100%: duplicate; at 0 s: torn-eeprom 1")
        hall.slept += 2.0
        hall.mount.step(timeout=0)
        said = hall.faulted.unhappened()
        facts = hall.faulted.facts()
    assert [line.partition(" (")[0] for line in said] == [
        "faults: `at 0 s: torn-eeprom 1` has not happened",
        "faults: `exchange 1 packet 2: drop` has not happened",
        "faults: `exchange 9: drop` has not happened",
        "faults: `at 0 s: delay 1` has not happened",
        "faults: `at 600 s: drop` has not happened",
        "faults: `at 700 s: power-cycle 1` has not happened",
        "faults: `1e-09%: drop` has not happened",
        "faults: `100%: duplicate` has not happened",
    ]
    assert said[0].endswith("(nothing was stored since that could be torn)")
    assert said[2].endswith("(0 exchanges were seen)")
    assert said[3].endswith("(its moment has passed, and nothing came since that it could change)")
    assert said[5].endswith(" s have passed)")
    assert facts["pending_count"] == len(facts["pending"]) == 6
    assert facts["never"] == ["1e-09%: drop", "100%: duplicate"]


def test_faults_are_refused_on_a_bus_that_may_have_real_devices() -> None:
    link = QueueLink(no_wire=False, name="can://socketcan/can0")
    hall = Hall(LinkClient(link), "kst")
    line = hall.mount.line
    for script in ("1%: drop", "at 1 s: power-cycle 1"):
        with pytest.raises(RequestError, match="can://socketcan/can0: faults are refused"):
            read_order(hall.faulted, script)
    assert hall.mount.line is line
    assert not hall.faulted.used
    assert read_order(hall.faulted, "off") is None
