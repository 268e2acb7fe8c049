"""How one map borrows rows of another: what holds in both stays, what was only known of the first one goes.

A default of an STS3215 is no default of another servo, and a note on what its sources say is no note on another's. So
a borrowed row gets the source of the map that borrows it, loses its default unless that is the same in every servo, and
keeps its note only where the note is about the thing and not about one map's sources. What its sources disagree about
stays behind likewise.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from motorbus.core.register import RegisterMap, changed

SAME_EVERYWHERE: Final[Mapping[str, int]] = {
    "byte_order": 0,
    "id": 1,
    "status_return_level": 1,
    "angular_resolution": 1,
    "homing_offset": 0,
    "operating_mode": 0,
    "torque_enable": 0,
    "acceleration": 0,
    "goal_time": 0,
    "goal_velocity": 0,
    "lock": 1,
    "reg_write_pending": 0,
    "hardware_error": 0,
}
"""Defaults that FD 1.9.8.5 has in every map that has the row, and that no other source contradicts.

Two are not FD's: servos ship with the id 1, where FD has 0; and FD has no row for the byte order.
"""
_TRUE_OF_THE_THING: Final = frozenset(
    (
        *(
            "id",
            "status_return_level",
            "max_torque",
            "phase",
            "unload_mask",
            "position_d",
            "protective_torque",
            "overload_torque",
        ),
        *("present_load", "reg_write_pending", "moving"),
    )
)
_IN_DOUBT_EVERYWHERE: Final = frozenset(("id", "protective_torque", "overload_torque"))
"""Rows whose sources disagree in the same way in every map that has them."""


def borrowed(
    table: RegisterMap, *, source: str, defaults: Mapping[str, int] | None = None, **differences: object
) -> RegisterMap:
    """This table as another map has it that `source` describes: a table to derive that map from.

    `defaults` are raw values by name that the other map is known to ship with; `differences` are fields that all of its
    rows have, as order="big".
    """
    shipped = {**SAME_EVERYWHERE, **(defaults or {})}
    return table.derive(
        table.name,
        *(
            changed(
                row,
                **{
                    "source": source,
                    "default": shipped.get(row.name),
                    "note": row.note if row.name in _TRUE_OF_THE_THING else "",
                    "conflict": row.conflict if row.name in _IN_DOUBT_EVERYWHERE else "",
                    **differences,
                },
            )
            for row in table.values()
        ),
    )
