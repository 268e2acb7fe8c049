"""Several servos at once: SYNC READ, SYNC WRITE, REG WRITE with ACTION, torque off, servos in a loop."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from motorbus.core.family import Positions
from motorbus.errors import DeviceError, LimitExceeded, MotorbusError, NoReply, RequestError
from motorbus.families.feetech import (
    Node,
    ReadsAlone,
    Servo,
    ServoGroup,
    disable_torque_all,
    prepare_all,
    reg_write_all,
    sync_read,
    sync_write,
)
from motorbus.families.feetech.driver.stream import open_stream
from motorbus.families.feetech.protocol import Instruction
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS
from tests.families.feetech.worlds import later, traffic, world, writes

MIXED = "sts3215+scs0009+hls3925"


def servos(bus: Any, count: int = 3) -> list[Servo]:
    found = [Servo(bus, id) for id in range(1, count + 1)]
    assert bus.run(prepare_all(found)) == {}
    return found


class TestSyncRead:
    @pytest.mark.parametrize("name", [*TABLES, MIXED])
    def test_it_reads_each_servo_by_its_own_map(self, name: str) -> None:
        with world(name, ids="1-3") as (bus, _, _simulation):
            found = bus.run(sync_read(["present_position", "present_velocity"], [1, 2, 3]))
            assert found.errors == {}
            for id, values in found.values.items():
                assert values == Servo(bus, id).read("present_position", "present_velocity")

    def test_a_silent_servo_costs_its_own_value_only(self) -> None:
        with world(ids="1-3") as (bus, _, simulation):
            simulation[2].alarm = 1
            found = bus.run(sync_read(["present_voltage"], [1, 2, 3, 9]))
            assert sorted(found.values) == [1, 2, 3]
            assert isinstance(found.errors[9], NoReply)
            assert found.alarms == {1: (), 2: ("voltage",), 3: ()}

    def test_a_board_without_sync_read_is_read_alone_and_reported_once(self) -> None:
        with world(ids="1-3") as (bus, _, simulation):
            simulation[2].lacks = {Instruction.SYNC_READ}
            group = [Servo(bus, id) for id in (1, 2, 3)]
            events: list[Any] = []
            for _ in range(3):
                found = bus.run(sync_read(["present_position"], group), report=events.append)
                assert sorted(found.values) == [1, 2, 3]
            assert events.count(ReadsAlone(2)) == 1
            with traffic(bus) as sent:
                bus.run(sync_read(["present_position"], group))
            assert sent == ["fe 06 82 38 02 01 03", "02 04 02 38 02"]

    @pytest.mark.parametrize(("name", "most"), [("sts", 20), ("smbl", 5)])
    def test_replies_of_one_request_take_at_most_4_ms_at_the_rate_of_the_bus(
        self, name: str, most: int
    ) -> None:
        with world(name, ids="1-20") as (bus, _, _):
            group = servos(bus, 20)
            with traffic(bus) as sent:
                assert len(bus.run(sync_read(["present_position"], group)).values) == 20
            assert [len(one.split(" ")) - 5 for one in sent] == [most] * (20 // most)

    @pytest.mark.parametrize("ids", [[], [1, 1], 5, [254], [-1]])
    def test_a_bad_list_of_servos_is_refused(self, ids: Any) -> None:
        with world() as (bus, _, _), traffic(bus) as sent:
            with pytest.raises(RequestError):
                bus.run(sync_read(["present_position"], ids))
            with pytest.raises(RequestError):
                bus.run(sync_read(["nonsense"], [1]))
            assert sent == []


class TestSyncWrite:
    @pytest.mark.parametrize("name", [*TABLES, MIXED])
    def test_it_moves_all_by_one_packet(self, name: str) -> None:
        with world(name, ids="1-3") as (bus, _, _simulation):
            goals = {id: Servo(bus, id).position() + 0.2 for id in (1, 2, 3)}
            for id in goals:
                Servo(bus, id).enable_torque()
            group = servos(bus)
            with traffic(bus) as sent:
                bus.run(sync_write({servo: {"goal_position": goals[servo.node]} for servo in group}))
            assert [one.split(" ")[2] for one in sent] == ["83"]
            later(bus, 1.0)
            for id, goal in goals.items():
                assert Servo(bus, id).position() == pytest.approx(goal, abs=0.02)

    @pytest.mark.parametrize(
        ("values", "error"),
        [
            ({1: {"goal_position": 2.5}, 9: {"goal_position": 2.5}}, NoReply),
            ({1: {"goal_position": 2.5}, 2: {"goal_position": nan}}, RequestError),
            ({1: {"goal_position": 2.5}, 2: {"goal_position": 99.0}}, RequestError),
            ({1: {"goal_position": 2.5}, 2: {"goal_position": 6.9}}, LimitExceeded),
            ({1: {"goal_position": 2.5}, 2: {"goal_velocity": 1.0}}, RequestError),
            ({1: {"max_temperature": 60.0}}, RequestError),
            ({1: {"goal_position": 2.5, "torque_limit": 1.0}}, RequestError),
            ({}, RequestError),
        ],
    )
    def test_all_or_nothing(self, values: Any, error: type[Exception]) -> None:
        with world(ids="1-3") as (bus, _, _), traffic(bus) as sent:
            with pytest.raises(error):
                bus.run(sync_write(values))
            assert writes(sent) == []


class TestRegWriteAll:
    def test_all_begin_at_the_same_moment(self) -> None:
        with world(ids="1-3", position=1800) as (bus, _, _):
            for id in (1, 2):
                Servo(bus, id).enable_torque()
            with traffic(bus) as sent:
                bus.run(reg_write_all({1: {"goal_position": 2.5}, 2: {"goal_position": 3.0}}))
            assert [one.split(" ")[2] for one in writes(sent)] == ["04", "04", "05"]
            later(bus, 1.0)
            assert Servo(bus, 1).position() == pytest.approx(2.5, abs=0.02)
            assert Servo(bus, 2).position() == pytest.approx(3.0, abs=0.02)

    def test_action_is_not_sent_unless_all_have_acknowledged(self) -> None:
        with world(ids="1-3", position=1800) as (bus, _, simulation):
            group = servos(bus)
            simulation[2].unplug()
            with traffic(bus) as sent, pytest.raises(MotorbusError) as caught:
                bus.run(reg_write_all({servo: {"goal_position": 2.5} for servo in group}))
            assert "05" not in [one.split(" ")[2] for one in sent]
            assert "servos 1, 2 may hold" in "".join(caught.value.__notes__)


class TestDisableTorqueAll:
    def test_every_servo_is_visited_and_the_silent_ones_are_named(self) -> None:
        with world(ids="1-5") as (bus, _, simulation):
            for id in range(1, 6):
                Servo(bus, id).enable_torque()
            simulation[2].unplug()
            errors = bus.run(disable_torque_all(range(1, 6)))
            assert list(errors) == [2]
            assert not any(simulation[id].memory["torque_enable"] for id in (1, 3, 4, 5))

    def test_it_passes_a_latched_stop(self) -> None:
        with world(ids="1-3") as (bus, _, simulation):
            Servo(bus, 1).enable_torque()
            bus.estop()
            simulation[1].memory["torque_enable"] = 1
            assert bus.run(disable_torque_all([1])) == {}
            assert simulation[1].memory["torque_enable"] == 0


# -- a loop ----------------------------------------------------------------------------------------------------


class TestServoGroup:
    @pytest.mark.parametrize("name", ["sts", "hls", "smbl", "smcl"])
    def test_positions_are_those_of_each_servo(self, name: str) -> None:
        with world(name, ids="1-3") as (bus, _, simulation):
            group = ServoGroup(servos(bus))
            request = group.positions
            for raw in (1000, 2000, 3000, -5):
                simulation[2].raw_position = raw
                found = bus.run(request)
                assert isinstance(found, Positions)
                assert found.values[2] == pytest.approx(Servo(bus, 2).position())
                assert (sorted(found.values), found.missing) == ([1, 2, 3], ())
            simulation[3].unplug()
            assert bus.run(request).missing == (3,)

    def test_the_fast_decoder_takes_only_what_is_certain(self) -> None:
        with world(ids="1-2") as (bus, _, _):
            nodes = servos(bus, 2)
            request = ServoGroup(nodes).positions
            frames = [bytes.fromhex("ffff010400e80309"), bytes.fromhex("ffff020400d00721")]
            frames = [frame[:-1] + bytes((~sum(frame[2:-1]) & 0xFF,)) for frame in frames]
            exact = request.decode_exact
            assert exact is not None
            found = exact(b"".join(frames), 1.0)
            assert found is not None
            assert found.values == {
                1: pytest.approx(1000 * 6.283185 / 4096),
                2: pytest.approx(2000 * 6.283185 / 4096),
            }
            whole = b"".join(frames)
            for at in range(len(whole)):
                damaged = whole[:at] + bytes((whole[at] ^ 0x11,)) + whole[at + 1 :]
                assert exact(damaged, 1.0) is None
            assert exact(whole[:-1], 1.0) is None
            assert exact(frames[1] + frames[0], 1.0) is None
            nodes[1].known.forget()
            assert exact(whole, 1.0) is None

    def test_registers_are_read_by_name(self) -> None:
        with world(ids="1-3") as (bus, _, _):
            group = ServoGroup(servos(bus))
            found = bus.run(group.read("present_position", "present_load"))
            assert found[2] == Servo(bus, 2).read("present_position", "present_load")
            with pytest.raises(RequestError, match="not in one place"):
                _ = group.read("id", "present_position")

    @pytest.mark.parametrize("name", [*TABLES, MIXED])
    def test_goals_are_the_bytes_of_a_sync_write(self, name: str) -> None:
        with world(name, ids="1-3") as (bus, _, _):
            nodes = servos(bus)
            write = ServoGroup(nodes).write("goal_position")
            goals = [1.0, 2.0, 3.0]
            request = write(goals)
            with traffic(bus) as sent:
                bus.run(
                    sync_write({node: {"goal_position": to} for node, to in zip(nodes, goals, strict=True)})
                )
                bus.run(request)
            assert sent[0] == sent[1]
            assert [one.value for one in request.setpoints] == pytest.approx(goals, abs=0.003)
            assert all((one.low or 0.0) <= one.value <= (one.high or 0.0) for one in request.setpoints)

    def test_a_goal_beyond_the_limits_is_judged_by_the_gate(self) -> None:
        with world(ids="1-3") as (bus, _, _):
            nodes = servos(bus)
            nodes[1].write(max_position_limit=3.0)
            nodes = servos(bus)
            write = ServoGroup(nodes).write("goal_position")
            request = write([2.0, 3.2, 2.0])
            with traffic(bus) as sent, pytest.raises(LimitExceeded):
                bus.run(request)
            assert sent == []
            for wrong in ([1.0, 2.0], [1.0, nan, 1.0], [1.0, 1e308, 1.0], [1.0, 99.0, 1.0], [1.0, "2", 1.0]):
                with pytest.raises((RequestError, LimitExceeded)):
                    _ = write(wrong)

    def test_several_registers_are_written_by_rows_of_values(self) -> None:
        with world(ids="1-2") as (bus, _, simulation):
            write = ServoGroup(servos(bus, 2)).write("goal_position", "goal_time", "goal_velocity")
            bus.run(write([(1.0, 0, 2.0), (2.0, 0, 3.0)]))
            later(bus, 0.1)
            assert simulation[2].memory["goal_velocity"] == pytest.approx(3.0 * 4096 / 6.2832, abs=1)
            with pytest.raises(RequestError):
                _ = write([(1.0, 0, 2.0)])

    def test_servos_must_be_identified_and_sync_read_known(self) -> None:
        with world("scs", ids="1-2") as (bus, _, _):
            with pytest.raises(RequestError, match="not identified"):
                ServoGroup([Node(1)])
            group = ServoGroup(servos(bus, 2))
            with pytest.raises(RequestError, match="no SYNC READ"):
                _ = group.positions


class TestStream:
    @pytest.mark.parametrize("name", [*TABLES, MIXED])
    def test_it_leads_servos_of_every_map(self, name: str) -> None:
        with world(name, ids="1-3") as (bus, _, _simulation):
            group = [Servo(bus, id) for id in (1, 2, 3)]
            with traffic(bus) as sent:
                stream = bus.run(open_stream(group, rate=bus.rate))
            assert writes(sent) == []
            places = {id: place for one in stream.positions for id, place in bus.run(one).values.items()}
            assert sorted(places) == [1, 2, 3]
            bus.run(stream.start({1: 2.0}))
            later(bus, 0.5)
            goals = {id: place + 0.2 for id, place in places.items()}
            for request in stream.goals(goals):
                bus.run(request)
            later(bus, 1.0)
            for id, goal in goals.items():
                assert Servo(bus, id).position() == pytest.approx(goal, abs=0.02)

    def test_a_start_sets_what_lets_a_servo_follow(self) -> None:
        with world(ids="1-2") as (bus, _, simulation):
            simulation[1].memory["acceleration"] = 9
            simulation[1].memory["goal_time"] = 500
            stream = bus.run(open_stream([Servo(bus, 1), Servo(bus, 2)], rate=bus.rate))
            bus.run(stream.start({1: 1.0}))
            memory = simulation[1].memory
            assert (memory["acceleration"], memory["goal_time"], memory["goal_velocity"]) == (0, 0, 652)
            assert simulation[2].memory["goal_velocity"] == 0  # the maximum
            for wrong in ({9: 1.0}, {1: 0.0}, {1: nan}, {1: "1"}):
                with traffic(bus) as sent, pytest.raises(RequestError):
                    bus.run(stream.start(wrong))
                assert sent == []

    def test_a_board_without_sync_read_is_noticed_before_torque(self) -> None:
        with world(ids="1-3") as (bus, _, simulation):
            simulation[2].lacks = {Instruction.SYNC_READ}
            events: list[Any] = []
            group = [Servo(bus, id) for id in (1, 2, 3)]
            stream = bus.run(open_stream(group, rate=bus.rate), report=events.append)
            assert events.count(ReadsAlone(2)) == 1
            assert [len(one.expected) for one in stream.positions] == [2, 1]
            assert bus.run(stream.positions[1]).values.keys() == {2}

    def test_goals_are_refused_after_a_setting_was_written(self) -> None:
        with world(ids="1-2") as (bus, _, _):
            group = [Servo(bus, 1), Servo(bus, 2)]
            stream = bus.run(open_stream(group, rate=bus.rate))
            (request,) = stream.goals({1: 2.0, 2: 2.0})
            group[0].write(return_delay=0.0001)
            with traffic(bus) as sent, pytest.raises(RequestError):
                bus.run(request)
            assert sent == []
            with pytest.raises(RequestError):
                stream.goals({1: 2.0, 2: 2.0})
            group[0].prepare()
            bus.run(stream.goals({1: 2.0, 2: 2.0})[0])
            group[0].set_mode("velocity")
            group[0].prepare()
            with pytest.raises(RequestError):
                stream.goals({1: 2.0})

    def test_what_cannot_be_led_is_refused(self) -> None:
        with world(ids="1-2") as (bus, _, _simulation):
            with pytest.raises(NoReply):
                bus.run(open_stream([Servo(bus, 1), Servo(bus, 9)], rate=bus.rate))
            Servo(bus, 2).set_mode("velocity")
            with pytest.raises(RequestError, match="velocity"):
                bus.run(open_stream([Servo(bus, 1), Servo(bus, 2)], rate=bus.rate))
            stream = bus.run(open_stream([Servo(bus, 1)], rate=bus.rate))
            for wrong in ({2: 1.0}, {1: nan}, {1: 99.0}):
                with pytest.raises((RequestError, LimitExceeded)):
                    stream.goals(wrong)
        with world(firmware="9.99") as (bus, servo, _), pytest.raises(DeviceError):
            bus.run(open_stream([servo], rate=bus.rate))

    def test_traits_tell_which_maps_have_sync_read(self) -> None:
        assert {name for name in TABLES if not TRAITS[name].sync_read} == {"scs", "scs2"}
