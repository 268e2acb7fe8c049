"""Which registers may be copied from one servo to another: what a backup writes back, and nothing else.

A template that was written whole to other servos, registers of calibration and of the factory included, ruined eight
of them: 0.0 V, a red light, and no factory restore helped (iotdesignshop/Feetech-tuna#2). So the list says what may be
copied, and is read from the rows; who adds a row that belongs to one servo marks it protected.
"""

from __future__ import annotations

from motorbus.core.register import Register, RegisterMap, Storage
from motorbus.core.request import Effect


def copyable(table: RegisterMap) -> tuple[Register, ...]:
    """The rows of this map that another servo with the same map may be given, in the order of their addresses.

    Settings in EEPROM only. Never what says who it is or how it is found (id, second id, rate, model, firmware), what
    is calibrated at one servo (phase, homing offset), or what is the factory's.
    """
    return tuple(row for row in table.values() if _copied(row))


def _copied(row: Register) -> bool:
    setting = row.storage is Storage.EEPROM and row.readable and row.writable
    return setting and not row.protected and row.effect is not Effect.IDENTITY
