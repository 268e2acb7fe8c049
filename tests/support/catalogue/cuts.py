"""The commands that are cut off: all that write an identity, settings that outlast a power cycle, or borrowed memory.

Every family with an EEPROM lock has a guarded write without a row of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf
from typing import Any

from motorbus.core.family import Family
from motorbus.core.register import Storage
from motorbus.families.kst import PowerCycleNeeded
from tests.conformance.cuts import Call, Command
from tests.support.catalogue import stepper
from tests.support.subjects import SUBJECTS, tables_of
from tests.support.world import kept, locks, samples

OLD, NEW, OTHER = 3, 7, 9
SLOW = 500_000


def rows(subject: Family, without: str = "") -> Callable[[Any], object]:
    """The state of a device: its rows that outlast a power cycle, and its lock; not those of KST that are commands."""
    table = tables_of(subject)[0]
    names = {row.name for row in table.values() if row.storage is Storage.EEPROM or row.name == "lock"}
    names -= {"store", "mid_point", without}
    return lambda device: {name: device.memory[name] for name in names}


# -- FEETECH -----------------------------------------------------------------------------------------------------------


def feetech_address(device: Any) -> tuple[int, int]:
    status = device.status()
    return status["id"], status["baud_rate"]


def feetech_contents(device: Any) -> object:
    return device.status(), device.pending, bytes(device.memory.live), bytes(device.memory.stored)


def feetech(kind: str, method: str, *arguments: Any, name: str = "", **fields: Any) -> Command:
    subject = SUBJECTS[f"feetech-{kind}"]
    return Command(
        name=f"feetech-{kind}-{method}{name}",
        subject=subject,
        ids=(OLD, OTHER),
        call=Call(method, arguments, fields.pop("options", {})),
        address=feetech_address,
        contents=feetech_contents,
        **{"state": rows(subject), **fields},
    )


def identity(kind: str, method: str, value: int, *, name: str = "", **fields: Any) -> Command:
    """A change of id or rate."""
    return feetech(kind, method, value, name=name, journalled=True, **fields)


def guarded(kind: str, method: str, *arguments: Any, **fields: Any) -> Command:
    """A change of other settings behind the lock."""
    return feetech(kind, method, *arguments, **{"restart": 2, **fields})


def guarded_writes() -> Iterator[Command]:
    """A write of one row, for each kind of device that has a lock."""
    for key, subject in SUBJECTS.items():
        if not locks(subject):
            continue
        simulator = subject.simulator((OLD, OTHER))
        row = next(row for row in kept(tables_of(subject)[0]) if not row.choices)
        held = simulator.nodes[OLD].memory[row.name]
        raw = next(raw for raw in samples(row) if raw != held)
        address = OLD, subject.link.rate
        yield Command(
            name=f"{key}-write",
            subject=subject,
            ids=(OLD, OTHER),
            call=Call("write", options={row.name: row.to_value(raw)}),
            state=rows(subject),
            address=lambda device, address=address: address,  # type: ignore[misc]
            contents=feetech_contents if subject.name == "feetech" else None,
            restart=2,
            cuts=0 if key == "feetech-sts" else 30,
            pairs=50 if key == "feetech-sts" else 0,
        )


ERASED = {"torn": "erased"}


def change_in_ram(device: Any) -> None:
    """Another program has written this while the lock was closed: the next power cycle loses it."""
    device.memory["max_temperature"] = 60


VOLATILE = {"prepare": change_in_ram, "state": rows(SUBJECTS["feetech-sts"], without="max_temperature")}

FEETECH = [
    identity("sts", "set_id", NEW, quirks=ERASED, pairs=50),
    identity("sts", "set_id", 1, name="-shipped", quirks={"eeprom_commit": "after_ack"}, cuts=10),
    identity("sts", "set_id", NEW, name="-volatile", quirks=ERASED, **VOLATILE, cuts=10),
    identity("scs", "set_id", NEW, quirks={"torn": "new", "id_ack": "new"}, cuts=10),
    # deaf for longer than the clean-up of a command looks for it
    identity("smbl", "set_id", NEW, quirks={"startup_time": 0.3}, guarded=False, cuts=10),
    identity("hls", "set_id", NEW, quirks=ERASED, cuts=25),
    identity("sts", "set_baud", SLOW, quirks=ERASED, pairs=50),
    identity("scs2", "set_baud", SLOW, quirks={"torn": "old", "baud_ack": "new"}, cuts=10),
    identity("smcl", "set_baud", SLOW, quirks={"eeprom_commit": "after_ack"}, cuts=10),
    guarded("sts", "set_mode", "velocity", pairs=50),
    guarded("sts", "set_multi_turn", True, quirks={"torn": "new"}, pairs=50),
    guarded("sts", "calibrate", 1.0, name="-to", pairs=50),
    guarded("sts", "calibrate", name="-middle"),
    guarded("hls", "calibrate"),
]

# -- KST ---------------------------------------------------------------------------------------------------------------


def kst_address(device: Any) -> tuple[int, int]:
    return device.node, device.bit_rate


def kst(profile: str, method: str, *arguments: Any, name: str = "", **fields: Any) -> Command:
    subject = SUBJECTS[f"kst-{profile}"]
    kept_rows = rows(subject)
    return Command(
        name=f"kst-{method}{name}",
        subject=subject,
        call=Call(method, arguments, fields.pop("options", {})),
        state=lambda device: (kst_address(device), device.raw_position, kept_rows(device)),
        address=kst_address,
        contents=lambda device: (
            device.status(),
            device.memory,
            dict(device.values),
            device.stored(inf),
        ),
        guarded=False,
        atomic=True,
        **fields,
    )


def power_cycle_when_asked(device: Any, event: object) -> None:
    if isinstance(event, PowerCycleNeeded):
        device.power_cycle()


def provisioning() -> Iterator[Command]:
    wishes: list[dict[str, int]] = [
        {"new_id": NEW},
        {"new_rate": 250_000},
        {"new_id": NEW, "new_rate": 1_000_000},
    ]
    for wish in wishes:
        for flash in ("old", "new"):
            yield kst(
                "kst",
                "provision",
                name="".join(f"-{key}" for key in (*wish, flash)),
                ids=(OLD,) if "new_rate" in wish else (OLD, OTHER),
                options={**wish, "timeout": 5.0},
                quirks={"flash_cut": flash},
                react=power_cycle_when_asked,
                cuts=0 if flash == "old" else 8,
                pairs=50 if flash == "old" else 0,
            )


KST = [
    *provisioning(),
    kst(
        "kst-ext",
        "write",
        options={"negative_limit": -0.5, "positive_limit": 0.5},
        name="-limits",
        ids=(OLD, OTHER),
        pairs=50,
    ),
    kst("kst-ext", "set_reversed", True, ids=(OLD, OTHER), pairs=50),
]

COMMANDS = [*FEETECH, *guarded_writes(), *KST, *stepper.COMMANDS]


NOT_COMPLETED = {
    "stepper": "called again it finds its values in the edited copy, and does not save them",
}
NO_EFFECT = "after a loss of supply before the save it returns the old position without an error"
TORN = "a phase register that was half written is taken as it is: no journal has the old value"


def known_faults() -> Iterator[tuple[Command, str]]:
    """Commands that end in a wrong state after a cut, and why."""
    for command in COMMANDS:
        if command.restart == 1:
            yield replace(command, restart=0), NOT_COMPLETED[command.subject.name]
        if command.call.method == "set_multi_turn":
            yield replace(command, quirks=ERASED), TORN
    yield kst("kst-ext", "set_mid_point", ids=(OLD, OTHER), prepare=turned), NO_EFFECT


def turned(device: Any) -> None:
    """The shaft stands elsewhere than at 0."""
    device.raw_position = 100
