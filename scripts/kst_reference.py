"""Generates docs/reference/kst.md from the object dictionaries, abort codes and simulator options of KST.

`--check` fails if the page is not current.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from motorbus.core.register import Register
from motorbus.families.kst.profiles import BIT_RATES, PROFILES, Profile
from motorbus.families.kst.sdo import ABORTS
from motorbus.families.kst.simulator import OPTIONS
from scripts.pages import kept, listed

PAGE: Final = Path(__file__).resolve().parent.parent / "docs" / "reference" / "kst.md"
MANUAL_TESTS: Final = "tests/simulators/kst/test_manual.py"
DECODE_TESTS: Final = "tests/protocol/kst/test_decode.py"
ERRATA_TESTS: Final = "tests/families/kst/test_errata.py"

HEAD: Final = """# KST reference

Objects, commands, abort codes and open questions of the KST CAN protocol. `python -m scripts.kst_reference` generates
this page from the tables that the program uses. Source of each row: the KST CAN protocol manual, or the public driver
named. No KST servo was available; what no source states is an [assumption](#assumptions).

Frames: request 0x600 + node, reply 0x580 + node, 8 data bytes, little-endian. Node 1 to 127, default 37 (0x25); node 0
means all servos. Bit rate 500 kbit/s as shipped.
"""

COMMANDS: Final = (
    (
        1,
        "set bit rate",
        "0x3001",
        "`set_bit_rate`",
        "command_1_sets_bit_rate_in_force_after_save_and_restart",
    ),
    (2, "set node id", "0x3000", "`set_node_id`", "command_2_sets_node_id_in_force_after_save_and_restart"),
    (3, "save", "0x1010", "`save`", "command_3_saves_without_a_reply"),
    (4, "read node id", "0x3000", "`node_id`", "command_4_reads_node_id_with_any_data"),
    (5, "set position", "0x6003", "`move`", "commands_5_and_6_set_and_read_position"),
    (6, "read position", "0x6002", "`position`", "commands_5_and_6_set_and_read_position"),
    (7, "read status", "0x6002", "`status`", "command_7_reads_two_status_bytes_by_the_frame_of_command_6"),
    (8, "read version", "0x100A", "`version`", "command_8_reads_version_first_character_first"),
    (9, "failure reply", "any", "raises `DeviceError`", "command_9_names_the_index_of_the_request"),
)
"""Number in the manual, name, object, method of `motorbus.kst.Servo`, test."""

ERRATA: Final = (
    (1, "Identifiers are printed with four bytes; the text says standard frame.", "11 bits; `id_format=ext` for 29.",
     "erratum_1_identifiers_have_11_bits_or_29_by_setting"),
    (2, "Status and position are one frame.", "Profile `kst` returns the raw bytes; the others read 0x6005.",
     "erratum_2_status_is_raw_bytes_where_it_has_the_frame_of_the_position"),
    (3, "The request for the node id has a data byte.", "0 is sent; the simulator ignores it.",
     "erratum_3_node_id_is_read_with_zeros"),
    (4, "Broadcast: which commands, and who replies?", "Every servo replies to a read; a scan uses it.",
     "erratum_4_scan_reads_all_at_once_and_silent_ids_one_by_one"),
    (5, "A save has no reply; CiA 301 demands one.", "A reply that comes is accepted; then 150 ms pause.",
     "erratum_5_save_accepts_a_reply_and_waits_for_the_flash"),
    (6, "Id and rate need a restart; no command restarts.", "`provision` asks for a power cycle.",
     "erratum_6_provision_asks_for_a_power_cycle"),
    (7, "Does 0x3000 read the new id before the restart?", "Either value is accepted.",
     "erratum_7_either_id_may_be_read_before_the_restart"),
    (8, "What does a save keep?", "Configuration, never the goal.",
     "errata_8_and_9_save_keeps_settings_and_not_the_target"),
    (9, "The goal after a restart is not stated.", "0.", "errata_8_and_9_save_keeps_settings_and_not_the_target"),
    (10, "Abort codes are printed high word first.", "Low byte first; a byte-swapped code is recognised.",
     "erratum_10_abort_code_is_recognised_in_both_byte_orders"),
    (11, "An abort names the index only.", "Bytes 1 to 3 of the request, or zeros in their place.",
     "erratum_11_abort_is_accepted_with_index_and_sub_index_or_less"),
    (12, "Is a position out of range refused or clamped?", "Refused before it is sent.",
     "errata_12_and_13_position_outside_the_range_of_the_profile_is_not_sent"),
    (13, "Range ±90°; three drivers use ±100°.", "A value of the profile.",
     "errata_12_and_13_position_outside_the_range_of_the_profile_is_not_sent"),
    (14, "Rounding of degrees.", "Half a count away from zero, in decimal.",
     "erratum_14_half_a_count_rounds_away_from_zero"),
    (15, "The bit rate cannot be read.", "It is tried once.", "erratum_15_bit_rate_is_read_once_and_may_be_unknown"),
    (16, "Version: four characters; CiA 301: any length.", "Both are read.",
     "erratum_16_version_has_four_characters_or_any_number"),
    (17, "Unknown objects.", "One abort code per cause.",
     "erratum_17_missing_object_is_refused_by_name_and_left_out_of_all"),
    (18, "Requests of other than 8 bytes.", "Ignored.",
     "erratum_18_requests_have_eight_bytes_and_others_no_reply"),
    (19, "Unknown rate codes and ids.", "0x06090030.", "erratum_19_impossible_id_or_rate_is_refused"),
    (20, "Two new servos share 0x25.", "Equal replies are one frame, others collide.",
     "erratum_20_two_servos_with_one_id_get_no_other"),
    (21, "The default rate is provisional.", "A scan listens first, then tries each rate.",
     "erratum_21_scan_of_other_rates_listens_before_it_sends"),
    (22, "Late replies.", "Index and sub-index of every reply are compared.",
     "erratum_22_reply_to_another_request_is_not_accepted"),
)  # fmt: skip
"""Number, what the manual leaves open or states wrongly, what motorbus does, test."""


def page() -> str:
    """The whole page."""
    parts = (
        _profiles(),
        *map(_objects, PROFILES.values()),
        _commands(),
        _aborts(),
        _errata(),
        _assumptions(),
    )
    return "\n".join([HEAD, *(line for part in parts for line in part)])


def _profiles() -> Iterator[str]:
    yield "## Profiles\n"
    yield "No servo reports its maker, so the address has it: `kst:PORT,profile=xqpower`.\n"
    rows = [
        (
            f"`{one.name}`",
            one.vendor,
            one.counts_per_degree,
            f"±{one.limit}",
            one.nmt,
            one.source,
            one.conflicts,
        )
        for one in PROFILES.values()
    ]
    yield from listed(("profile", "maker", "counts/°", "range", "start", "source", "in doubt"), rows)
    yield f"`{MANUAL_TESTS}::test_object_has_the_size_and_access_of_its_row` tests each object below.\n"


def _objects(profile: Profile) -> Iterator[str]:
    yield f"## Objects of {profile.name}\n"
    yield f"{profile.title}. {len(profile.table)} objects.\n"
    facts = ("object", "name", "bytes", "in", "access", "range", "unit", "effect")
    yield from listed((*facts, "source", "in doubt", "note"), map(_row, profile.table.values()))


def _row(row: Register) -> list[object]:
    unit = f"{row.scale:.6g} {row.unit}" if row.unit else ""
    effect = row.effect.name.lower() if row.writable else ""
    return [
        *(f"0x{row.address:04X}:{row.subindex or 0:02X}", f"`{row.name}`", row.size, row.storage.value),
        *(row.access.value, f"{row.low} to {row.high}", unit, effect, row.source, row.conflict, row.note),
    ]


def _commands() -> Iterator[str]:
    yield "## Commands of the manual\n"
    yield f"The tests are in `{MANUAL_TESTS}`.\n"
    rows = [[*row, f"`test_{test}`"] for *row, test in COMMANDS]
    yield from listed(("command", "name", "object", "method", "test"), rows)
    codes = ", ".join(f"{code} = {rate}" for code, rate in BIT_RATES.items())
    yield f"Bit-rate codes of command 1: {codes}.\n"


def _aborts() -> Iterator[str]:
    yield "## Abort codes\n"
    yield f"`motorbus frame` decodes each (`{DECODE_TESTS}::test_abort_code_is_decoded_in_both_byte_orders`). The"
    yield f"simulator sends 13 (`{MANUAL_TESTS}::test_servo_sends_abort_codes_of_the_list`).\n"
    yield from listed(("code", "meaning"), [[f"0x{code:08X}", text] for code, text in ABORTS.items()])


def _errata() -> Iterator[str]:
    yield "## Errata\n"
    yield f"What the manual leaves open or states wrongly. The tests are in `{ERRATA_TESTS}`.\n"
    rows = [[*row, f"`test_{test}`"] for *row, test in ERRATA]
    yield from listed(("#", "manual", "motorbus", "test"), rows)


def _assumptions() -> Iterator[str]:
    yield "## Assumptions\n"
    yield "Behaviour on which sources disagree or are silent. The simulator takes each as an option:"
    yield "`kst:sim,ids=0x25,out_of_range=clamp`. A report from a real servo is welcome.\n"
    rows = []
    for one in OPTIONS:
        if one.source:
            default = one.default if one.kind is not bool else "yes" if one.default else "no"
            rows.append((f"`{one.name}`", default, one.help, one.source))
    yield from listed(("option", "default", "meaning", "source"), rows)


def main() -> int:
    """Write the page; with --check return 1 if it is not current."""
    return kept({PAGE: page()})


if __name__ == "__main__":
    sys.exit(main())
