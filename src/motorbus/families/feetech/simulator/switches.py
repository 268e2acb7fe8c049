"""What nobody has settled about a real FEETECH servo, each as a named switch with a default and its source.

A simulator that guesses in silence teaches its users the guess. So where sources conflict or say nothing, the
behaviour is chosen here, by name, and a test of a host can run with every choice. Each switch may also be given
as an option of a bus string: `feetech:sim,ids=1-3,broadcast_ping=in_turn`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from difflib import get_close_matches
from math import isfinite
from typing import Any

from motorbus.core.family import Option
from motorbus.errors import RequestError

_YES = frozenset({"yes", "true", "on", "1"})
_NO = frozenset({"no", "false", "off", "0"})


def _switch(default: object, help: str, *choices: str, source: str) -> Any:
    return field(default=default, metadata={"help": help, "choices": choices, "source": source})


@dataclass(frozen=True, slots=True, kw_only=True)
class Switches:
    """How the simulated servos behave where real ones differ or nobody knows. Times are in seconds."""

    broadcast_ping: str = _switch(
        "collide",
        "several servos answer a broadcast PING at once and garble each other, or one after the other",
        "collide",
        "in_turn",
        source="manual V1.01, 1.1 forbids it with several servos; lerobot and rustypot use it on STS",
    )
    reg_write_again: str = _switch(
        "replace",
        "a second REG WRITE before ACTION replaces the first or is dropped",
        "replace",
        "refuse",
        source="not documented",
    )
    empty_write: str = _switch(
        "ack",
        "a WRITE of an address without a datum is acknowledged or ignored",
        "ack",
        "silent",
        source="manual V1.01, 1.3 table (one parameter) against 1.3.3 (at least two)",
    )
    out_of_range: str = _switch(
        "store",
        "a value outside its register's range is stored or dropped; the write is acknowledged either way",
        "store",
        "drop",
        source="not documented; no error code for it exists",
    )
    beyond_limits: str = _switch(
        "clamp",
        "a goal beyond the position limits goes as far as the limit, or nowhere",
        "clamp",
        "stay",
        source="not documented",
    )
    sync_read_missing: str = _switch(
        "wait",
        "when a listed servo is missing the next ones leave its time free, close up, or stay silent",
        "wait",
        "close_up",
        "silent",
        source="open question: order and timing of SYNC READ replies when one is missing",
    )
    id_ack: str = _switch(
        "new",
        "a WRITE of the id is acknowledged from the new id or from the old one",
        "new",
        "old",
        source="fanhao375/microduck-replica#28 (from the new id)",
    )
    baud_ack: str = _switch(
        "old",
        "a WRITE of the baud rate is acknowledged at the old rate, or at the new one and so not heard",
        "old",
        "new",
        source="not documented",
    )
    factory_restore: bool = _switch(
        True,
        "instruction 0x06 restores the factory values; without it the servo stays silent",
        source="servolab, measured on an STS3215 with firmware 3.10; manual V1.01: certain models only",
    )
    restore_id: str = _switch(
        "keep",
        "a factory restore keeps the id or sets it to 1",
        "keep",
        "default",
        source="servolab, firmware 3.10: kept; feetech-cli documents id 1 at 1 Mbaud",
    )
    restore_time: float = _switch(
        1.0,
        "how long it is deaf after a factory restore",
        source="servolab: about 1 s until it answers again",
    )
    calibrate: str = _switch(
        "accept",
        "instruction 0x0B sets the present position, or is ignored",
        "accept",
        "ignore",
        source="in the dispatcher of STS3215 firmware 3.10 (kuterd/feetech-fw-util); documented for HLS",
    )
    calibration_store: str = _switch(
        "lock",
        "a homing offset found by calibration is stored when the lock is open, or always",
        "lock",
        "always",
        source="not documented; both ways of calibrating write register 31",
    )
    goal_enables_torque: bool = _switch(
        True,
        "writing the goal position switches torque on",
        source="feetech-cli, measured on STS3215: 40 reads 1 after a write of 42",
    )
    goal_at_power_up: str = _switch(
        "zero",
        "after power-up the goal position reads 0, or the present position",
        "zero",
        "present",
        source="not documented; 0 is the cruel one: torque on without a goal makes it jump",
    )
    torque_at_power_up: bool = _switch(
        False,
        "torque is on after power-up",
        source="STS3215 memory table V3.6: off; PickNikRobotics/moveit_pro_example_ws#930: found stiff",
    )
    lock_at_power_up: bool = _switch(
        True,
        "the EEPROM lock is closed after power-up",
        source="memory table V3.6: open; FD 1.9.8.5 and current parts: closed",
    )
    step_from: str = _switch(
        "goal",
        "in step mode a write counts from the last goal while it is on its way, or from where it is",
        "goal",
        "present",
        source="not documented",
    )
    bootloader: str = _switch(
        "silent",
        "instruction 0x08 is not answered, or acknowledged before it goes",
        "silent",
        "ack",
        source="not documented",
    )
    bootloader_time: float = _switch(
        0.8, "how long it is deaf after instruction 0x08", source="kuterd/feetech-fw-util: about 800 ms"
    )
    store_time: float = _switch(
        0.02,
        "how much later a write is acknowledged that goes to the EEPROM",
        source="public recovery tool for STS3215, measured: can exceed 21 ms",
    )
    startup_time: float = _switch(
        0.0, "how long it is deaf after power-up", source="st3215-bus: the first ping may be missed"
    )
    frame_gap: float = _switch(
        0.005,
        "a pause after which half a frame is forgotten; 0: never, and one wrong length byte swallows what follows",
        source="not documented; without one a wrong length byte makes it deaf for up to 258 bytes",
    )
    acceleration_unit: float = _switch(
        100.0,
        "counts/s² for each unit of the acceleration register",
        source="memory table V3.6: 100; servolab, firmware 3.10: 104 to 105",
    )
    full_acceleration: float = _switch(
        25_400.0,
        "counts/s² when the acceleration register is 0, which means maximum",
        source="not documented; what the greatest register value gives",
    )

    @staticmethod
    def from_options(options: Mapping[str, object]) -> Switches:
        """Switches by name, values also as text. Raises RequestError for an unknown name or an impossible value."""
        known = {one.name: one for one in fields(Switches)}
        values: dict[str, Any] = {name: _value(name, known, value) for name, value in options.items()}
        return Switches(**values)


def options() -> tuple[Option, ...]:
    """Every switch as an option that a bus string may carry."""
    return tuple(Option(one.name, type(one.default), one.default, _help(one)) for one in fields(Switches))


def _help(one: Field[Any]) -> str:
    choices = one.metadata["choices"]
    return f"{one.metadata['help']}{' (' + ', '.join(choices) + ')' if choices else ''}"


def _value(name: str, known: Mapping[str, Field[Any]], value: object) -> object:
    if name not in known:
        near = get_close_matches(name, known, n=3)
        raise RequestError(
            f"a simulated FEETECH bus has no option {name!r}",
            expected=f"perhaps {', '.join(near)}" if near else "",
            advice="`motorbus simulate feetech --help` lists them",
        )
    default, choices = known[name].default, known[name].metadata["choices"]
    if isinstance(default, bool):
        return _truth(name, value)
    if isinstance(default, float):
        return _number(name, value)
    if value not in choices:
        raise RequestError(
            f"option {name}: {value!r} is not possible", expected=f"one of {', '.join(choices)}"
        )
    return value


def _truth(name: str, value: object) -> bool:
    word = str(value).lower()
    if word not in _YES | _NO:
        raise RequestError(f"option {name}: {value!r} is neither yes nor no", expected="yes or no")
    return word in _YES


def _number(name: str, value: object) -> float:
    try:
        number = float(str(value))
    except ValueError:
        number = -1.0
    if not (isfinite(number) and number >= 0):
        raise RequestError(f"option {name}: {value!r} is not possible", expected="a number, 0 or more")
    return number
