"""Every row of every map there and back, through the driver and in raw packets, up to both ends of its range.

The raw packets are made by hand, so the simulator is judged here by bytes that the driver did not make; what the two
make of each other by name is in tests/conformance, for every map, and only what is left out there is added here: rows
whose writing moves something, and rows that only a verb of their own may write.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from motorbus.core.register import Coding, Register, Storage
from motorbus.core.request import Effect
from motorbus.core.steps import SetBitrate
from motorbus.errors import LimitExceeded, RequestError
from motorbus.families.feetech.simulator import simulate
from motorbus.families.feetech.table import BAUD_CODES, BAUD_CODES_OF, CONTROL, TABLES
from motorbus.families.feetech.table import MODELS as NUMBERS
from tests.families.feetech.maps import MODELS
from tests.families.feetech.quirk_bus import Bench, bench
from tests.simulators.feetech.host import (
    ACTION,
    ALL,
    READ,
    REG_WRITE,
    SYNC_WRITE,
    WRITE,
    Host,
    packet,
)
from tests.support.world import samples

ID = 1
POWERLESS = "goal_torque", 0
"""What no servo is told in position mode: this row bounds its current there."""


SIGNED = [
    pytest.param(name, row, id=f"{name}-{row.name}")
    for name, table in TABLES.items()
    for row in table.values()
    if row.coding is Coding.SIGN_MAGNITUDE
]


def rows_in_eeprom(name: str) -> list[Register]:
    """Those of this map that keep what is written to them."""
    return [row for row in TABLES[name].values() if row.writable and row.storage is Storage.EEPROM]


class Raw:
    """One simulated servo of a map, spoken to in packets made by hand."""

    def __init__(self, name: str) -> None:
        self.host = Host((ID,))
        self.host.bus = simulate((ID,), MODELS[name])
        self.servo = self.host.bus.servos[0]
        self.lock = TABLES[name]["lock"].address

    def write(self, address: int, data: bytes, way: str = "write") -> None:
        """Write in one of three ways, and give time for what it may have to store."""
        id = self.servo.id
        requests = {
            "write": [packet(id, WRITE, address, *data)],
            "reg_write": [packet(id, REG_WRITE, address, *data), packet(id, ACTION)],
            "sync_write": [packet(ALL, SYNC_WRITE, address, len(data), id, *data)],
        }
        for request in requests[way]:
            self.host.say(request)
        self.host.wait(1.0)

    def read(self, row: Register) -> bytes:
        """The bytes of a READ of just this row."""
        (reply,) = self.host.say(packet(self.servo.id, READ, row.address, row.size))
        return bytes.fromhex(reply)[5:-1]

    def unlock(self) -> None:
        """Open the lock of the EEPROM, which is at another place in each map."""
        self.write(self.lock, b"\0")

    def power_cycle(self) -> None:
        """Its supply goes and comes, and it has started."""
        self.servo.power_cycle()
        self.host.wait(1.0)


def others(raw: Raw, row: Register) -> list[int]:
    """Samples of this row other than what it has, for that proves nothing; nor 128 at the torque switch, an order."""
    held = raw.servo.memory[row.name]
    return [one for one in samples(row) if one != held and (row.name, one) != ("torque_enable", 128)]


def obeyed(row: Register) -> bool:
    """Whether the servo keeps what a host writes here; register 85 is read-only in the map, and lerobot writes it."""
    return row.writable or row.name == "max_acceleration"


def bytes_of(row: Register, raw: int) -> bytes:
    """Made here from the facts of the row, not by it."""
    code = abs(raw) | (1 << row.sign_bit if raw < 0 and row.sign_bit is not None else 0)
    pair = code & 255, code >> 8
    assert code < 1 << 8 * row.size
    if row.size == 1:
        return bytes(pair[:1])
    return bytes(pair if row.order == "little" else pair[::-1])


# --- what a row is ------------------------------------------------------------------------------------------


def test_each_model_has_the_map_it_stands_for() -> None:
    assert set(MODELS) == set(TABLES)
    known = {one.name.lower(): one.maps for one in NUMBERS.values()}
    assert [name for name, model in MODELS.items() if name not in known[model]] == []


@pytest.mark.parametrize("name", TABLES)
def test_every_row_has_one_byte_or_two(name: str) -> None:
    for row in TABLES[name].values():
        assert row.size in (1, 2), row.name
        assert row.order == ("big" if name.startswith("scs") else "little"), row.name


@pytest.mark.parametrize("name", TABLES)
def test_every_value_becomes_its_bytes_and_comes_back(name: str) -> None:
    for row in TABLES[name].values():
        for raw in samples(row):
            assert row.encode(raw) == bytes_of(row, raw), row.name
            assert row.decode(bytes_of(row, raw)) == raw, row.name
            assert row.to_raw(row.to_value(raw)) == raw, row.name


# --- raw packets --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TABLES)
def test_a_locked_write_is_obeyed_and_gone_after_a_power_cycle(name: str) -> None:
    for row in rows_in_eeprom(name):
        for value in others(Raw(name), row):
            raw = Raw(name)
            before = raw.read(row)
            assert raw.servo.memory["lock"] == 1
            raw.write(row.address, bytes_of(row, value))
            assert (raw.servo.memory[row.name], raw.read(row)) == (value, bytes_of(row, value)), row.name
            raw.power_cycle()
            assert raw.read(row) == before, row.name


@pytest.mark.parametrize("name", TABLES)
def test_an_unlocked_write_outlives_a_power_cycle(name: str) -> None:
    for row in rows_in_eeprom(name):
        for value in others(Raw(name), row):
            raw = Raw(name)
            raw.unlock()
            raw.write(row.address, bytes_of(row, value))
            raw.power_cycle()
            assert (raw.servo.memory[row.name], raw.read(row)) == (value, bytes_of(row, value)), row.name


@pytest.mark.parametrize("name", TABLES)
def test_what_can_only_be_read_stays_as_it_is_whoever_writes(name: str) -> None:
    for row in (row for row in TABLES[name].values() if not obeyed(row)):
        raw = Raw(name)
        raw.unlock()
        before = raw.read(row)
        for data in (b"\x55" * row.size, b"\0" * row.size, b"\xff" * row.size):
            (acknowledgement,) = raw.host.write(ID, row.address, *data)
            assert len(bytes.fromhex(acknowledgement)) == 6, "there is no code for a refusal"
            assert raw.read(row) == before, row.name
        raw.power_cycle()
        assert raw.read(row) == before, row.name


@pytest.mark.parametrize("way", ["reg_write", "sync_write"])
@pytest.mark.parametrize("name", TABLES)
def test_every_way_of_writing_obeys_access_and_lock_alike(name: str, way: str) -> None:
    for row in TABLES[name].values():
        for unlocked in (False, True):
            raw = Raw(name)
            if unlocked:
                raw.unlock()
            before = raw.read(row)
            value = others(raw, row)[-1]
            raw.write(row.address, bytes_of(row, value), way)
            assert raw.read(row) == (bytes_of(row, value) if obeyed(row) else before), row.name
            raw.power_cycle()
            if row.storage is not Storage.RAM:
                stays = row.writable and unlocked
                assert raw.read(row) == (bytes_of(row, value) if stays else before), row.name


@pytest.mark.parametrize("name", TABLES)
def test_what_is_not_in_eeprom_is_as_at_the_beginning_after_a_power_cycle(name: str) -> None:
    kept = [row for row in TABLES[name].values() if row.writable and row.storage is Storage.RAM]
    for row in kept:
        raw = Raw(name)
        raw.power_cycle()
        before = raw.read(row)
        value = others(raw, row)[0]
        raw.write(row.address, bytes_of(row, value))
        assert raw.read(row) == bytes_of(row, value), row.name
        raw.power_cycle()
        assert raw.read(row) == before, row.name


# --- the driver, where the conformance suite does not go ----------------------------------------------------


@pytest.fixture(params=TABLES)
def there(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """A bus with one simulated servo of each map."""
    with bench(str(ID), model=MODELS[request.param], servo_baud=1_000_000) as made:
        yield made


def table_of(there: Bench) -> dict[str, Register]:
    return dict(TABLES[there.servo().identify().table])


@pytest.mark.parametrize(("name", "row"), SIGNED)
def test_a_negative_zero_is_zero(name: str, row: Register) -> None:
    """It occurs on the wire; nobody may see a value of it."""
    assert row.sign_bit is not None
    code = 1 << row.sign_bit
    assert row.decode(code.to_bytes(row.size, "little" if row.order == "little" else "big")) == 0
    assert row.encode(0) == bytes(row.size)
    if not row.writable:
        return
    with bench(str(ID), model=MODELS[name], servo_baud=1_000_000) as there:
        servo = there.servo()
        servo.prepare()
        data = code.to_bytes(row.size, "little" if row.order == "little" else "big")
        there.simulation.simulator.receive(packet(ID, WRITE, row.address, *data), there.bus.link.now())
        there.wait(0.5)
        servo = there.servo()
        assert servo.read_raw(row.name) == {row.name: 0}
        assert servo.read(row.name) == {row.name: 0}


RESERVED = ("torque_enable", "lock")
"""Rows of which a plain write takes one value only: off, and closed."""


def by_name(there: Bench) -> list[Register]:
    """Rows that a plain write takes."""
    return [
        row
        for row in table_of(there).values()
        if row.writable and not row.protected and row.name not in RESERVED
    ]


def may_be_refused(servo: Any, row: Register, raw: int) -> bool:
    """A goal beyond the limits of the servo, which the gate keeps back, or one that would leave it without force."""
    if (row.name, raw) == POWERLESS:
        return True
    limits = servo.limits
    return row.name == "goal_position" and not limits[0] <= servo.value(row, raw) <= limits[1]


def test_what_moves_is_written_by_name_up_to_both_ends(there: Bench) -> None:
    moving = [
        row
        for row in by_name(there)
        if row.storage is Storage.RAM and row.effect in (Effect.MOTION, Effect.TORQUE)
    ]
    assert {"goal_position", "goal_velocity"} <= {row.name for row in moving}
    for row in moving:
        for raw in samples(row):
            servo = there.servo()
            servo.prepare()
            before = there.simulated().memory[row.name]
            if may_be_refused(servo, row, raw):
                with pytest.raises(RequestError if (row.name, raw) == POWERLESS else LimitExceeded):
                    servo.write(**{row.name: servo.value(row, raw)})
                assert there.simulated().memory[row.name] == before
                continue
            servo.write(**{row.name: servo.value(row, raw)})
            assert there.simulated().memory[row.name] == raw
            assert servo.read_raw(row.name) == {row.name: raw}


def test_what_moves_and_is_kept_is_written_by_name_and_outlives_a_power_cycle(there: Bench) -> None:
    kept = [
        row
        for row in by_name(there)
        if row.storage is Storage.EEPROM and row.effect in (Effect.MOTION, Effect.TORQUE)
    ]
    for row in kept:
        for raw in samples(row):
            servo = there.servo()
            servo.write(**{row.name: servo.value(row, raw)})
            there.wait(0.5)
            there.simulated().power_cycle()
            there.wait(0.5)
            assert there.simulated().memory[row.name] == raw, row.name
            assert servo.read_raw(row.name) == {row.name: raw}


def test_torque_on_and_an_open_lock_are_refused_by_name_and_the_other_value_is_taken(there: Bench) -> None:
    servo = there.servo()
    servo.prepare()
    for name, refused, taken in (("torque_enable", 1, 0), ("lock", 0, 1)):
        with there.traffic() as sent, pytest.raises(RequestError, match="nothing was sent"):
            servo.write(**{name: refused})
        assert sent == []
        servo.write(**{name: taken})
        assert servo.read(name) == {name: taken}


def test_d8_what_is_read_only_or_protected_is_refused_and_nothing_is_sent(there: Bench) -> None:
    servo = there.servo()
    servo.prepare()
    refused = [row for row in table_of(there).values() if row.protected or not row.writable]
    assert {"id", "baud_rate", "phase", "present_position"} <= {row.name for row in refused}
    for row in refused:
        for raw in (row.low, row.high):
            with there.traffic() as sent, pytest.raises(RequestError, match="nothing was sent"):
                servo.write(**{row.name: row.to_value(raw)})
            assert sent == []


# --- rows that only a verb of their own writes --------------------------------------------------------------

OWNED = ("id", "second_id", "baud_rate", "homing_offset", "torque_enable", "lock")
"""Rows of which only a verb of their own writes every value, or some."""
NEVER = ("phase",)
"""Rows that nothing writes as a whole: the phase belongs to one servo."""


def test_every_row_that_can_be_written_is_written_by_name_or_by_its_verb_or_never(there: Bench) -> None:
    known = {row.name for row in by_name(there)} | {*OWNED, *NEVER}
    assert {row.name for row in table_of(there).values() if row.writable} <= known


def assert_kept(there: Bench, id: int, row: Register, raw: int) -> None:
    """It is there, it is locked in, and it outlives a power cycle."""
    simulated = there.simulated(id)
    assert (simulated.memory[row.name], simulated.memory["lock"]) == (raw, 1)
    simulated.power_cycle()
    there.wait(0.5)
    assert there.simulated(id).memory[row.name] == raw
    assert there.servo(id).read_raw(row.name) == {row.name: raw}


def test_an_id_is_written_by_set_id(there: Bench) -> None:
    row, now = table_of(there)["id"], ID
    for new in (0, 1, 100, 252, 253):
        if new == now:
            continue
        assert there.servo(now).set_id(new, among=(now, new)).node == new
        assert_kept(there, new, row, new)
        now = new


def test_a_rate_is_written_by_set_baud(there: Bench) -> None:
    row = table_of(there)["baud_rate"]
    for code in BAUD_CODES_OF[there.servo().identify().table]:
        found = there.servo().set_baud(BAUD_CODES[code], among=(ID,))
        assert (found.node, found.rate) == (ID, BAUD_CODES[code])
        there.bus.run(SetBitrate(BAUD_CODES[code]))
        assert_kept(there, ID, row, code)


@pytest.mark.parametrize("name", [name for name, table in TABLES.items() if "homing_offset" in table])
def test_a_homing_offset_is_written_by_calibrate(name: str) -> None:
    row, turn = TABLES[name]["homing_offset"], CONTROL[name].turn
    for offset in samples(row):
        with bench(str(ID), model=MODELS[name], servo_baud=1_000_000) as there:
            there.simulated().raw_position = (turn // 2 + offset) % turn
            found = there.servo().calibrate().raw_new_offset
            assert (found - offset) % turn == 0
            assert_kept(there, ID, row, found)
            assert there.simulated().raw_position == turn // 2


@pytest.mark.parametrize("name", [name for name, table in TABLES.items() if "homing_offset" not in table])
def test_where_there_is_no_homing_offset_calibrate_says_so(name: str) -> None:
    with (
        bench(str(ID), model=MODELS[name]) as there,
        pytest.raises(RequestError, match="has no homing offset"),
    ):
        there.servo().calibrate()


def test_torque_is_switched_by_its_verbs(there: Bench) -> None:
    servo, simulated = there.servo(), there.simulated()
    servo.enable_torque()
    assert (simulated.memory["torque_enable"], servo.read("torque_enable")) == (1, {"torque_enable": 1})
    servo.disable_torque()
    assert (simulated.memory["torque_enable"], servo.read("torque_enable")) == (0, {"torque_enable": 0})
