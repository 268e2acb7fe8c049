"""Models, options, and the bus that `simulate` makes of them."""

from __future__ import annotations

import random
from math import radians

import pytest

from motorbus.core.family import Simulator
from motorbus.core.register import Storage
from motorbus.errors import RequestError
from motorbus.families.feetech.models import MODELS as NUMBERS
from motorbus.families.feetech.models import choose
from motorbus.families.feetech.simulator import MODELS, simulate
from motorbus.families.feetech.simulator.models import model, models
from tests.simulators.feetech.host import MODELS as OF_MAPS
from tests.simulators.feetech.host import READ, WRITE, Host, packet

# -- models ----------------------------------------------------------------------------------------


def test_every_known_model_can_be_simulated() -> None:
    assert set(MODELS) == {known.name.lower() for known in NUMBERS.values()}
    assert model("") is model("STS3215") is MODELS["sts3215"]
    with pytest.raises(RequestError) as caught:
        model("sts9999")
    assert "sts3215" in caught.value.expected
    # 60° in 0.133 s; 55 rpm are 330°/s
    assert model("sts3250").drive.top_speed == pytest.approx(4096 / 6 / 0.133)
    assert model("scs15").drive.top_speed * model("scs15").angle == pytest.approx(radians(330))
    assert (model("sts3032").drive, model("sm85blhv").voltage) == (model("sts3215").drive, 24.0)


@pytest.mark.parametrize("name", MODELS)
def test_model_is_identified_and_ships_with_possible_values(name: str) -> None:
    servo = simulate((1,), name).servos[0]
    major, minor, end, *number = servo.memory.read(0, 5)
    found = choose((major, minor), (number[0], number[1]), end)
    assert found.model is not None
    assert (found.model.name.lower(), found.table) == (name, servo.model.table.name)
    stored = [row for row in servo.model.table.values() if row.storage is Storage.EEPROM]
    assert [row.name for row in stored if not row.low <= servo.memory[row.name] <= row.high] == []
    unknown = {row.name for row in stored if row.default is None} - set(servo.model.shipped)
    assert unknown <= {"firmware_major", "firmware_minor", "model_major", "model_minor"}
    known = {row.name: row.default for row in stored if row.default is not None}
    assert {key for key, raw in servo.model.shipped.items() if known.get(key, raw) != raw} == set()
    assert (servo.error, servo.mode is None) == (0, False)


def test_firmware_is_reported_and_selects_one_of_several_maps() -> None:
    host = Host(firmware="20.1")
    assert host.say(packet(1, READ, 0, 5))[0].startswith("FF FF 01 07 00 14 01 00 09 03")
    assert host.servo.model.table.name == "sts"
    assert [model("sm100-360m", text).table.name for text in ("", "1.10", "2.45")] == ["smcl", "smcl", "smbl"]
    for text in ("3", "3.x", "256.1", "-1.2", "3.1.2"):
        with pytest.raises(RequestError, match="firmware"):
            model("sts3215", text)


def test_one_model_for_all_or_one_for_each_id() -> None:
    assert [one.name for one in models("", "", 2)] == ["sts3215", "sts3215"]
    mixed = models("sts3215+scs0009,hls3925", "3.9+0.10+3.45", 3)
    assert [(one.table.name, one.firmware) for one in mixed] == [
        ("sts", (3, 9)),
        ("scs", (0, 10)),
        ("hls", (3, 45)),
    ]
    for names, firmwares in (("sts3215+scs0009", ""), ("", "3.9+3.10")):
        with pytest.raises(RequestError) as caught:
            models(names, firmwares, 3)
        assert "one for each id" in caught.value.expected


# -- options ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("position", "left"),
        ("no_such", "1"),
        ("id_ack", "both"),
        ("store_time", "-1"),
        ("factory_restore", "maybe"),
        ("servo_baud", "12345"),
        ("servo_baud", "9600"),  # not a rate of STS
        ("duplicate", "3"),
        ("duplicate", "x"),
    ],
)
def test_invalid_option_is_refused_by_name_or_value(name: str, value: str) -> None:
    with pytest.raises(RequestError) as caught:
        simulate((1, 2), **{name: value})
    assert value in str(caught.value) or name in str(caught.value)


def test_simulated_bus() -> None:
    for ids in ((), (254,), (-1,)):
        with pytest.raises(RequestError):
            simulate(ids)
    bus: Simulator = simulate((7, 4, 9), "sts3215+scs0009+hls3925", position="300", duplicate="9")
    found = [node.status()["model"] for node in bus.nodes.values()]
    assert (list(bus.nodes), found) == ([7, 4, 9], ["sts3215", "scs0009", "hls3925"])
    assert [node.status()["raw_position"] for node in bus.nodes.values()] == [300, 300, 300]
    assert [servo.id for servo in simulate((1, 2), duplicate="0x1+2,2").servos] == [1, 2, 1, 2, 2]
    assert (bus.due(), bus.advance(1.0)) == (None, [])


@pytest.mark.parametrize(
    ("names", "options", "rate"),
    [
        ("sm85blhv", {}, 115_200),
        ("sm85blhv+sm80-360m", {}, 115_200),
        ("sm85blhv+sts3215", {}, 1_000_000),
        ("sm85blhv+sts3215", {"servo_baud": "57600"}, 57_600),
    ],
)
def test_all_servos_of_a_bus_have_one_rate(names: str, options: dict[str, object], rate: int) -> None:
    bus = simulate((1, 2), names, **options)
    assert [servo.baud_rate for servo in bus.servos] == [rate, rate]
    for servo in bus.servos:
        servo.power_cycle()
    assert [servo.baud_rate for servo in bus.servos] == [rate, rate]


@pytest.mark.parametrize("seed", range(4))
def test_mixed_bus_survives_whatever_is_written_and_done(seed: int) -> None:
    dice = random.Random(seed)
    host = Host((1, 2, 3, 4, 5, 6), "+".join(OF_MAPS.values()))
    instructions = (WRITE, WRITE, WRITE, READ, 0x04, 0x05, 0x06, 0x08, 0x0A, 0x0B)
    for _ in range(300):
        servo = dice.choice(host.bus.servos)
        id, address = dice.choice((servo.id, servo.id, 254)), dice.randrange(7, 88)
        data = dice.randbytes(dice.choice((1, 2, 4, 7)))
        host.wait(dice.random() / 5).say(packet(id, dice.choice(instructions), address, *data))
        host.say(packet(servo.id, WRITE, 40, dice.choice((0, 1, 1, 2, 128))))
        servo.load_shaft(dice.uniform(-1, 1))
        servo.push_shaft(dice.uniform(-1, 1))
        servo.block_shaft()
        servo.voltage, servo.temperature = dice.uniform(3, 15), dice.uniform(20, 90)
    for servo in host.bus.servos:
        servo.release_shaft()
        servo.voltage, servo.temperature = servo.model.voltage, 30.0
        servo.power_cycle()
    for id in range(1, 7):
        assert len(host.wait(5.0).say(packet(id, READ, 0, 90))) == 1
