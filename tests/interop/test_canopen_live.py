"""python-canopen, unmodified, works with our simulated servos.

It knows neither these servos nor us: objects, sizes and units come from the file, replies from the simulator in
another process, by slcan.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from motorbus.core.register import Coding, Register
from motorbus.core.request import Effect
from motorbus.families.kst.profiles import PROFILES, VERSIONS, Profile
from tests.interop.can_bus import Way, can_bus
from tests.interop.canopen_peer import Canopen, CanopenError

NODE = 0x25
PATIENCE = 10.0
"""s that it waits for a reply; its own 0.3 s may be short on a busy machine."""
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


def canopen(way: Way, profile: Profile, folder: Path) -> Canopen:
    """The library with the objects of this profile."""
    file = folder / f"{profile.name}.eds"
    file.write_text(dictionary(profile), encoding="ascii")
    peer = Canopen(way.interface, way.channel, way.kwargs, file, NODE)
    peer.timeout(PATIENCE)
    return peer


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
        canopen(bus.way(), profile, tmp_path) as peer,
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
    with can_bus(tmp_path) as bus, canopen(bus.way(), profile, tmp_path) as peer:
        peer.write_phys("goal_position", 10.9)
        while peer.read("present_position") != 109:
            pass
        assert peer.read_phys("present_position") == pytest.approx(10.9)
        assert [node["raw_position"] for node in bus.nodes()] == [109]


def test_is_refused_as_cia_301_says(tmp_path: Path) -> None:
    profile = PROFILES["kst"]
    with can_bus(tmp_path) as bus, canopen(bus.way(), profile, tmp_path) as peer:
        for request, code in (
            (partial(peer.write, "present_position", 0), READ_ONLY),
            (partial(peer.write, "goal_position", 2000), TOO_HIGH),
            (partial(peer.upload, 0x6005, 0), NO_OBJECT),
        ):
            with pytest.raises(CanopenError) as caught:
                request()
            assert (caught.value.kind, caught.value.code) == ("SdoAbortedError", code)
        assert peer.read("node_id") == NODE


def test_its_scanner_finds_the_nodes(tmp_path: Path) -> None:
    with (
        can_bus(tmp_path, ids="1,0x25,0x26,127") as bus,
        canopen(bus.way(), PROFILES["kst"], tmp_path) as peer,
    ):
        found: list[int] = []
        while found != [
            1,
            0x25,
            0x26,
            127,
        ]:  # it gives them half a second, which a busy machine may need twice
            found = peer.scan()
