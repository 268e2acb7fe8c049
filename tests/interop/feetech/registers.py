"""rustypot's controllers: for each register of its tables, every call that it has generated for it.

What is written goes through its own units, and what the servo then holds is compared with what our table says of the
same address. Where its table and ours differ, `differences` says so by itself, so a register can neither be forgotten
nor explained away.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from motorbus.core import register as core_register
from motorbus.core.register import Storage
from motorbus.families.feetech.table import CONTROL, TABLES
from tests.interop.feetech.steps import Call, Held, Raised, Step, Through
from tests.interop.feetech.twin import Kind

FILE: Final = Path(__file__).with_name("rustypot_registers.csv")
NODES: Final = [1, 2]


class Register(NamedTuple):
    """A register as rustypot's definition has it. `typed`: it has a second set of calls, with `raw` in their names."""

    controller: str
    name: str
    address: int
    size: int
    writable: bool
    encoding: str
    sign_bit: int | None
    typed: bool

    @property
    def unit(self) -> Unit:
        """What its calls without `raw` speak; the others have numbers with the low byte first, whatever the servo."""
        return UNITS.get((self.controller, self.name), PLAIN)

    @property
    def plain(self) -> Unit:
        """What its `raw` calls speak."""
        return SIGNED if self.unit.signed else PLAIN

    @property
    def order(self) -> str:
        """The byte order of the calls without `raw`."""
        return self.unit.order


class Unit(NamedTuple):
    """How a number of a controller comes from the raw value of so many bytes in this order.

    `nudge` is a quarter of a step, to be added to what is written: it cuts what lies between two. `signed` says that
    what has `raw` in its name is two's complement; `words` say it to a reader, with the name of a note.
    """

    number: Callable[[int], Any]
    order: str = "little"
    nudge: float = 0.0
    signed: bool = False
    words: str = ""

    def bytes(self, raw: int, size: int) -> list[int]:
        """A raw value as it goes out, two's complement when negative."""
        data = (raw & (1 << 8 * size) - 1).to_bytes(size, "little")
        return list(data if self.order == "little" else data[::-1])

    def told(self, data: list[int]) -> Any:
        """What it makes of these bytes."""
        whole = bytes(data if self.order == "little" else data[::-1])
        return self.number(int.from_bytes(whole, "little", signed=self.signed))

    def meant(self, raw: int) -> Any:
        """A number that it turns into this raw value."""
        return self.number(raw) + math.copysign(self.nudge, raw) if self.nudge else self.number(raw)


def _angle(raw: int) -> float:
    return math.tau * raw / 4096 - math.pi


def _velocity(raw: int) -> float:
    return math.tau * (raw if raw < 0x8000 else 0x8000 - raw) / 4095


def _offset(raw: int) -> float:
    return math.pi * (raw & 0x7FF) / 2047 * (-1 if raw & 0x800 else 1)


def _angle_300(raw: int) -> float:
    return math.radians(300) * ((raw & 0x3FF) - 511) / 1024


def _angle_270(raw: int) -> float:
    return math.radians(270) * ((raw & 0x3FF) - 511) / 1024


def _velocity_300(raw: int) -> float:
    return math.radians(300) * (raw & 0x3FF) / 1024 * (-1 if raw > 0x8000 else 1)


def _load(raw: int) -> int:
    return -(raw & 0x3FF) if raw > 0x400 else raw & 0x3FF


def _percent(raw: int) -> float:
    return raw * 0.1


def _scs_angle(number: Callable[[int], float], arc: float) -> Unit:
    return Unit(number, "big", 0.25 * math.radians(arc) / 1024, signed=True, words="rad zero-is-middle")


PLAIN: Final = Unit(int)
SIGNED: Final = Unit(int, signed=True)
_SWITCH: Final = Unit(bool, words="true or false")
_BIG: Final = Unit(int, "big", words="a number")
_LIMITS: Final = [f"{end}_{what}_limit" for end in ("min", "max") for what in ("angle", "position")]
_ANGLES: Final = ("goal_position", "present_position", "virtual_position", *_LIMITS)
_VELOCITIES: Final = ("goal_speed", "goal_velocity", "present_speed", "present_velocity")
_OF_STS: Final = {
    **dict.fromkeys(
        _ANGLES, Unit(_angle, nudge=0.25 * math.tau / 4096, signed=True, words="rad zero-is-middle")
    ),
    **dict.fromkeys(_VELOCITIES, Unit(_velocity, nudge=0.25 * math.tau / 4095, words="rad/s turn-of-4095")),
    **dict.fromkeys(
        ("offset", "homing_offset"), Unit(_offset, nudge=0.25 * math.pi / 2047, words="rad turn-of-4095")
    ),
    **dict.fromkeys(("torque_enable", "lock", "moving"), _SWITCH),
}
_OF_SCS: Final = {
    **dict.fromkeys(("goal_time", "minimum_startup_force"), _BIG),
    **dict.fromkeys(("lock", "moving"), _SWITCH),
    "present_load": Unit(_load, "big", words="a number"),
    "max_torque_limit": Unit(_percent, "big", words="% whole-percent"),
}
_OF_SCS0009: Final = {
    **_OF_SCS,
    **dict.fromkeys(_ANGLES, _scs_angle(_angle_300, 300)),
    **dict.fromkeys(
        _VELOCITIES, Unit(_velocity_300, "big", 0.25 * math.radians(300) / 1024, words="rad/s ten-bits")
    ),
}
_OF_SCS0043: Final = {
    **_OF_SCS,
    **dict.fromkeys(_ANGLES, _scs_angle(_angle_270, 270)),
    **dict.fromkeys(_VELOCITIES, _BIG),
    "torque_enable": _SWITCH,
}
UNITS: Final[dict[tuple[str, str], Unit]] = {
    (controller, name): unit
    for controller, units in (("Sts3215", _OF_STS), ("Scs0009", _OF_SCS0009), ("Scs0043", _OF_SCS0043))
    for name, unit in units.items()
}

OURS: Final[dict[str, str]] = {
    "firmware_major_version": "firmware_major",
    "firmware_minor_version": "firmware_minor",
    "baudrate": "baud_rate",
    "return_delay_time": "return_delay",
    "response_status_level": "status_return_level",
    "min_angle_limit": "min_position_limit",
    "max_angle_limit": "max_position_limit",
    "max_temperature_limit": "max_temperature",
    "max_voltage_limit": "max_voltage",
    "min_voltage_limit": "min_voltage",
    "max_torque_limit": "max_torque",
    "unloading_condition": "unload_mask",
    "led_alarm_condition": "led_mask",
    "p_coefficient": "position_p",
    "d_coefficient": "position_d",
    "i_coefficient": "position_i",
    "minimum_startup_force": "min_start_force",
    "cw_dead_zone": "dead_band_cw",
    "ccw_dead_zone": "dead_band_ccw",
    "hysteresis_loop": "hysteresis",
    "offset": "homing_offset",
    "mode": "operating_mode",
    "protection_time": "overload_time",
    "speed_closed_loop_p_coefficient": "velocity_p",
    "over_current_protection_time": "overcurrent_time",
    "velocity_closed_loop_i_coefficient": "velocity_i",
    "goal_speed": "goal_velocity",
    "present_speed": "present_velocity",
    "sync_write_flag": "reg_write_pending",
    "status": "hardware_error",
    "virtual_position": "goal_position_echo",
    "moving_velocity_threshold": "moving_threshold",
    "velocity_unit_factor": "velocity_unit",
    "maximum_velocity_limit": "max_velocity_limit",
    "minimum_velocity_limit": "min_velocity_limit",
    "maximum_acceleration": "max_acceleration",
    "pwm_maximum_step": "pwm_max_step",
}
"""Its names -> ours, where they differ."""
MODEL: Final = ("model", "model_number")
IDENTITY: Final = ("id", "baudrate", "baud_rate", "response_status_level")
"""Registers whose change is felt at once: `controllers` writes them, each in its own way."""
UNANSWERED: Final = "id"
"""Where SYNC READ is not known, the register whose call shows it; the others would time out in the same way, and are
answered by the servos that know it."""
_SAMPLES: Final = {
    "max_voltage_limit": 100,
    "min_voltage_limit": 30,
    "max_temperature_limit": 60,
    "phase": 13,
    "mode": 1,
    "operating_mode": 1,
    "lock": 0,
    "torque_enable": 1,
}


def registers(controller: str) -> list[Register]:
    """Every register of this controller ("Sts3215", "Scs0009", "Scs0043"), as `rustypot_registers.csv` has it."""
    with FILE.open(encoding="utf-8", newline="") as file:
        return [_register(row) for row in csv.DictReader(file) if row["controller"] == controller]


def _register(row: dict[str, str]) -> Register:
    sign = int(row["sign_bit"]) if row["sign_bit"] else None
    writable = row["access"] == "ReadWrite"
    numbers = int(row["address"]), int(row["bytes"])
    return Register(
        row["controller"], row["register"], *numbers, writable, row["encoding"], sign, bool(row["typed"])
    )


def calls(register: Register) -> list[str]:
    """Every call that is generated for it."""
    kinds = ["read", "sync_read", *(("write", "sync_write") if register.writable else ())]
    raws = ("", "raw_") if register.typed else ("",)
    return [f"{kind}_{raw}{register.name}" for kind in kinds for raw in raws]


def ours(register: Register) -> str:
    """What it is called in our tables, where they have it."""
    return OURS.get(register.name, register.name)


def row_at(register: Register, kind: Kind) -> core_register.Register | None:
    """The row of our table that covers its address, whatever its name."""
    rows = TABLES[kind.map].values()
    return next((row for row in rows if row.address <= register.address < row.address + row.size), None)


def differences(register: Register, kind: Kind) -> list[str]:
    """In what its definition and our table differ about this register: names of notes."""
    row = row_at(register, kind)
    if row is None:
        return ["no-register"]
    if register.name in MODEL:
        return [] if kind.order == "little" else ["raw-order"]
    wanted = ours(register)
    if row.name != wanted:
        return ["other-address" if wanted in TABLES[kind.map] else "other-register"]
    found = ["other-order"] if register.size == 2 and register.order != kind.order else []
    found += ["raw-order"] if register.typed and register.size == 2 and register.order == "big" else []
    found += ["width-24"] if register.size != row.size else []
    found += ["factory-register"] if register.writable and row.storage is Storage.FACTORY else []
    return found + _signs(register, row)


def _signs(register: Register, row: core_register.Register) -> list[str]:
    if row.sign_bit is None or row.low >= 0 or register.sign_bit == row.sign_bit:
        return []
    return [{"unsigned": "unsigned", "twos_complement": "twos-complement"}.get(register.encoding, "sign-bit")]


def steps(register: Register, kind: Kind) -> Iterator[Step]:
    """Every call of one register on servos of this kind, but for those that change the identity.

    Where SYNC READ is not known, the same silence is not waited for register by register.
    """
    why = " ".join(differences(register, kind))
    samples = [register.unit.bytes(_sample(register), register.size)] if _settable(register, kind) else [None]
    row = row_at(register, kind)
    if (
        samples[0]
        and row
        and row.low < 0
        and row.address == register.address
        and register.order == kind.order
    ):
        samples.append(list(row.encode(-_sample(register))))
    for sample in samples:
        yield _reading(register, kind, sample, why)
    if register.writable and register.name not in IDENTITY:
        yield from _writing(register, kind, why)


def _sample(register: Register) -> int:
    return _SAMPLES.get(register.name, 2 if register.size == 1 else 300)


def _settable(register: Register, kind: Kind) -> bool:
    """Whether each of its bytes can be written by an ordinary write, and nothing else comes of it."""
    return register.name not in IDENTITY and all(_writes(register, kind))


def _writes(register: Register, kind: Kind) -> list[bool]:
    """For each of its bytes whether a write changes it: what our table says, and 85, which lerobot writes too."""
    rows = {
        place: row
        for row in TABLES[kind.map].values()
        for place in range(row.address, row.address + row.size)
    }
    found = [rows.get(register.address + i) for i in range(register.size)]
    return [row is not None and (row.writable or row.name == "max_acceleration") for row in found]


def _reading(register: Register, kind: Kind, sample: list[int] | None, why: str) -> Step:
    found = []
    for name in (name for name in calls(register) if "read_" in name):
        unit = register.plain if f"read_raw_{register.name}" in name else register.unit
        values = [_value(register, node, unit, sample) for node in NODES]
        if not name.startswith("sync_"):
            found.append(Call("controller", name, (1,), values[:1]))
        elif CONTROL[kind.map].sync_read:
            found.append(Call("controller", name, (NODES,), values))
        elif register.name == UNANSWERED:
            found.append(Call("controller", name, (NODES,), Raised("timed out")))
    before = {(node, register.address): sample for node in NODES} if sample else {}
    return Step(tuple(found), before=before, why=why)


def _value(register: Register, node: int, unit: Unit, sample: list[int] | None) -> Any:
    if sample is not None:
        return unit.told(sample)
    return Through(unit.told, Held(node, register.address, register.size, True))


def _writing(register: Register, kind: Kind, why: str) -> Iterator[Step]:
    row = row_at(register, kind)
    negative = register.unit.signed and row is not None and row.low < 0 and register.order == kind.order
    for name in (name for name in calls(register) if "write_" in name):
        unit = register.plain if f"write_raw_{register.name}" in name else register.unit
        for value in (_sample(register), *((-100,) if negative else ())):
            sent, meant = unit.bytes(value, register.size), unit.meant(value)
            nodes = NODES if name.startswith("sync_") else NODES[:1]
            arguments = (NODES, [meant] * len(NODES)) if nodes is NODES else (1, meant)
            after: dict[tuple[int, int], Any] = {}
            for node in nodes:
                after |= _after(register, kind, node, sent)
            more = f"{why} twos-complement".strip() if value < 0 else why
            yield Step((Call("controller", name, arguments),), after=after, why=more)


def _after(register: Register, kind: Kind, node: int, sent: list[int]) -> dict[tuple[int, int], Any]:
    places = enumerate(zip(sent, _writes(register, kind), strict=True))
    return {
        (node, register.address + i): [byte] if changes else Held(node, register.address + i, 1, True)
        for i, (byte, changes) in places
    }
