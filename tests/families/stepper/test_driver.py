"""What a host learns of a controller: its projects, its inputs, and that it is there at all. Nothing of it writes."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import motorbus
from motorbus.core.family import Found
from motorbus.core.request import Reply, Request, Response, TimeoutClass
from motorbus.errors import FramingError, OutcomeUnknown, RequestError, UnexpectedReply
from motorbus.families.stepper import FAMILY, AsyncController, Controller, Program, Sends, driver
from motorbus.families.stepper.driver import Node, presence, vote
from motorbus.families.stepper.driver.exchanges import command
from motorbus.families.stepper.table import TABLE
from tests.families.stepper.bench import Bench, Tampering, bench
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

READ_1 = "FF AA 3E 01 00 00 00 00 00 00 E8"
READ_2 = "FF AA 3E 02 00 00 00 00 00 00 E9"
DUMP_BYTES = 226


def shown(request: Request[Any]) -> str:
    assert isinstance(request.wire, bytes)
    return request.wire.hex(" ").upper()


def put(there: Bench, data: bytes) -> Program:
    program = Program.from_dump(data)
    there.simulated.put(program.project.number, program.project)
    return program


# --- reading ------------------------------------------------------------------------------------------------


def test_every_parameter_is_read_by_its_name() -> None:
    with bench() as there:
        raws = there.device.read_raw()
        assert raws == {name: there.simulated.memory[name] for name in TABLE}
        values = there.device.read()
        assert values == {name: TABLE[name].to_value(raw) for name, raw in raws.items()}
        assert there.device.read("step_1_delay", "step_1_speed") == {
            "step_1_delay": pytest.approx(1.0),
            "step_1_speed": pytest.approx(10.471975512),
        }


def test_a_project_is_read_as_a_program() -> None:
    with bench() as there:
        stored = put(there, DUMP_B)
        found = there.device.read_project(2)
        assert found.project == stored.project
        assert str(found.estimate()).startswith("at least 41.6 s + 6 waits")
        assert there.device.dump(2) == DUMP_B
        assert there.device.read("step_2_distance", project=2) == {"step_2_distance": 56814}


def test_a_dump_is_read_twice_and_nothing_else_is_sent() -> None:
    with bench() as there:
        there.device.dump(2)
        assert there.sent() == [READ_2, READ_2]


@pytest.mark.parametrize("project", [0, 5])
def test_a_project_that_there_is_not_is_refused(project: int) -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="project"):
            there.device.dump(project)
        with pytest.raises(RequestError, match="no_such"):
            there.device.read("no_such")
        assert there.sent() == []


class Spoiling(Tampering):
    """Changes one byte of the image of each dump that `places` names, by the number of the dump."""

    def __init__(self, places: dict[int, int], mask: int = 0x01) -> None:
        super().__init__()
        self.places, self.mask = places, mask

    def change(self, data: bytes, number: int) -> bytes:
        if number not in self.places or len(data) < DUMP_BYTES:
            return data
        at = self.places[number]
        return data[:at] + bytes((data[at] ^ self.mask,)) + data[at + 1 :]


@pytest.mark.parametrize("spoilt", [{1: 40}, {2: 40}, {1: 40, 2: 50}])
def test_readings_that_differ_are_read_again_until_each_byte_is_agreed_upon(spoilt: dict[int, int]) -> None:
    with bench(line=Spoiling(spoilt)) as there:
        assert there.device.dump(1) == DUMP_A
        assert len(there.sent()) == 4


@pytest.mark.parametrize("spoilt", [{1: 40, 3: 40}, {2: 40, 3: 40}, {1: 40, 4: 40}])
def test_once_two_readings_have_differed_two_that_are_changed_alike_are_not_believed(
    spoilt: dict[int, int],
) -> None:
    with bench(line=Spoiling(spoilt)) as there:
        assert there.device.dump(1) == DUMP_A
        assert len(there.sent()) == 5


def test_what_is_changed_alike_each_time_cannot_be_told_and_is_not_claimed_to_be() -> None:
    with bench(line=Spoiling(dict.fromkeys(range(9), 40))) as there:
        assert there.device.dump(1) != DUMP_A


class Noisy(Tampering):
    """Another image each time."""

    def change(self, data: bytes, number: int) -> bytes:
        return data[:6] + bytes(byte ^ number for byte in data[6:])


def test_a_line_too_bad_for_two_equal_readings_is_said_to_be() -> None:
    with bench(line=Noisy()) as there:
        with pytest.raises(FramingError, match="differently each of 5 times") as raised:
            there.device.dump(1)
        assert "cable" in raised.value.advice
        assert there.sent() == [READ_1] * 5


def test_an_image_of_another_project_is_no_value() -> None:
    line = Spoiling(dict.fromkeys(range(9), 6), mask=0x02)
    with bench(line=line) as there, pytest.raises(UnexpectedReply, match="says project 3"):
        there.device.dump(1)


@pytest.mark.parametrize(
    ("readings", "agreed"),
    [
        ([b"ab"], b""),
        ([b"ab", b"ab"], b"ab"),
        ([b"ab", b"ax"], b""),
        ([b"ab", b"ax", b"yb"], b""),
        ([b"ab", b"ax", b"ab"], b""),
        ([b"ab", b"ax", b"yb", b"ab"], b"ab"),
        ([b"a", b"b", b"a", b"b"], b""),
        ([b"a", b"b", b"a", b"b", b"a"], b"a"),
    ],
)
def test_a_vote(readings: list[bytes], agreed: bytes) -> None:
    assert vote(readings) == agreed


def test_an_input_is_read() -> None:
    with bench() as there:
        there.simulated.set_input(2, True)
        assert [there.device.read_input(port) for port in range(1, 6)] == [False, True, False, False, False]
        there.sent()
        for port in (0, 6, 1.0):
            with pytest.raises(RequestError, match="no input"):
                there.device.read_input(port)  # type: ignore[arg-type]  # 1.0 is what is wrong with it
        assert there.sent() == []


def test_an_input_is_read_by_one_exchange_that_is_kept() -> None:
    one, other = Node(), Node()
    kept = [driver.read_input(one, port) for port in range(1, 6)]
    assert [driver.read_input(one, port) for port in range(1, 6)] == kept
    assert [shown(request)[6:14] for request in kept] == [f"00 0B 0{port}" for port in range(1, 6)]
    assert driver.read_input(other, 1) is not kept[0]


@pytest.mark.parametrize(
    ("name", "values", "came", "says"),
    [
        ("read_input", {"port": 2}, "FFAA000B0202", "byte 5 (step or level) is 02, 00 is due"),
        ("read_input", {"port": 2}, "FFAA000B02", "5 bytes came, 6 are due"),
        (
            "set_project_loop",
            {"project_loop": 9},
            "FFAA8E050000",
            "byte 3 is 05, a project from 01 to 04 is due",
        ),
        ("stop_motor", {}, "FFAA030D0001", "byte 5 (step or level) is 01, 00 is due"),
    ],
)
def test_a_reply_that_is_not_due_is_told_byte_by_byte(
    name: str, values: dict[str, Any], came: str, says: str
) -> None:
    request = command(Node(), name, bytes, **values)
    assert request.decode is not None
    with pytest.raises(UnexpectedReply) as raised:
        request.decode(Response((Reply(0, (), bytes.fromhex(came)),), (), 1.0))
    assert raised.value.summary == f"the reply to {name} is not the one that is due: {says}"
    assert (raised.value.sent, raised.value.received) == (request.wire, bytes.fromhex(came))


# --- who is there -------------------------------------------------------------------------------------------


def test_it_tells_no_identity_and_none_is_made_up() -> None:
    with bench() as there:
        found = there.device.identify()
        assert (found.node, found.model, found.firmware) == (1, "stepper controller", "not told")
        assert found.details == {"motor": 3, "projects": 4, "known_by": "a dump of 226 bytes"}
        assert there.sent() == [READ_1]


def test_a_scan_says_what_it_sends_before_it_sends_it() -> None:
    with bench() as there:
        (found,) = there.run(FAMILY.open().scan())
        assert there.events[0] == Sends(bytes.fromhex(READ_1), 9600)
        assert there.events[2] == Found(1, 9600, None)
        assert found.identity == there.device.identify()


def test_nobody_is_asked_twice_and_no_more() -> None:
    with bench() as there:
        there.simulated.unplug()
        assert there.run(FAMILY.open().scan()) == []
        assert there.sent() == [READ_1, READ_1]


@pytest.mark.parametrize("node", [0, 2, 3, True, -1])
def test_there_is_one_controller_on_a_line_and_it_is_called_1(node: int) -> None:
    with bench() as there:
        for refused in (lambda: Controller(there.bus, node), lambda: there.run(FAMILY.open().scan((node,)))):
            with pytest.raises(RequestError, match="not the id of a stepper controller"):
                refused()
        assert there.sent() == []


def test_to_find_something_out_nothing_is_sent_that_means_something_to_a_sensor() -> None:
    """An attitude sensor with this header takes 03 and 00 for registers that set its rate and store what it has."""
    with bench() as there:
        there.run(FAMILY.open().scan((1,), (9600,)))
        for look in (there.device.ping, there.device.identify, there.device.read, there.device.read_project):
            look()
        there.simulated.unplug()
        for _ in range(5):
            assert there.device.ping() is False  # doubtful by now, so it is probed
        looked = there.sent()
        probes = [shown(presence.probe(Node(), attempt)) for attempt in range(64)]
        echo_test = FAMILY.open().echo_test()
        assert echo_test is not None
        test = shown(echo_test)
    assert {frame[:8] for frame in (*looked, *probes, test)} == {"FF AA 3E"}


def test_opening_a_port_by_its_family_reads_one_project_and_no_more() -> None:
    with motorbus.simulate("stepper") as simulation, motorbus.open(simulation.url) as bus:
        assert bus.statistics.nodes[1].sent == 1
        assert motorbus.stepper.Controller(bus).ping() is True


# --- another motor, another face ---------------------------------------------------------------------------


def test_another_motor_number_stands_in_motor_commands_only() -> None:
    with bench(motor=5) as there:
        with pytest.raises(OutcomeUnknown):
            there.device.stop()
        assert {frame[6:11] for frame in there.sent() if frame[6:8] == "05"} == {"05 0D"}
        assert there.device.identify().details["motor"] == 5


@pytest.mark.parametrize("motor", [0, 256, 0x1E, "three"])
def test_a_number_that_no_motor_has_is_refused(motor: object) -> None:
    with pytest.raises(RequestError, match="not the number of a motor"):
        FAMILY.open(motor=motor)
    with pytest.raises(RequestError, match="no setting 'moter'"):
        FAMILY.open(moter=3)


def test_a_bus_that_is_opened_for_another_motor_simulates_one() -> None:
    with motorbus.open("stepper:sim,motor=0x21") as bus:
        assert motorbus.stepper.Controller(bus).stop().value


def test_verbs_can_be_awaited() -> None:
    async def looked() -> tuple[bool, Program]:
        with motorbus.simulate("stepper") as simulation:
            async with motorbus.open_async(simulation.url) as bus:
                one = AsyncController(bus)
                return await one.ping(), await one.read_project(1)

    there, program = asyncio.run(looked())
    assert there
    assert program.dump() == DUMP_A


def test_what_it_cannot_do_is_absent() -> None:
    absent = {
        "move",
        "telemetry",
        "position",
        "calibrate",
        "zero",
        "enable_torque",
        "disable_torque",
        "alarms",
    }
    assert [name for name in absent if hasattr(Controller, name)] == []
    with bench() as there:
        assert there.device.alarm == ()
        assert there.device.table is TABLE
        assert there.device.raw(TABLE["step_1_delay"], 0.25) == 250


# --- figures of the line ------------------------------------------------------------------------------------


def test_a_command_takes_17_7_ms_of_the_line_and_a_dump_246_9() -> None:
    command = driver.read_input(Node(), 1)
    dump = driver.dump_once(Node(), 1)
    assert FAMILY.open().air_time(command, 9600) * 1000 == pytest.approx(17.708, abs=0.001)
    assert FAMILY.open().air_time(dump, 9600) * 1000 == pytest.approx(246.875, abs=0.001)
    assert FAMILY.open().turnaround(command) == 0.2
    assert FAMILY.open().turnaround(dump) + 0.2354167 == pytest.approx(0.6)
    assert FAMILY.open().turnaround(Request(b"", reply_within=TimeoutClass.STORE)) == 1.0
    assert FAMILY.open().quiet_time(9600) == pytest.approx(0.2354167 + 0.05)
