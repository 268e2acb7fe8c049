"""An electronic data sheet (CiA 306) for these servos, so that any CANopen tool knows their objects by name.

No vendor document of the kind was found, so it is written from the rows. The text depends on the arguments only. It
declares what the servos have; three objects that CiA 301 demands and they lack are added for tools that insist on them.

`Factor`, `Unit` and `Description` are not of CiA 306. python-canopen reads them, other tools ignore them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from itertools import groupby
from textwrap import wrap
from typing import Final, NamedTuple, TypeAlias

from motorbus.core.register import Access, Coding, Register, Storage, changed
from motorbus.families.kst.profiles import DEFAULT_NODE, RATES, Profile


class Moment(NamedTuple):
    """A date and a time of day (24 hours) for the head of the file."""

    year: int
    month: int
    day: int
    hour: int = 0
    minute: int = 0


REVISED: Final = Moment(2026, 11, 21, 12, 0)
"""When these descriptions were last revised: the date in a file for which no other is given."""

Keys: TypeAlias = dict[str, object]

_VISIBLE_STRING: Final = 0x0009
_TYPES: Final = {(1, False): 0x0005, (2, False): 0x0006, (4, False): 0x0007, (2, True): 0x0003}
"""Data type of CiA 301 by size and sign."""
_ACCESS: Final = {Access.READ: "ro", Access.WRITE: "wo", Access.READ_WRITE: "rw"}
_DECLARABLE: Final = (10, 20, 50, 125, 250, 500, 800, 1000)
"""The rates (kbit/s) for which CiA 306 has a key."""
_UNUSED: Final = (
    "SimpleBootUpMaster",
    "SimpleBootUpSlave",
    "Granularity",
    "DynamicChannelsSupported",
    "GroupMessaging",
    "NrOfRXPDO",
    "NrOfTXPDO",
    "LSS_Supported",
)
_COMPOUND: Final = {0x1010: ("store_parameters", "0x8"), 0x1018: ("identity_object", "0x9")}
"""Objects with sub-indices: name and object type, array or record."""
_WIDEST: Final = 200
"""Characters in a line of comment."""

_absent = partial(
    Register,
    access=Access.READ,
    storage=Storage.FACTORY,
    default=0,
    source="NOT IMPLEMENTED by these servos, declared for tools that insist on what CiA 301 demands",
)
_MANDATORY: Final = (
    _absent(name="device_type", address=0x1000, size=4, subindex=0, high=0xFFFFFFFF),
    _absent(name="error_register", address=0x1001, size=1, subindex=0, high=0xFF),
    _absent(name="vendor_id", address=0x1018, size=4, subindex=1, high=0xFFFFFFFF),
)


def eds(
    profile: Profile,
    *,
    node_id: int = DEFAULT_NODE,
    with_mandatory: bool = False,
    file_name: str = "",
    creator: str = "motorbus",
    made: Moment = REVISED,
) -> str:
    """The data sheet of this profile, as text in ASCII with lines ended by a line feed.

    `node_id` (1 to 127) is the default of object 0x3000 in it. `with_mandatory` also declares 0x1000, 0x1001 and
    0x1018, marked as not implemented. `file_name`, `creator` and `made` go into the head. Angles are in degrees.
    Raises RequestError for an impossible node id.
    """
    profile.table["node_id"].encode(node_id)
    rows = [changed(row, default=node_id) if row.name == "node_id" else row for row in profile.table.values()]
    if with_mandatory:
        rows += _MANDATORY
    rows.sort(key=lambda row: (row.address, row.subindex or 0))
    time = f"{(made.hour + 11) % 12 + 1:02}:{made.minute:02}{'AM' if made.hour < 12 else 'PM'}"
    date = f"{made.month:02}-{made.day:02}-{made.year}"
    file: Keys = {
        "FileName": file_name or f"{profile.name}.eds",
        "FileVersion": 1,
        "FileRevision": 0,
        "EDSVersion": "4.0",
        "Description": f"{profile.title} (motorbus profile {profile.name})",
        "CreationTime": time,
        "CreationDate": date,
        "CreatedBy": creator,
        "ModificationTime": time,
        "ModificationDate": date,
        "ModifiedBy": creator,
    }
    device: Keys = {
        "VendorName": profile.vendor,
        "VendorNumber": "0x00000000",
        "ProductName": profile.title,
        "ProductNumber": "0x00000000",
        "RevisionNumber": "0x00000000",
        "OrderCode": profile.name,
        **{f"BaudRate_{rate}": int(rate * 1000 in RATES) for rate in _DECLARABLE},
        **dict.fromkeys(_UNUSED, 0),
    }
    sections = [
        _section("FileInfo", file),
        _section("DeviceInfo", device),
        _section("DummyUsage", {f"Dummy{number:04}": 0 for number in range(1, 8)}),
        _section("Comments", _comments(profile, with_mandatory)),
        *_lists(profile, rows),
    ]
    return "\n".join(sections)


def _section(title: str, keys: Keys) -> str:
    return "".join([f"[{title}]\n", *(f"{key}={_plain(value)}\n" for key, value in keys.items())])


def _plain(value: object) -> str:
    """One line of ASCII without a semicolon, which begins a comment."""
    text = str(value)
    for sign, replacement in (("°C", "degC"), ("°", " deg"), ("±", "+-"), (";", " | ")):
        text = text.replace(sign, replacement)
    return " ".join(text.split()).encode("ascii", "replace").decode("ascii")


def _comments(profile: Profile, with_mandatory: bool) -> Keys:
    undeclared = ", ".join(f"{rate // 1000} kbit/s" for rate in RATES if rate // 1000 not in _DECLARABLE)
    remarks = [
        "Written from public sources, not by the vendor. Vendor and product numbers are not known and left 0.",
        f"Also at {undeclared}, for which CiA 306 has no BaudRate key.",
        "Factor, Unit and Description are no keys of CiA 306. Angles are in degrees.",
        "Tools round by Factor in their own way and need not keep the limits: where a count matters, give raw values.",
        "Sub-index 0 of 0x1010 is declared because CiA 301 demands it. It is in no source.",
        f"Sources: {profile.source}.",
        f"Conflicts: {profile.conflicts}.",
    ]
    remarks += [
        f"{row.name}: {'; '.join(filter(None, (row.note, row.conflict)))}."
        for row in profile.table.values()
        if row.note or row.conflict
    ]
    if with_mandatory:
        remarks.append(
            "0x1000, 0x1001 and 0x1018 are NOT IMPLEMENTED: reading them ends in an abort or in silence."
        )
    lines = [line for remark in remarks for line in wrap(remark, _WIDEST)]
    return {"Lines": len(lines), **{f"Line{number}": line for number, line in enumerate(lines, 1)}}


def _lists(profile: Profile, rows: list[Register]) -> Iterator[str]:
    """The three lists of objects, each followed by the objects in it."""

    def kind(index: int) -> str:
        if index in {row.address for row in _MANDATORY}:
            return "MandatoryObjects"
        return "ManufacturerObjects" if 0x2000 <= index < 0x6000 else "OptionalObjects"

    for title in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        members = [row for row in rows if kind(row.address) == title]
        indices = sorted({row.address for row in members})
        numbered = {str(number): f"0x{index:04X}" for number, index in enumerate(indices, 1)}
        yield _section(title, {"SupportedObjects": len(indices), **numbered})
        for index, group in groupby(members, key=lambda row: row.address):
            parts = list(group)
            if index in _COMPOUND:
                yield from _compound(f"{index:04X}", *_COMPOUND[index], parts[-1].subindex or 0)
            for row in parts:
                suffix = f"sub{row.subindex:X}" if index in _COMPOUND else ""
                yield _section(f"{index:04X}{suffix}", _variable(profile, row))


def _compound(title: str, name: str, kind: str, highest: int) -> Iterator[str]:
    yield _section(title, {"ParameterName": name, "ObjectType": kind, "SubNumber": highest + 1})
    count: Keys = {
        "ParameterName": "highest_sub_index",
        "ObjectType": "0x7",
        "DataType": "0x0005",
        "AccessType": "const",
        "DefaultValue": highest,
        "PDOMapping": 0,
    }
    yield _section(f"{title}sub0", count)


def _variable(profile: Profile, row: Register) -> Keys:
    is_text = row in profile.version_rows
    signed = row.coding is Coding.TWOS_COMPLEMENT
    keys: Keys = {
        "ParameterName": row.name,
        "ObjectType": "0x7",
        "DataType": f"0x{_VISIBLE_STRING if is_text else _TYPES[row.size, signed]:04X}",
        "AccessType": "const" if is_text else _ACCESS[row.access],
    }
    if row.default is not None:
        keys["DefaultValue"] = row.default
    keys["PDOMapping"] = 0
    if signed or (row.low, row.high) != (
        0,
        (1 << 8 * row.size) - 1,
    ):  # in decimal, which all tools read alike
        keys |= {"LowLimit": row.low, "HighLimit": row.high}
    if row.unit:
        in_degrees = {"Factor": 1 / profile.counts_per_degree, "Unit": "deg"}
        keys |= in_degrees if row.unit == "rad" else {"Factor": row.scale, "Unit": row.unit}
    bits = ((f"bit {bit}", name) for bit, name in row.bits.items())
    keys["Description"] = " | ".join(filter(None, (_named(row.choices.items()), _named(bits), row.source)))
    return keys


def _named(pairs: Iterable[tuple[object, str]]) -> str:
    return ", ".join(f"{value}: {name}" for value, name in pairs)
