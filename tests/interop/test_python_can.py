"""python-can, unmodified, sends what the KST manual prints and receives what it prints, byte for byte.

The simulator is another process, reached by slcan. The frames are those of tests/vectors/kst.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import motorbus
from motorbus import kst
from tests.interop.can_bus import MODULES, RATE, CanBus, can_bus
from tests.interop.feetech.peer import Script
from tests.protocol.kst.vectors import MANUAL

SCRIPT = Path(__file__).resolve().parent / "python_can_client.py"
FRAMES = {vector.id: str(vector.frame) for vector in MANUAL}
SILENCE = 0.5
"""s in which a reply would arrive."""

POSITIONS = ["minus-90", "minus-10.9", "minus-0.8", "0", "0.8", "10.9", "90"]
EXCHANGES = {
    **{f"bit-rate-{code}": "bit-rate-set" for code in range(8)},
    **{f"node-id-{id}": "node-id-set" for id in (1, 127, 37)},
    "read-node-id": "node-id",
    "read-node-id-x": "node-id",
    "read-version": "version",
    "read-position": "position-0",
}
"""Request and reply as the manual pairs them, for a servo in its initial state."""
REFUSED = {
    "625#E003600000000000": "abort-05040001",
    "625#2303600000000000": "abort-06070012",
    "625#2F03600000000000": "abort-06070013",
    "625#2203600084070000": "abort-06090031",
    "625#220360007CF80000": "abort-06090032",
}
"""Requests that a servo refuses in the bytes of the manual; no request brings the other codes of its list."""


class PythonCan(Script):
    """The library in its own process: `peer.frames("625#…")`."""

    def __init__(self, bus: CanBus, bitrate: int = RATE) -> None:
        super().__init__([str(SCRIPT), bus.channel, str(bitrate)], MODULES)

    def frames(self, request: str, count: int = 1) -> list[str]:
        return self._list("ask", request, count)

    def silent(self, request: str) -> bool:
        return self._list("ask", request, 0) + self._list("listen", SILENCE) == []

    def poll(self, request: str, reply: str) -> bool:
        return self._list("poll", request, reply)[:1] == [reply]

    def _list(self, *request: object) -> list[str]:
        frames: list[str] = self.ask(*request)
        return frames


def test_every_frame_the_manual_prints_is_sent_or_awaited_here() -> None:
    moved = [name for place in POSITIONS for name in (f"set-position-{place}", f"position-{place}")]
    single = ["save", "read-status", "status", "position-set"]
    used = {*EXCHANGES, *EXCHANGES.values(), *REFUSED.values(), *moved, *single}
    assert used <= FRAMES.keys()
    assert {name for name in FRAMES.keys() - used if not name.startswith("abort-")} == set()


def test_requests_of_the_manual_have_its_replies(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus, PythonCan(bus) as peer:
        pairs = {FRAMES[request]: FRAMES[reply] for request, reply in EXCHANGES.items()}
        pairs |= {request: FRAMES[reply] for request, reply in REFUSED.items()}
        for request, reply in pairs.items():
            assert peer.frames(request) == [reply]
        assert peer.frames("00000625#4002600000000000") == ["000005A5#4B02600000000000"]
        for place in POSITIONS:
            assert peer.frames(FRAMES[f"set-position-{place}"]) == [FRAMES["position-set"]]
            assert peer.poll(FRAMES["read-position"], FRAMES[f"position-{place}"])
        status = FRAMES["status"]
        assert peer.frames(f"625#22036000{status[12:16]}0000") == [FRAMES["position-set"]]
        assert peer.poll(FRAMES["read-status"], status)
        assert peer.silent(FRAMES["save"])
        assert peer.frames(FRAMES["read-node-id"]) == [FRAMES["node-id"]]
        assert [node["saved"] for node in bus.nodes()] == [True]


# What was written takes effect after a save and a power cycle.

READ_ID_26, ID_26 = "626#4000300000000000", "5A6#4F00300026000000"
SET_ID_26 = "625#2200300026000000"


def test_without_a_save_a_power_cycle_loses_node_id_and_bit_rate(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus, PythonCan(bus) as peer:
        assert peer.frames(SET_ID_26) == [FRAMES["node-id-set"]]
        assert peer.frames(FRAMES["bit-rate-4"]) == [FRAMES["bit-rate-set"]]
        assert bus.order("power-cycle") == '{"ok": true}'
        assert peer.silent(READ_ID_26)
        assert peer.frames(FRAMES["read-node-id"]) == [FRAMES["node-id"]]


def test_with_a_save_node_id_and_bit_rate_change_at_the_power_cycle(tmp_path: Path) -> None:
    with can_bus(tmp_path) as bus:
        with PythonCan(bus) as peer:
            assert peer.frames(SET_ID_26) == [FRAMES["node-id-set"]]
            assert peer.frames(FRAMES["bit-rate-4"]) == [FRAMES["bit-rate-set"]]
            assert peer.silent(FRAMES["save"])
            assert peer.silent(READ_ID_26)
            assert peer.frames(FRAMES["read-node-id"]) == ["5A5#4F00300026000000"]
            assert bus.order("power-cycle") == '{"ok": true}'
            assert peer.silent(FRAMES["read-node-id"])
            assert peer.silent(READ_ID_26)
        with PythonCan(bus, 250_000) as peer:
            assert peer.frames(READ_ID_26) == [ID_26]
            assert peer.silent(FRAMES["read-node-id"])


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
