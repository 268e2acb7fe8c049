"""An electronic data sheet (CiA 306) for these servos, so that any CANopen tool knows their objects by name.

No vendor document of the kind was found, so it is written from the rows, which say everything it needs. The text
depends on its arguments only: the same call gives the same file, whatever the day. It declares what the servos have;
three objects that CiA 301 demands and they lack are added for tools that insist on them.

`Factor`, `Unit` and `Description` are not of CiA 306. python-canopen reads them, other tools pass over them.
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
    """A date and a time of day (24 hours) as the head of the file says them. A family has no clock to look at."""

    year: int
    month: int
    day: int
    hour: int = 0
    minute: int = 0


REVISED: Final = Moment(2026, 11, 21, 12, 0)
"""When these descriptions were last revised: the date in a file for which no other is given."""

Keys: TypeAlias = dict[str, object]

_UNSIGNED: Final = {1: 0x0005, 2: 0x0006, 4: 0x0007}
_SIGNED: Final = {1: 0x0002, 2: 0x0003, 4: 0x0004}
_VISIBLE_STRING: Final = 0x0009
_VAR, _ARRAY, _RECORD = 0x7, 0x8, 0x9
_ACCESS: Final = {Access.READ: "ro", Access.WRITE: "wo", Access.READ_WRITE: "rw"}
_DECLARABLE: Final = (10, 20, 50, 125, 250, 500, 800, 1000)
"""The rates (kbit/s) for which CiA 306 has a key."""
_COMPOUND: Final = {0x1010: ("store_parameters", _ARRAY), 0x1018: ("identity_object", _RECORD)}
_WIDEST: Final = 200

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
    sections = [
        _file(profile, file_name or f"{profile.name}.eds", creator, made),
        _device(profile),
        _section("DummyUsage", {f"Dummy{number:04}": 0 for number in range(1, 8)}),
        _comments(profile, with_mandatory),
        *_lists(profile, sorted(rows, key=lambda row: (row.address, row.subindex or 0))),
    ]
    return "\n".join(sections)


def _section(title: str, keys: Keys) -> str:
    return "".join([f"[{title}]\n", *(f"{key}={_plain(value)}\n" for key, value in keys.items())])


def _plain(value: object) -> str:
    """One line of ASCII without a semicolon, which begins a comment."""
    text = str(value)
    for sign, said in (("°C", "degC"), ("°", " deg"), ("±", "+-"), (";", " | ")):
        text = text.replace(sign, said)
    return " ".join(text.split()).encode("ascii", "replace").decode("ascii")


def _file(profile: Profile, file_name: str, creator: str, made: Moment) -> str:
    half = "AM" if made.hour < 12 else "PM"
    time = f"{(made.hour + 11) % 12 + 1:02}:{made.minute:02}{half}"
    date = f"{made.month:02}-{made.day:02}-{made.year}"
    keys: Keys = {
        "FileName": file_name,
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
    return _section("FileInfo", keys)


def _device(profile: Profile) -> str:
    keys: Keys = {
        "VendorName": profile.vendor,
        "VendorNumber": "0x00000000",
        "ProductName": profile.title,
        "ProductNumber": "0x00000000",
        "RevisionNumber": "0x00000000",
        "OrderCode": profile.name,
        **{f"BaudRate_{rate}": int(rate * 1000 in RATES) for rate in _DECLARABLE},
        "SimpleBootUpMaster": 0,
        "SimpleBootUpSlave": 0,
        "Granularity": 0,
        "DynamicChannelsSupported": 0,
        "GroupMessaging": 0,
        "NrOfRXPDO": 0,
        "NrOfTXPDO": 0,
        "LSS_Supported": 0,
    }
    return _section("DeviceInfo", keys)


def _comments(profile: Profile, with_mandatory: bool) -> str:
    silent = ", ".join(f"{rate // 1000} kbit/s" for rate in RATES if rate // 1000 not in _DECLARABLE)
    remarks = [
        "Written from public sources, not by the vendor. Vendor and product numbers are not known and left 0.",
        f"Also at {silent}, for which CiA 306 has no BaudRate key.",
        "Factor, Unit and Description are no keys of CiA 306. Angles are in degrees.",
        "Tools round by Factor in their own way and need not keep the limits: where a count matters, give raw values.",
        "Sub-index 0 of 0x1010 is declared because CiA 301 demands it. It is in no source.",
        f"Sources: {profile.source}.",
        f"Conflicts: {profile.conflicts}.",
        *(f"{row.name}: {said}." for row in profile.table.values() if (said := _said(row))),
    ]
    if with_mandatory:
        remarks.append(
            "0x1000, 0x1001 and 0x1018 are NOT IMPLEMENTED: reading them ends in an abort or in silence."
        )
    lines = [line for remark in remarks for line in wrap(remark, _WIDEST)]
    numbered: Keys = {f"Line{number}": line for number, line in enumerate(lines, 1)}
    return _section("Comments", {"Lines": len(lines), **numbered})


def _said(row: Register) -> str:
    """What there is to know of it, and what its sources disagree about."""
    return "; ".join(filter(None, (row.note, row.conflict)))


def _lists(profile: Profile, rows: list[Register]) -> Iterator[str]:
    """The three lists, each followed by the objects in it."""
    kinds = {
        "MandatoryObjects": _is_mandatory,
        "OptionalObjects": _is_optional,
        "ManufacturerObjects": _is_makers,
    }
    for title, belongs in kinds.items():
        members = [row for row in rows if belongs(row.address)]
        indices = sorted({row.address for row in members})
        numbered = {str(number): f"0x{index:04X}" for number, index in enumerate(indices, 1)}
        yield _section(title, {"SupportedObjects": len(indices), **numbered})
        for index, group in groupby(members, key=lambda row: row.address):
            yield from _object(profile, index, list(group))


def _is_mandatory(index: int) -> bool:
    return index in {row.address for row in _MANDATORY}


def _is_makers(index: int) -> bool:
    return 0x2000 <= index < 0x6000


def _is_optional(index: int) -> bool:
    return not _is_mandatory(index) and not _is_makers(index)


def _object(profile: Profile, index: int, rows: list[Register]) -> Iterator[str]:
    if index not in _COMPOUND:
        yield from (_section(f"{index:04X}", _variable(profile, row)) for row in rows)
        return
    name, kind = _COMPOUND[index]
    highest = max(row.subindex or 0 for row in rows)
    yield _section(
        f"{index:04X}", {"ParameterName": name, "ObjectType": f"0x{kind:X}", "SubNumber": highest + 1}
    )
    yield _section(f"{index:04X}sub0", _count(highest))
    for row in rows:
        yield _section(f"{index:04X}sub{row.subindex:X}", _variable(profile, row))


def _count(highest: int) -> Keys:
    return {
        "ParameterName": "highest_sub_index",
        "ObjectType": f"0x{_VAR:X}",
        "DataType": f"0x{_UNSIGNED[1]:04X}",
        "AccessType": "const",
        "DefaultValue": highest,
        "PDOMapping": 0,
    }


def _variable(profile: Profile, row: Register) -> Keys:
    letters = row in profile.version_rows
    signed = row.coding is Coding.TWOS_COMPLEMENT
    kind = _VISIBLE_STRING if letters else (_SIGNED if signed else _UNSIGNED)[row.size]
    keys: Keys = {
        "ParameterName": row.name,
        "ObjectType": f"0x{_VAR:X}",
        "DataType": f"0x{kind:04X}",
        "AccessType": "const" if letters else _ACCESS[row.access],
    }
    if row.default is not None:
        keys["DefaultValue"] = row.default
    keys |= {"PDOMapping": 0, **({} if letters else _limits(row)), **_factor(profile, row)}
    return {**keys, "Description": _meaning(row)}


def _limits(row: Register) -> Keys:
    """In decimal, for hexadecimal is read as two's complement by some and not by others; none where all goes."""
    if row.coding is Coding.UNSIGNED and (row.low, row.high) == (0, (1 << 8 * row.size) - 1):
        return {}
    return {"LowLimit": row.low, "HighLimit": row.high}


def _factor(profile: Profile, row: Register) -> Keys:
    """Degrees for people: the scale of a row in radians is no short number, that in degrees is."""
    if row.unit == "rad":
        return {"Factor": 1 / profile.counts_per_degree, "Unit": "deg"}
    return {"Factor": row.scale, "Unit": row.unit} if row.unit else {}


def _meaning(row: Register) -> str:
    return " | ".join(
        filter(
            None,
            (
                _named(row.choices.items()),
                _named((f"bit {bit}", name) for bit, name in row.bits.items()),
                row.source,
            ),
        )
    )


def _named(pairs: Iterable[tuple[object, str]]) -> str:
    return ", ".join(f"{value}: {name}" for value, name in pairs)
