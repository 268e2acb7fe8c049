"""Each frame that the KST CAN protocol manual prints, and the exact reply of a simulated servo."""

from __future__ import annotations

import pytest

from motorbus.families.kst.profiles import PROFILES, RATES
from tests.protocol.kst.vectors import MANUAL
from tests.simulators.kst.host import READ_ID, READ_POSITION, SAVE, SET_ID, Host

POSITIONS = {-900: "7CFC", -109: "93FF", -8: "F8FF", 0: "0000", 8: "0800", 109: "6D00", 900: "8403"}
"""The seven columns of the table of positions: raw value, and its two bytes."""


@pytest.mark.parametrize("code", range(8))
def test_command_1_sets_bit_rate_in_force_after_save_and_restart(code: int) -> None:
    host = Host()
    assert host.ask(f"22013000{code:02X}000000") == ["6001300000000000"]
    host.restart()
    assert host[0x25].bit_rate == 500_000
    host.ask(f"22013000{code:02X}000000")
    host.restart(save=True)
    assert host[0x25].bit_rate == RATES[code]


def test_command_2_sets_node_id_in_force_after_save_and_restart() -> None:
    host = Host()
    assert host.ask(SET_ID) == ["6000300000000000"]
    host.restart()
    assert host.ask(READ_ID) == ["4F00300025000000"]
    host.ask(SET_ID)
    host.send(SAVE)
    host.wait(0.2)
    assert host.send(f"626#{READ_ID}") == []
    host.restart()
    assert host.send(READ_ID, f"626#{READ_ID}") == ["5A6#4F00300026000000"]
    assert list(host.bus.nodes) == [0x26]


def test_command_3_saves_without_a_reply() -> None:
    host = Host()
    host.ask("2201300004000000")
    assert host[0x25].status()["saved"] is False
    assert host.send(SAVE) + host.wait(1.0) == []
    assert host[0x25].status()["saved"] is True
    assert host.ask("2210100165766173") == ["8010100120000008"], "the letters in the wrong order"


@pytest.mark.parametrize("x", [0x00, 0x25, 0xFF])
def test_command_4_reads_node_id_with_any_data(x: int) -> None:
    assert Host().ask(f"40003000{x:02X}000000") == ["4F00300025000000"]


@pytest.mark.parametrize("raw", POSITIONS)
def test_commands_5_and_6_set_and_read_position(raw: int) -> None:
    host = Host()
    host[0x25].raw_position = 400
    assert host.ask(f"22036000{POSITIONS[raw]}0000") == ["6003600000000000"]
    assert host[0x25].status()["moving"] is True
    host.wait(2.0)
    assert host.ask(READ_POSITION) == [f"4B026000{POSITIONS[raw]}0000"]
    host.restart(save=True)
    assert (host[0x25].memory["goal_position"], host[0x25].raw_position) == (0, raw)


def test_command_7_reads_two_status_bytes_by_the_frame_of_command_6() -> None:
    host = Host()
    host[0x25].raw_position = 0x0140
    assert host.ask(READ_POSITION) == ["4B02600040010000"]


def test_command_8_reads_version_first_character_first() -> None:
    assert Host().ask("400A100000000000") == ["430A100056312E32"]


def test_command_9_names_the_index_of_the_request() -> None:
    assert Host().ask("4005600000000000") == ["8005600000000206"]


def test_printed_request_has_a_printed_reply() -> None:
    printed = {str(vector.frame) for vector in MANUAL if vector.direction == "status"}
    for vector in MANUAL:
        if vector.direction == "instruction":
            replies = Host().send(str(vector.frame))
            assert len(replies) == (vector.id != "save"), vector.id
            assert set(replies) <= printed, vector.id


@pytest.mark.parametrize("profile", PROFILES)
def test_object_has_the_size_and_access_of_its_row(profile: str) -> None:
    """A reply states the length; a request that states another one is refused."""
    for row in PROFILES[profile].table.values():
        host = Host(profile=profile)
        place = f"{row.address & 255:02X}{row.address >> 8:02X}{row.subindex or 0:02X}"
        (reply,) = host.ask(f"40{place}00000000")
        read = {1: "4F", 2: "4B", 4: "43"}[row.size] if row.readable else "80"
        assert reply.startswith(f"{read}{place}"), row.name
        assert row.readable or reply.endswith("01000106")
        for size, specifier in ((1, "2F"), (2, "2B"), (4, "23")):
            codes = host.ask(f"{specifier}{place}{row.encode(row.high).hex():0<8}")
            wrong = "12000706" if size > row.size else "13000706"
            if not row.writable:
                assert codes == [f"80{place}02000106"]
            elif size != row.size:
                assert codes == [f"80{place}{wrong}"], row.name
        assert host.ask(f"40{place[:4]}7F00000000") == [f"80{place[:4]}7F11000906"]


ABORTS = {
    "E003600000000000": "8003600001000405",
    "7003600000000000": "8003600001000405",
    "4001300000000000": "8001300001000106",
    "2202600000000000": "8002600002000106",
    "4018100000000000": "8018100000000206",
    "2303600000000000": "8003600012000706",
    "2F03600000000000": "8003600013000706",
    "4003600100000000": "8003600111000906",
    "2200300080000000": "8000300030000906",
    "2203600085030000": "8003600031000906",
    "220360007BFC0000": "8003600032000906",
    "2210100173617666": "8010100120000008",
}


def test_servo_sends_abort_codes_of_the_list() -> None:
    assert {request: Host().ask(request)[0] for request in ABORTS} == ABORTS
    assert Host(sized="yes").ask("2203600001000000") == ["8003600010000706"]
