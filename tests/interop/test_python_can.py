"""python-can, which knows nothing of us, sends what the KST manual prints and gets what it prints, byte for byte.

The simulator is another process; between the two are only the slcan protocol. The frames are those
of tests/vectors/kst, which were written from the manual without this project.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any, Self

import motorbus
from motorbus import kst
from tests.interop.can_bus import CanBus, Way, can_bus
from tests.interop.canopen_peer import MODULES
from tests.protocol.kst.vectors import MANUAL

SCRIPT = Path(__file__).resolve().parent / "python_can_client.py"
FRAMES = {vector.id: str(vector.frame) for vector in MANUAL}
SILENCE = 0.5
"""s in which a reply that must not come would have come."""

POSITIONS = ["minus-90", "minus-10.9", "minus-0.8", "0", "0.8", "10.9", "90"]
EXCHANGES = {
    **{f"bit-rate-{code}": "bit-rate-set" for code in range(8)},
    **{f"node-id-{id}": "node-id-set" for id in (1, 127, 37)},
    "read-node-id": "node-id",
    "read-node-id-x": "node-id",
    "read-version": "version",
    "read-position": "position-0",
}
"""Request and reply as the manual pairs them, for a servo that nobody has touched. Not here: positions that are set,
the status, and the save, to which there is no reply."""
REFUSED = {
    "625#E003600000000000": "abort-05040001",
    "625#2303600000000000": "abort-06070012",
    "625#2F03600000000000": "abort-06070013",
    "625#2203600084070000": "abort-06090031",
    "625#220360007CF80000": "abort-06090032",
}
"""Requests that make a servo refuse in the manual's very bytes. The other codes of its list have no request that
would bring them, or repeat another object than the one the manual shows."""


class PythonCan:
    """The library at work in its own process: `peer.ask("625#…", 1)`."""

    def __init__(self, way: Way) -> None:
        left = {name: text for name, text in os.environ.items() if not name.startswith(("CAN_", "PYTHON"))}
        self._process = subprocess.Popen(
            [sys.executable, "-S", str(SCRIPT), way.interface, way.channel, json.dumps(way.kwargs)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**left, "PYTHONPATH": str(MODULES)},
        )
        assert self._answer() == [], "our own modules are in that process"

    def ask(self, frame: str, count: int = 1) -> list[str]:
        return self._ask("ask", frame, count)

    def listen(self, seconds: float) -> list[str]:
        return self._ask("listen", seconds)

    def await_(self, frame: str, reply: str) -> list[str]:
        return self._ask("await", frame, reply)

    def _ask(self, *request: object) -> list[str]:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> list[str]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, "python-can ended; what it said is above"
        answer: dict[str, Any] = json.loads(line)
        assert "error" not in answer, answer
        frames: list[str] = answer["value"]
        return frames

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(10)


def test_every_frame_the_manual_prints_is_sent_or_awaited_here() -> None:
    moved = [name for place in POSITIONS for name in (f"set-position-{place}", f"position-{place}")]
    single = ["save", "read-status", "status", "position-set"]
    used = {*EXCHANGES, *EXCHANGES.values(), *REFUSED.values(), *moved, *single}
    assert used <= FRAMES.keys()
    assert {name for name in FRAMES.keys() - used if not name.startswith("abort-")} == set()


def test_each_request_of_the_manual_has_the_reply_of_the_manual(tmp_path: Path) -> None:
    with (
        can_bus(tmp_path) as bus,
        PythonCan(bus.way()) as peer,
    ):
        heard = {name: peer.ask(FRAMES[name]) for name in EXCHANGES}
        assert heard == {name: [FRAMES[reply]] for name, reply in EXCHANGES.items()}


def test_each_column_of_the_position_table(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus, PythonCan(bus.way()) as peer:
        for place in POSITIONS:
            assert peer.ask(FRAMES[f"set-position-{place}"]) == [FRAMES["position-set"]]
            reached = FRAMES[f"position-{place}"]
            assert peer.await_(FRAMES["read-position"], reached)[-1] == reached


def test_the_status_by_the_very_frame_that_reads_a_position(tmp_path: Path) -> None:
    status = FRAMES["status"]
    with can_bus(tmp_path) as bus, PythonCan(bus.way()) as peer:
        assert peer.ask(f"625#22036000{status[12:16]}0000") == [FRAMES["position-set"]]
        assert peer.await_(FRAMES["read-status"], status)[-1] == status


def test_refusals_in_the_bytes_of_the_manual(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus, PythonCan(bus.way()) as peer:
        heard = {request: peer.ask(request) for request in REFUSED}
        assert heard == {request: [FRAMES[reply]] for request, reply in REFUSED.items()}


def test_a_save_is_not_answered(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus, PythonCan(bus.way()) as peer:
        assert peer.ask(FRAMES["save"], 0) == []
        assert peer.listen(SILENCE) == []
        assert peer.ask(FRAMES["read-node-id"]) == [FRAMES["node-id"]]
        assert [node["saved"] for node in bus.nodes()] == [True]


def test_29_bit_requests_are_answered_in_29_bits(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus, PythonCan(bus.way()) as peer:
        assert peer.ask("00000625#4002600000000000") == ["000005A5#4B02600000000000"]


# What was written counts after a save and a power cycle, and only then.

READ_ID_26, ID_26 = "626#4000300000000000", "5A6#4F00300026000000"
SET_ID_26 = "625#2200300026000000"
SET_RATE_250K = FRAMES["bit-rate-4"]


def written(peer: PythonCan) -> None:
    assert peer.ask(SET_ID_26) == [FRAMES["node-id-set"]]
    assert peer.ask(SET_RATE_250K) == [FRAMES["bit-rate-set"]]


def power_cycled(bus: CanBus) -> None:
    assert bus.order("power-cycle") == "ok"


def test_without_a_save_a_power_cycle_loses_node_id_and_bit_rate(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus, PythonCan(bus.way()) as peer:
        written(peer)
        power_cycled(bus)
        assert peer.ask(READ_ID_26, 0) + peer.listen(SILENCE) == []
        assert peer.ask(FRAMES["read-node-id"]) == [FRAMES["node-id"]]


def test_with_a_save_node_id_and_bit_rate_count_after_the_power_cycle_only(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus:
        with PythonCan(bus.way()) as peer:
            written(peer)
            assert peer.ask(FRAMES["save"], 0) + peer.listen(SILENCE) == []
            assert peer.ask(READ_ID_26, 0) + peer.listen(SILENCE) == []
            assert peer.ask(FRAMES["read-node-id"]) == ["5A5#4F00300026000000"]
            power_cycled(bus)
            for request in (FRAMES["read-node-id"], READ_ID_26):
                assert peer.ask(request, 0) + peer.listen(SILENCE) == []
        with PythonCan(bus.way(250_000)) as peer:
            assert peer.ask(READ_ID_26) == [ID_26]
            assert peer.ask(FRAMES["read-node-id"], 0) + peer.listen(SILENCE) == []


# In this process.


def test_a_virtual_bus_of_this_process_meets_the_servos() -> None:
    can: Any = import_module("can")
    request, reply = FRAMES["read-position"], FRAMES["position-0"]
    with (
        motorbus.simulate("kst", ids="0x25") as sim,
        sim.serve("can://virtual/interop"),
        can.Bus(interface="virtual", channel="interop") as bus,
    ):
        data = bytes.fromhex(request.partition("#")[2])
        bus.send(can.Message(arbitration_id=0x625, is_extended_id=False, data=data))
        message = bus.recv(20.0)
        assert f"{message.arbitration_id:03X}#{message.data.hex().upper()}" == reply


def test_ours_and_theirs_share_a_virtual_bus() -> None:
    can: Any = import_module("can")
    with (
        motorbus.simulate("kst", ids="0x25,0x26") as sim,
        sim.serve("can://virtual/interop") as served,
        can.Bus(interface="virtual", channel="interop") as theirs,
        motorbus.open("kst:can://virtual/interop") as ours,
    ):
        assert kst.Servo(ours, 0x25).node_id() == 0x25
        assert theirs.recv(20.0).arbitration_id == 0x625
        assert theirs.recv(20.0).arbitration_id == 0x5A5
        with served.still():
            sim[0x26].unplug()
        assert not kst.Servo(ours, 0x26).ping()
