"""Generates docs/reference/kst.md from the object dictionaries, abort codes and simulator options of KST.

`--check` fails if the page is not current.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from math import degrees
from pathlib import Path
from typing import Final

from motorbus.core.register import Register, Storage
from motorbus.core.request import Effect
from motorbus.families.kst.profiles import PROFILES, RATES
from motorbus.families.kst.sdo import ABORTS
from motorbus.families.kst.simulator import OPTIONS
from scripts.pages import assumptions, kept, listed

PAGE: Final = Path(__file__).resolve().parent.parent / "docs" / "reference" / "kst.md"
FAMILY: Final = PAGE.parents[2] / "src" / "motorbus" / "families" / "kst"
MANUAL_TESTS: Final = "tests/simulators/kst/test_manual.py"
DECODE_TESTS: Final = "tests/protocol/kst/test_decode.py"
ERRATA_TESTS: Final = "tests/families/kst/test_errata.py"

HEAD: Final = """# KST reference

Profiles, objects, commands, abort codes and open questions of the KST CAN protocol. Each row names its source: the KST
CAN protocol manual or a public driver. No KST servo was available. What no source states is an
[assumption](#assumptions).

A request has the CAN id 0x600 + node, its reply 0x580 + node. Both have 8 data bytes, little-endian. A node is 1 to
127; a new servo is 37 (0x25) at 500 kbit/s. Node 0 addresses all servos.

`python -m scripts.kst_reference` generates this page from the tables that the program uses.
"""

START: Final = {
    "none": "Moves without a start command.",
    "vendor": "Reports start by CAN id = node, data `01 00`.",
    "standard": "Reports and motion start by NMT of CiA 301: CAN id 0, data `01` and the node.",
}
"""`Profile.nmt` in words."""

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
    (9, "failure reply", "any object", "raises `DeviceError`", "command_9_names_the_index_of_the_request"),
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
    (9, "The goal after a restart is not stated.", "It is 0.", "errata_8_and_9_save_keeps_settings_and_not_the_target"),
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
    (15, "The bit rate cannot be read.", "It is only written.", "erratum_15_bit_rate_is_not_read"),
    (16, "Version: four characters; CiA 301: any length.", "Four are read.",
     "erratum_16_a_version_has_at_most_four_characters"),
    (17, "Unknown objects.", "One abort code per cause.",
     "erratum_17_missing_object_is_refused_by_name_and_left_out_of_all"),
    (18, "Requests of other than 8 bytes.", "Ignored.",
     "erratum_18_requests_have_eight_bytes_and_others_no_reply"),
    (19, "Unknown rate codes and ids.", "Refused with 0x06090030.", "erratum_19_impossible_id_or_rate_is_refused"),
    (20, "Two new servos share 0x25.", "Equal replies are one frame, others collide.",
     "erratum_20_two_servos_with_one_id_get_no_other"),
    (21, "The default rate is provisional.", "A scan tries each rate that is named.",
     "erratum_21_scan_tries_the_rates_that_are_named"),
    (22, "Late replies.", "Index and sub-index of every reply are compared.",
     "erratum_22_reply_to_another_request_is_not_accepted"),
)  # fmt: skip
"""Number, what the manual leaves open or states wrongly, what motorbus does, test."""


def page() -> str:
    """The whole page."""
    parts = (_profiles(), _objects(), _commands(), _aborts(), _errata(), _assumptions())
    return "\n".join([HEAD, *(line for part in parts for line in part)])


def _profiles() -> Iterator[str]:
    yield "## Profiles\n"
    yield "A profile is the dialect of one maker or firmware. No servo reports its maker, so the address names the"
    yield "profile: `kst:PORT,profile=xqpower`. Without a name it is `kst`.\n"
    rows = []
    for one in PROFILES.values():
        degrees_of_limit = f"{one.limit / one.counts_per_degree:.4g}°"
        scale = f"1° = {one.counts_per_degree} counts, range ±{degrees_of_limit} = ±{one.limit} counts."
        lines = (f"{one.table.title}.", scale, START[one.nmt], *_sources(one.source, one.conflicts))
        rows.append((f"`{one.name}`", "<br>".join(lines)))
    yield from listed(("profile", "servo"), rows)


def _objects() -> Iterator[str]:
    yield "## Objects\n"
    yield "An object has an index:sub-index and a name. A row without a profile holds for all profiles. Numbers are raw"
    yield "values. The effect of a write is motion, persistent (kept in EEPROM) or identity (node id, bit rate). The"
    yield "test of each row is"
    yield f"`{MANUAL_TESTS}::test_object_has_the_size_and_access_of_its_row`.\n"
    found: dict[tuple[str, str], list[str]] = {}
    for profile in PROFILES.values():
        for row in profile.table.values():
            name = f"0x{row.address:04X}:{row.subindex or 0:02X}<br>{row.name}"
            found.setdefault((name, _facts(row)), []).append(profile.name)
    rows = [
        (name if len(profiles) == len(PROFILES) else f"{name}<br>{', '.join(profiles)}", facts)
        for (name, facts), profiles in sorted(found.items(), key=lambda item: item[0][0])
    ]
    yield from listed(("object", "facts"), rows)


def _facts(row: Register) -> str:
    full = (row.low, row.high) == (0, 256**row.size - 1)
    facts = [
        "1 byte" if row.size == 1 else f"{row.size} bytes",
        row.access.name.lower().replace("_", " and "),
        "set by the maker" if row.storage is Storage.FACTORY else row.storage.value,
        "any value" if full else f"{row.low} to {row.high}",
    ]
    if row.unit:
        facts.append(
            f"1 = {degrees(row.scale):.4g}°" if row.unit == "rad" else f"1 = {row.scale:.4g} {row.unit}"
        )
    if row.effect is not Effect.NONE:
        facts.append(f"effect: {row.effect.name.lower()}")
    note = [f"{row.note[0].upper()}{row.note[1:]}."] if row.note else []
    return "<br>".join([f"{', '.join(facts)}.", *note, *_sources(row.source, row.conflict)])


def _sources(source: str, conflict: str) -> list[str]:
    return [f"Source: {source}.", *([f"In doubt: {conflict}."] if conflict else [])]


def _commands() -> Iterator[str]:
    yield "## Commands of the manual\n"
    yield "Each command with its method of `motorbus.kst.Servo`, its object and its test. The tests are in"
    yield f"`{MANUAL_TESTS}`.\n"
    rows = [
        (f"{number}. {name}", f"{method}, {address}<br>`test_{test}`")
        for number, name, address, method, test in COMMANDS
    ]
    yield from listed(("command", "method, object and test"), rows)
    yield "Bit rates (bit/s) and their codes in command 1:"
    yield f"{', '.join(f'{rate} is {code}' for code, rate in enumerate(RATES))}.\n"


def _aborts() -> Iterator[str]:
    yield "## Abort codes\n"
    yield "A servo refuses a request with one of these codes. `motorbus decode` explains each:"
    yield f"`{DECODE_TESTS}::test_abort_code_is_decoded_in_both_byte_orders`. The simulator sends 12 of them:"
    yield f"`{MANUAL_TESTS}::test_servo_sends_abort_codes_of_the_list`.\n"
    yield from listed(("code", "meaning"), [[f"0x{code:08X}", text] for code, text in ABORTS.items()])


def _errata() -> Iterator[str]:
    yield "## Errata\n"
    yield "What the manual leaves open or states wrongly, and what motorbus does. The tests are in"
    yield f"`{ERRATA_TESTS}`.\n"
    rows = [(f"{number}. {manual}", f"{chosen}<br>`test_{test}`") for number, manual, chosen, test in ERRATA]
    yield from listed(("manual", "motorbus and its test"), rows)


def _assumptions() -> Iterator[str]:
    yield "## Assumptions\n"
    yield "Behaviour on which sources disagree or are silent. Each is an option of the simulator with a default. An"
    yield "address sets another value: `kst:sim,ids=0x25,out_of_range=clamp`. A report from a real servo is welcome.\n"
    rows = []
    for one in OPTIONS:
        if one.source:
            default = one.default if one.kind is not bool else "yes" if one.default else "no"
            name = f"{one.name}<br>default {default}" if default != "" else one.name
            values = f"<br>Values: {', '.join(map(str, one.choices))}." if one.choices else ""
            rows.append((name, f"{one.help}.{values}<br>Source: {one.source}."))
    yield from listed(("option", "meaning"), rows)
    yield "\nConstants that no source states:\n"
    yield from listed(("where", "assumed"), list(assumptions(FAMILY)))


def main() -> int:
    """Write the page; with --check return 1 if it is not current."""
    return kept({PAGE: page()})


if __name__ == "__main__":
    sys.exit(main())
