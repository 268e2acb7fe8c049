"""python-canopen, unmodified, uses our simulated servos: objects and units come from a file, replies by slcan."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from motorbus.core.register import Coding, Register
from motorbus.core.request import Effect
from motorbus.families.kst.profiles import PROFILES, VERSIONS, Profile
from tests.interop.can_bus import MODULES, RATE, CanBus, can_bus
from tests.interop.feetech.peer import Library, Script, folders

HERE = Path(__file__).resolve().parent
LIBRARY = Library("canopen", "canopen", ("canopen",))
NODE = 0x25
READ_ONLY, TOO_HIGH, NO_OBJECT = 0x06010002, 0x06090031, 0x06020000


TYPES = {(1, False): 5, (2, False): 6, (4, False): 7, (2, True): 3}
VISIBLE_STRING = 9


def dictionary(profile: Profile) -> str:
    """The readable objects of this profile as python-canopen loads them (CiA 306); angles in degrees."""
    rows = [row for row in profile.table.values() if row.readable]
    listed = [f"{number}=0x{row.address:04X}" for number, row in enumerate(rows, 1)]
    lines = ["[DeviceInfo]", "[OptionalObjects]", f"SupportedObjects={len(rows)}", *listed]
    for row in rows:
        is_text, signed = row.name in VERSIONS, row.coding is Coding.TWOS_COMPLEMENT
        kind = VISIBLE_STRING if is_text else TYPES[row.size, signed]
        lines += [f"[{row.address:04X}]", f"ParameterName={row.name}", "ObjectType=0x7", "PDOMapping=0"]
        lines += [f"DataType=0x{kind:04X}", f"AccessType={'rw' if row.writable else 'ro'}"]
        if row.unit == "rad":
            lines += [f"Factor={1 / profile.counts_per_degree}", "Unit=deg"]
    return "\n".join(lines) + "\n"


class Canopen(Script):
    """The library in its own process, with the objects of this profile: `peer.read("node_id")`."""

    def __init__(self, bus: CanBus, profile: Profile, folder: Path) -> None:
        file = folder / f"{profile.name}.eds"
        file.write_text(dictionary(profile), encoding="ascii")
        command = [str(HERE / "canopen_client.py"), bus.channel, str(RATE), str(file), str(NODE)]
        super().__init__(command, os.pathsep.join([folders(LIBRARY), MODULES]))

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments: self.ask(name, *arguments)


def numbers(profile: Profile) -> list[Register]:
    """What can be read and written, without the identity, and without a target that must be started first."""
    return [
        row
        for row in profile.table.values()
        if row.readable
        and row.writable
        and row.effect is not Effect.IDENTITY
        and not (row.effect is Effect.MOTION and profile.nmt == "standard")
    ]


@pytest.mark.parametrize("profile", PROFILES.values(), ids=list(PROFILES))
def test_reads_and_writes_every_object_by_its_name(profile: Profile, tmp_path: Path) -> None:
    with (
        can_bus(tmp_path, "0x25", profile=profile.name) as bus,
        Canopen(bus, profile, tmp_path) as peer,
    ):
        for row in profile.table.values():
            if row.readable:
                data = bytes.fromhex(peer.upload(row.address, row.subindex))
                assert len(data) == row.size, row.name
                assert peer.read(row.name) in (data.decode("latin-1"), row.decode(data)), row.name
        assert peer.read("node_id") == NODE
        for row in numbers(profile):
            value = 10 if row.low <= 10 <= row.high else row.low
            peer.write(row.name, value)
            assert peer.read(row.name) == value, row.name


def test_moves_a_servo_in_degrees(tmp_path: Path) -> None:
    profile = PROFILES["kst"]
    with can_bus(tmp_path) as bus, Canopen(bus, profile, tmp_path) as peer:
        peer.write_phys("goal_position", 10.9)
        while peer.read("present_position") != 109:
            pass
        assert peer.read_phys("present_position") == pytest.approx(10.9)
        assert [node["raw_position"] for node in bus.nodes()] == [109]


def test_is_refused_as_cia_301_says(tmp_path: Path) -> None:
    profile = PROFILES["kst"]
    with can_bus(tmp_path) as bus, Canopen(bus, profile, tmp_path) as peer:
        assert peer.write("present_position", 0) == {"abort": READ_ONLY}
        assert peer.write("goal_position", 2000) == {"abort": TOO_HIGH}
        assert peer.upload(0x6005, 0) == {"abort": NO_OBJECT}
        assert peer.read("node_id") == NODE


def test_its_scanner_finds_the_nodes(tmp_path: Path) -> None:
    nodes = [1, 0x25, 0x26, 127]
    with can_bus(tmp_path, "1,0x25,0x26,127") as bus, Canopen(bus, PROFILES["kst"], tmp_path) as peer:
        while peer.scan() != nodes:  # it waits half a second, which is short on a busy machine
            pass
