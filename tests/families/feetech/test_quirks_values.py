"""Quirks of what registers say: signs, units, alarms, firmware, and what must never be copied.

Each test is named after its number in docs/reference/feetech-quirks.md, and says what real servos were seen to do and
who saw it.
"""

from __future__ import annotations

import pytest

from motorbus.cli.scan import mixed_firmware
from motorbus.errors import DeviceError, RequestError
from motorbus.families.feetech import FAMILY
from motorbus.families.feetech.driver.copying import copyable
from motorbus.families.feetech.simulator.feedback import read
from motorbus.families.feetech.table import TABLES
from tests.families.feetech.quirk_bus import bench, instruction
from tests.simulators.feetech.host import packet

COUNT = 2 * 3.141592653589793 / 4096
WRITE = 3
FULL_TURNS = 1 << 4
NEVER_COPIED = {*range(7), 18, 80, 81, 82, 83, 84, 85, 86}
"""Registers that no template may hold, in every map that has them; the homing offset is at another place in each."""


def test_quirk_08_a_position_below_zero_is_negative() -> None:
    """With its sign bit ignored a position below zero reads as 327xx.

    huggingface/lerobot#2223; strands-labs/robots#3387; STS_servos#2.
    """
    with bench() as there:
        simulated, servo = there.simulated(), there.servo()
        simulated.memory["phase"] = simulated.memory["phase"] | FULL_TURNS
        simulated.raw_position = -100
        code = read(simulated, 56, 2, there.bus.link.now())
        assert code == bytes((100, 0x80))  # 32868 without the sign
        assert servo.position() == pytest.approx(-100 * COUNT)
        assert servo.read_raw("present_position") == {"present_position": -100}
        assert servo.telemetry().position == pytest.approx(-100 * COUNT)


def test_quirk_09_the_sign_of_the_load_is_bit_10() -> None:
    """The load has its sign at bit 10, where other registers have bit 15: huggingface/lerobot#1014."""
    with bench() as there:
        simulated, servo = there.simulated(), there.servo()
        servo.enable_torque()
        loads = []
        for simulated.torque in (0.3, -0.3):
            load = servo.telemetry().load
            code = int.from_bytes(read(simulated, 60, 2, there.bus.link.now()), "little")
            assert code == round(abs(load) * 1000) | (1 << 10 if load < 0 else 0)
            loads.append(load)
    assert loads[0] == -loads[1] != 0
    for table in TABLES.values():
        assert table["present_load"].sign_bit == 10


def test_quirk_12_servos_of_one_bus_may_have_several_firmware_versions() -> None:
    """Servos of one robot with firmware 3.9 and 3.10 were refused, or misbehaved, as a set.

    huggingface/lerobot#1010, #532, #1793.
    """
    with bench("1-2", firmware="3.9+3.10") as there:
        found = there.bus.run(FAMILY.open().scan((1, 2)))
        assert [one.identity.firmware for one in found if one.identity] == ["3.9", "3.10"]
        for id in (1, 2):
            servo = there.servo(id)
            servo.move(1.0)
            assert servo.position() == pytest.approx(1.0, abs=0.05)
        (note,) = mixed_firmware(found, FAMILY)  # which `motorbus scan` prints
        assert "3.9 (#1), 3.10 (#2)" in note


def test_quirk_13_a_wrong_supply_is_an_alarm_with_its_figures_and_no_fault_of_the_line() -> None:
    """A 7.4 V servo on 12 V raises the voltage alarm in every packet, which looks like trouble on the line.

    huggingface/lerobot#1010; SO-ARM100#174; lelamp_runtime#1.
    """
    with bench() as there:
        there.simulated().voltage = 12.1
        servo = there.servo()
        state = servo.telemetry()
        assert state.alarm == servo.alarm == ("voltage",)
        assert state.voltage == pytest.approx(12.1)
        assert servo.read("max_voltage", "min_voltage") == pytest.approx(
            {"max_voltage": 8.0, "min_voltage": 4.0}
        )
        assert there.bus.statistics.of(1).errors == {}
        (told,) = servo.alarms()
        assert "supply 12.1 V above limit 8.0 V" in told
        servo.write(acceleration=1.0)  # an alarm is no refusal
        assert there.simulated().memory["acceleration"] > 0


@pytest.mark.parametrize("name", TABLES)
def test_quirk_15_what_belongs_to_one_servo_alone_is_never_written_by_name(name: str) -> None:
    """A template written to all registers bricked eight servos: 0.0 V, red LED, and a factory reset did not help.

    Feetech-tuna#2. Never copied: 0 to 6, the phase, the homing offset, and the maker's own registers.
    """
    table = TABLES[name]
    own = {row.name for row in table.values() if row.address in NEVER_COPIED}
    own |= {"homing_offset"} & set(table)
    assert {"id", "baud_rate", "phase", "model_major"} <= own
    assert {row for row in own if not table[row].protected} == set()
    assert own & {row.name for row in copyable(table)} == set()
    assert {"max_torque", "led_mask"} <= {row.name for row in copyable(table)}


def test_quirk_15_a_whole_template_is_refused_before_the_first_byte() -> None:
    """The same from outside: one such register among good ones, and nothing is sent at all."""
    with bench() as there:
        servo = there.servo()
        template = {
            name: value
            for name, value in servo.read().items()
            if TABLES["sts"][name].writable and name != "lock"
        }
        assert {"phase", "homing_offset", "id"} <= set(template)
        with there.traffic() as sent, pytest.raises(RequestError, match="nothing was sent"):
            servo.write(**template)
        assert sent == []


def test_quirk_15_a_servo_that_such_a_template_has_ruined_is_recognised() -> None:
    """The same afterwards: 0.0 V and a voltage alarm, for good. That the phase register is the cause is a guess."""
    with bench(wrong_bridge="blind") as there:
        servo, simulated = there.servo(), there.simulated()
        servo.prepare()
        now, phase = there.bus.link.now(), simulated.memory["phase"]
        there.simulation.simulator.receive(packet(1, 3, 55, 0), now)
        there.simulation.simulator.receive(packet(1, 3, 18, phase ^ 1 << 5), now)  # not by motorbus
        there.wait(0.5)
        simulated.power_cycle()
        (told,) = servo.alarms()
        assert "0.0 V" in told
        assert "phase register" in told


def test_quirk_20_the_load_is_the_duty_and_not_the_torque() -> None:
    """The load is the duty of the power stage: a servo that touches nothing shows a great one when it runs fast.

    STS_servos#5.
    """
    with bench() as there:
        servo = there.servo()
        simulated = there.simulated()
        servo.move(0.0, wait=False)
        there.wait(0.3)
        running = servo.telemetry()
        assert simulated.torque == 0.0
        assert abs(running.load) > 0.5
        assert running.current < 1.0  # the current tells them apart
    row = TABLES["sts"]["present_load"]
    assert (row.unit, "duty" in row.note) == ("fraction", True)


def test_quirk_24_what_is_no_servo_is_read_and_never_written() -> None:
    """Boards that are no servos share the bus; a servo map makes nonsense of them, and a write does damage.

    feetech-cli, devices.py; servolab, XIAO IMU.
    """
    with bench() as there:
        there.simulated().memory["firmware_major"] = 20  # which FD knows as another kind of device
        servo = there.servo()
        identity = servo.identify()
        assert (identity.table, identity.details["writable"]) == ("", False)
        assert servo.read("present_voltage")["present_voltage"] == pytest.approx(7.4)
        refusals = (lambda: servo.write(acceleration=1.0), lambda: servo.move(1.0), servo.enable_torque)
        for refused in refusals:
            with there.traffic() as sent, pytest.raises(DeviceError):
                refused()
            assert [one for one in sent if instruction(one) == WRITE] == []
        servo.disable_torque()  # register 40 is the torque switch in every map
