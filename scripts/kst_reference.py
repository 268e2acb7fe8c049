"""Generates docs/reference/kst.md from the object dictionaries, abort codes and simulator options of KST.

`--check` fails if the page is not current.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Final

from motorbus.core.register import Register
from motorbus.families.kst.profiles import BIT_RATES, PROFILES, Profile
from motorbus.families.kst.sdo import ABORTS
from motorbus.families.kst.simulator.quirks import Quirks
from scripts.pages import kept, listed

PAGE: Final = Path(__file__).resolve().parent.parent / "docs" / "reference" / "kst.md"
MANUAL_TESTS: Final = "tests/simulators/kst/test_manual.py"
DECODE_TESTS: Final = "tests/protocol/kst/test_decode.py"
ERRATA_TESTS: Final = "tests/simulators/kst/test_errata.py"

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
        "command_1_sets_the_bit_rate_which_counts_after_save_and_restart",
    ),
    (
        2,
        "set node id",
        "0x3000",
        "`set_node_id`",
        "command_2_sets_the_node_id_which_counts_after_save_and_restart",
    ),
    (3, "save", "0x1010", "`save`", "command_3_saves_and_is_not_answered"),
    (4, "read node id", "0x3000", "`node_id`", "command_4_reads_the_node_id_whatever_stands_in_x"),
    (5, "set position", "0x6003", "`move`", "commands_5_and_6_set_a_position_and_read_it"),
    (6, "read position", "0x6002", "`position`", "commands_5_and_6_set_a_position_and_read_it"),
    (7, "read status", "0x6002", "`status`", "command_7_reads_two_status_bytes_by_the_frame_of_command_6"),
    (8, "read version", "0x100A", "`version`", "command_8_reads_the_version_first_character_first"),
    (9, "failure reply", "any", "raises `DeviceError`", "command_9_refuses_with_the_index_of_the_request"),
)
"""Number in the manual, name, object, method of `motorbus.kst.Servo`, test."""

ERRATA: Final = (
    (1, "Identifiers are printed with four bytes; the text says standard frame.", "11 bits; `id_format=ext` for 29.",
     "1_identifiers_of_four_bytes_get_the_form_they_were_asked_in"),
    (2, "Status and position are one frame.", "Profile `kst` returns the raw bytes; the others read 0x6005.",
     "2_status_and_position_share_a_frame"),
    (3, "The request for the node id has a data byte.", "0 is sent; the simulator ignores it.",
     "3_the_data_of_a_read_are_ignored"),
    (4, "Broadcast: which commands, and who replies?", "Every servo replies to a read; a scan uses it.",
     "4_a_broadcast_read_is_answered_by_everyone_in_order"),
    (5, "A save has no reply; CiA 301 demands one.", "A reply that comes is accepted; then 150 ms pause.",
     "5_a_save_is_not_answered_or_is"),
    (6, "Id and rate need a restart; no command restarts.", "`provision` asks for a power cycle.",
     "6_only_the_supply_restarts_a_servo"),
    (7, "Does 0x3000 read the new id before the restart?", "Either value is accepted.",
     "7_a_new_id_reads_at_once_and_the_servo_answers_under_the_old_one"),
    (8, "What does a save keep?", "Configuration, never the goal.",
     "8_a_save_keeps_configuration_and_never_the_target"),
    (9, "The goal after a restart is not stated.", "0.",
     "9_after_a_restart_the_target_is_a_default_and_the_shaft_stays"),
    (10, "Abort codes are printed high word first.", "Low byte first; a byte-swapped code is recognised.",
     "10_an_abort_code_stands_low_byte_first"),
    (11, "An abort names the index only.", "Bytes 1 to 3 of the request.", "11_a_refusal_names_the_object"),
    (12, "Is a position out of range refused or clamped?", "Refused before it is sent.",
     "12_out_of_range_is_refused_or_taken_as_the_nearest"),
    (13, "Range ±90°; three drivers use ±100°.", "A value of the profile.", "13_the_range_belongs_to_the_profile"),
    (14, "Rounding of degrees.", "Half a count away from zero, in decimal.", "14_a_position_is_exact_in_counts"),
    (15, "The bit rate cannot be read.", "It is tried once.", "15_the_bit_rate_cannot_be_read"),
    (16, "Version: four characters; CiA 301: any length.", "Both are read.",
     "16_a_version_of_more_than_four_characters_comes_in_segments"),
    (17, "Unknown objects.", "One abort code per cause.", "17_what_is_not_there_is_refused_by_its_own_code"),
    (18, "Requests of other than 8 bytes.", "Ignored.", "18_a_request_that_has_not_eight_bytes_is_ignored"),
    (19, "Unknown rate codes and ids.", "0x06090030.", "19_impossible_codes_and_ids_are_refused"),
    (20, "Two new servos share 0x25.", "Equal replies are one frame, others collide.",
     "20_of_two_as_shipped_equal_answers_are_one_and_unequal_ones_break"),
    (21, "The default rate is provisional.", "A scan listens first, then tries each rate.",
     "21_at_another_rate_there_is_no_answer_but_broken_frames"),
    (22, "Late replies.", "Index and sub-index of every reply are compared.", "22_replies_say_what_they_answer"),
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
        [
            f"`{one.name}`",
            one.vendor,
            one.counts_per_degree,
            f"±{one.limit}",
            one.nmt,
            one.source,
            one.conflicts,
        ]
        for one in PROFILES.values()
    ]
    yield from listed(("profile", "maker", "counts/°", "range", "start", "source", "in doubt"), rows)


def _objects(profile: Profile) -> Iterator[str]:
    yield f"## Objects of {profile.name}\n"
    yield f"{profile.title}. {len(profile.table)} objects.\n"
    columns = (
        "object",
        "name",
        "bytes",
        "in",
        "access",
        "range",
        "unit",
        "effect",
        "source",
        "in doubt",
        "note",
    )
    yield from listed(columns, map(_row, profile.table.values()))


def _row(row: Register) -> list[object]:
    unit = f"{row.scale:.6g} {row.unit}" if row.unit else ""
    effect = row.effect.name.lower() if row.writable else ""
    span = f"{row.low} to {row.high}"
    return [
        *(f"0x{row.address:04X}:{row.subindex or 0:02X}", f"`{row.name}`", row.size, row.storage.value),
        *(row.access.value, span, unit, effect, row.source, row.conflict, row.note),
    ]


def _commands() -> Iterator[str]:
    yield "## Commands of the manual\n"
    yield f"The tests are in `{MANUAL_TESTS}`.\n"
    rows = [[*row[:4], f"`test_{row[4]}`"] for row in COMMANDS]
    yield from listed(("command", "name", "object", "method", "test"), rows)
    yield (
        "Bit-rate codes of command 1: "
        + ", ".join(f"{code} = {rate}" for code, rate in BIT_RATES.items())
        + ".\n"
    )


def _aborts() -> Iterator[str]:
    yield "## Abort codes\n"
    yield f"`motorbus frame` decodes each (`{DECODE_TESTS}::test_each_abort_code_is_decoded_in_both_byte_orders`). The"
    yield f"simulator sends 13 (`{MANUAL_TESTS}::test_the_codes_of_the_list_that_a_servo_can_have_cause_for`).\n"
    yield from listed(("code", "meaning"), [[f"0x{code:08X}", text] for code, text in ABORTS.items()])


def _errata() -> Iterator[str]:
    yield "## Errata\n"
    yield f"What the manual leaves open or states wrongly. The tests are in `{ERRATA_TESTS}`.\n"
    rows = [[*row[:3], f"`test_erratum_{row[3]}`"] for row in ERRATA]
    yield from listed(("#", "manual", "motorbus", "test"), rows)


def _assumptions() -> Iterator[str]:
    yield "## Assumptions\n"
    yield "Behaviour on which sources disagree or are silent. The simulator takes each as an option:"
    yield "`kst:sim,ids=0x25,out_of_range=clamp`. A report from a real servo is welcome.\n"
    rows = [
        [f"`{one.name}`", _default(one.default), *map(one.metadata.get, ("help", "source"))]
        for one in fields(Quirks)
    ]
    yield from listed(("option", "default", "meaning", "source"), rows)


def _default(value: object) -> object:
    return ("yes" if value else "no") if isinstance(value, bool) else value


def main() -> int:
    """Write the page; with --check return 1 if it is not current."""
    return kept({PAGE: page()})


if __name__ == "__main__":
    sys.exit(main())
