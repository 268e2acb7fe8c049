"""TABLE: what can be addressed. Here belongs one row for every register, object or parameter, and nothing else.

A row says everything about its object, above all where that is known from (`source`) and what writing it does
(`effect`): the gate, the guarded writes, the documentation and the simulator's memory all follow from it. Where
sources disagree, say so in `note` and decide. A later model is this table plus differences: `TABLE.derive(…)`.
"""

from __future__ import annotations

from functools import partial
from math import tau
from typing import Final

from motorbus.core.register import Access, Coding, Register, RegisterMap, Storage
from motorbus.core.request import Effect

COUNT: Final = tau / 65536
"""One count of the encoder, in rad."""

_SOURCE = "Metronome object list (README.md)"

_row = partial(Register, order="big", source=_SOURCE)
_position = partial(
    _row, size=4, coding=Coding.TWOS_COMPLEMENT, low=-(2**31), high=2**31 - 1, unit="rad", scale=COUNT
)

TABLE: Final = RegisterMap(
    "metronome",
    (
        _row(
            name="model", address=0x10, subindex=0, size=2, high=0xFFFF, default=0x0401,
            access=Access.READ, storage=Storage.FACTORY, choices={0x0401: "metronome"}, protected=True,
        ),
        _row(
            name="firmware", address=0x10, subindex=1, size=2, high=0xFFFF, default=0x0102,
            access=Access.READ, storage=Storage.FACTORY, protected=True, note="major and minor, a byte each",
        ),
        _row(
            name="node_id", address=0x11, subindex=0, size=1, low=1, high=63, default=1,
            access=Access.READ_WRITE, storage=Storage.EEPROM, effect=Effect.IDENTITY, protected=True,
            note="takes effect at the next power-up",
        ),
        _position(
            name="min_position", address=0x12, subindex=0, default=-65536,
            access=Access.READ_WRITE, storage=Storage.EEPROM, effect=Effect.PERSISTENT,
        ),
        _position(
            name="max_position", address=0x12, subindex=1, default=65536,
            access=Access.READ_WRITE, storage=Storage.EEPROM, effect=Effect.PERSISTENT,
        ),
        _row(
            name="report_interval", address=0x13, subindex=0, size=2, high=10_000, default=0, unit="s",
            scale=0.001, access=Access.READ_WRITE, storage=Storage.RAM,
            note="between reports while it moves; 0: it reports its arrival only",
        ),
        _row(
            name="move_velocity", address=0x13, subindex=1, size=2, low=1, high=20_000, default=6_000,
            unit="rad/s", scale=0.001, access=Access.READ_WRITE, storage=Storage.RAM,
        ),
        _row(
            name="torque_enable", address=0x20, subindex=0, size=1, high=1, default=0,
            access=Access.READ_WRITE, storage=Storage.RAM, effect=Effect.TORQUE, choices={0: "off", 1: "on"},
        ),
        _position(
            name="goal_position", address=0x20, subindex=1, default=0,
            access=Access.READ_WRITE, storage=Storage.RAM, effect=Effect.MOTION,
        ),
        _position(name="present_position", address=0x30, subindex=0, access=Access.READ, storage=Storage.RAM),
        _row(
            name="moving", address=0x30, subindex=1, size=1, high=1, access=Access.READ, storage=Storage.RAM,
            bits={0: "moving"},
        ),
        _row(
            name="present_temperature", address=0x30, subindex=2, size=1, coding=Coding.TWOS_COMPLEMENT,
            low=-128, high=127, unit="°C", access=Access.READ, storage=Storage.RAM,
        ),
        _row(
            name="lock", address=0x40, subindex=0, size=1, high=1, default=1, protected=True,
            access=Access.READ_WRITE, storage=Storage.RAM, effect=Effect.PERSISTENT,
            choices={0: "open: EEPROM can be written", 1: "closed: it refuses"},
            note="a row named `lock` tells the conformance suite what must always be closed again",
        ),
    ),
    title="Metronome servos, all firmware",
)  # fmt: skip
