"""The registers of the Metronome: one row each, with the source of every fact."""

from __future__ import annotations

from functools import partial
from math import tau
from typing import Any, Final

from motorbus.core.register import Access, Coding, Register, RegisterMap, Storage
from motorbus.core.request import Effect

COUNT: Final = tau / 65536
"""rad per count of the encoder."""

_row = partial(Register, source="README.md of the template")
_read = partial(_row, access=Access.READ, storage=Storage.RAM)
_setting = partial(_row, access=Access.READ_WRITE, storage=Storage.EEPROM)
_command = partial(_row, access=Access.READ_WRITE, storage=Storage.RAM)
_ANGLE: Final[dict[str, Any]] = {
    "size": 4,
    "coding": Coding.TWOS_COMPLEMENT,
    "low": -(2**31),
    "high": 2**31 - 1,
    "unit": "rad",
    "scale": COUNT,
}

TABLE: Final = RegisterMap(
    "metronome",
    (
        _read(name="model", address=0x00, size=2, storage=Storage.FACTORY, high=0xFFFF, default=0x0401),
        _read(name="firmware", address=0x02, size=2, storage=Storage.FACTORY, high=0xFFFF, default=0x0102),
        _setting(name="node_id", address=0x04, size=1, low=1, high=63, effect=Effect.IDENTITY, protected=True),
        _setting(name="min_position", address=0x05, default=-65536, effect=Effect.PERSISTENT, **_ANGLE),
        _setting(name="max_position", address=0x09, default=65536, effect=Effect.PERSISTENT, **_ANGLE),
        _command(
            name="lock", address=0x0D, size=1, high=1, default=1, effect=Effect.PERSISTENT, protected=True,
            choices={0: "open: settings can be written", 1: "closed: they refuse"},
        ),
        _command(name="goal_position", address=0x0E, default=0, effect=Effect.MOTION, **_ANGLE),
        _read(name="present_position", address=0x12, **_ANGLE),
        _read(name="moving", address=0x16, size=1, high=1, bits={0: "moving"}),
        _read(name="temperature", address=0x17, size=1, coding=Coding.TWOS_COMPLEMENT, low=-128, high=127, unit="°C"),
        _command(name="torque_enable", address=0x18, size=1, high=1, default=0, effect=Effect.TORQUE, protected=True),
    ),
)  # fmt: skip
