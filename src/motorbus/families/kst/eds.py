"""An electronic data sheet (CiA 306) for these servos, so that any CANopen tool knows their objects by name.

No vendor document of the kind was found, so it is written from the rows. The text depends on the arguments only. It
declares what the servos have; three objects that CiA 301 demands and they lack are added for tools that insist on them.

`Factor`, `Unit` and `Description` are not of CiA 306. python-canopen reads them, other tools ignore them.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import groupby
from textwrap import wrap
from typing import Final

from motorbus.core.register import Access, Coding, Register, Storage, changed
from motorbus.families.kst.profiles import DEFAULT_NODE, Profile

HEAD: Final = """[FileInfo]
FileName={file_name}
FileVersion=1
FileRevision=0
EDSVersion=4.0
Description={title} (motorbus profile {name})
CreationTime=12:00PM
CreationDate=11-21-2026
CreatedBy=motorbus
ModificationTime=12:00PM
ModificationDate=11-21-2026
ModifiedBy=motorbus

[DeviceInfo]
VendorName={vendor}
VendorNumber=0x00000000
ProductName={title}
ProductNumber=0x00000000
RevisionNumber=0x00000000
OrderCode={name}
BaudRate_10=0
BaudRate_20=1
BaudRate_50=1
BaudRate_125=1
BaudRate_250=1
BaudRate_500=1
BaudRate_800=1
BaudRate_1000=1
SimpleBootUpMaster=0
SimpleBootUpSlave=0
Granularity=0
DynamicChannelsSupported=0
GroupMessaging=0
NrOfRXPDO=0
NrOfTXPDO=0
LSS_Supported=0

[DummyUsage]
Dummy0001=0
Dummy0002=0
Dummy0003=0
Dummy0004=0
Dummy0005=0
Dummy0006=0
Dummy0007=0
"""
"""The date is that of the last revision of these descriptions."""
COMMENTS: Final = (
    "Written from public sources, not by the vendor. Vendor and product numbers are not known and left 0.",
    "Also at 100 kbit/s, for which CiA 306 has no BaudRate key.",
    "Factor, Unit and Description are no keys of CiA 306. Angles are in degrees.",
    "Tools round by Factor in their own way and need not keep the limits: where a count matters, give raw values.",
    "Sub-index 0 of 0x1010 is declared because CiA 301 demands it. It is in no source.",
)
NOT_IMPLEMENTED: Final = (
    "0x1000, 0x1001 and 0x1018 are NOT IMPLEMENTED: reading them ends in an abort or in silence."
)
COMPOUND: Final = """[{index}]
ParameterName={name}
ObjectType={kind}
SubNumber=2

[{index}sub0]
ParameterName=highest_sub_index
ObjectType=0x7
DataType=0x0005
AccessType=const
DefaultValue=1
PDOMapping=0
"""
COMPOUNDS: Final = {0x1010: ("store_parameters", "0x8"), 0x1018: ("identity_object", "0x9")}
"""Objects with a sub-index: name and object type, array or record."""
TYPES: Final = {(1, False): 0x0005, (2, False): 0x0006, (4, False): 0x0007, (2, True): 0x0003}
"""Data type of CiA 301 by size and sign."""
VISIBLE_STRING: Final = 0x0009
ACCESS: Final = {Access.READ: "ro", Access.WRITE: "wo", Access.READ_WRITE: "rw"}
WIDEST: Final = 200  # characters in a line of comment

_absent = partial(
    Register,
    access=Access.READ,
    storage=Storage.FACTORY,
    default=0,
    source="NOT IMPLEMENTED by these servos, declared for tools that insist on what CiA 301 demands",
)
MANDATORY: Final = (
    _absent(name="device_type", address=0x1000, size=4, subindex=0, high=0xFFFFFFFF),
    _absent(name="error_register", address=0x1001, size=1, subindex=0, high=0xFF),
    _absent(name="vendor_id", address=0x1018, size=4, subindex=1, high=0xFFFFFFFF),
)


def eds(
    profile: Profile, *, node_id: int = DEFAULT_NODE, with_mandatory: bool = False, file_name: str = ""
) -> str:
    """The data sheet of this profile, as text in ASCII with lines ended by a line feed.

    `node_id` (1 to 127) is the default of object 0x3000 in it. `with_mandatory` also declares 0x1000, 0x1001 and
    0x1018, marked as not implemented. Angles are in degrees. Raises RequestError for an impossible node id.
    """
    profile.table["node_id"].encode(node_id)
    rows = [changed(row, default=node_id) if row.name == "node_id" else row for row in profile.table.values()]
    remarks = [*COMMENTS, f"Sources: {profile.source}.", f"Conflicts: {profile.conflicts}."]
    for row in rows:
        said = "; ".join(filter(None, (row.note, row.conflict)))
        remarks += [f"{row.name}: {said}."] if said else []
    if with_mandatory:
        rows += MANDATORY
        remarks.append(NOT_IMPLEMENTED)
    rows.sort(key=lambda row: (row.address, row.subindex or 0))
    name = _plain(file_name or f"{profile.name}.eds").rstrip()
    head = HEAD.format(file_name=name, name=profile.name, title=profile.title, vendor=profile.vendor)
    lines = [line for remark in remarks for line in wrap(remark, WIDEST)]
    comments = {"Lines": len(lines), **{f"Line{number}": line for number, line in enumerate(lines, 1)}}
    return "\n".join(
        ["".join(map(_plain, head.splitlines())), _section("Comments", comments), *_lists(profile, rows)]
    )


def _plain(text: str) -> str:
    """One line of ASCII without a semicolon, which begins a comment."""
    for sign, replacement in (("°C", "degC"), ("°", " deg"), ("±", "+-"), (";", " | ")):
        text = text.replace(sign, replacement)
    return " ".join(text.split()).encode("ascii", "replace").decode("ascii") + "\n"


def _section(title: str, keys: dict[str, object]) -> str:
    return "".join([f"[{title}]\n", *(_plain(f"{key}={value}") for key, value in keys.items())])


def _lists(profile: Profile, rows: list[Register]) -> Iterator[str]:
    """The three lists of objects, each followed by the objects in it."""
    lists: dict[str, list[Register]] = {
        "MandatoryObjects": [],
        "OptionalObjects": [],
        "ManufacturerObjects": [],
    }
    for row in rows:
        kind = "ManufacturerObjects" if 0x2000 <= row.address < 0x6000 else "OptionalObjects"
        lists["MandatoryObjects" if row in MANDATORY else kind].append(row)
    for title, members in lists.items():
        indices = list(dict.fromkeys(row.address for row in members))
        numbered = {str(number): f"0x{index:04X}" for number, index in enumerate(indices, 1)}
        yield _section(title, {"SupportedObjects": len(indices), **numbered})
        for index, group in groupby(members, key=lambda row: row.address):
            name, suffix = f"{index:04X}", ""
            if index in COMPOUNDS:
                yield COMPOUND.format(index=name, name=COMPOUNDS[index][0], kind=COMPOUNDS[index][1])
                suffix = "sub1"
            for row in group:
                yield _section(name + suffix, _variable(profile, row))


def _variable(profile: Profile, row: Register) -> dict[str, object]:
    is_text = row in profile.version_rows
    signed = row.coding is Coding.TWOS_COMPLEMENT
    keys: dict[str, object] = {
        "ParameterName": row.name,
        "ObjectType": "0x7",
        "DataType": f"0x{VISIBLE_STRING if is_text else TYPES[row.size, signed]:04X}",
        "AccessType": "const" if is_text else ACCESS[row.access],
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
    choices = ", ".join(f"{raw}: {name}" for raw, name in row.choices.items())
    bits = ", ".join(f"bit {bit}: {name}" for bit, name in row.bits.items())
    keys["Description"] = " | ".join(filter(None, (choices, bits, row.source)))
    return keys
