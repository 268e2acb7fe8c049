"""Torque off works on strangers, in spite of alarms, and visits everyone whatever happens."""

from __future__ import annotations

import pytest

from motorbus import Robot
from motorbus.bus.nodes import Nodes, addressed
from motorbus.core.request import Effect, Priority
from motorbus.core.steps import Sleep, gather
from motorbus.errors import ChecksumError, MotorbusError, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.feetech import FAMILY
from motorbus.families.feetech.driver import Node, disable_torque, disable_torque_all
from motorbus.families.feetech.driver.node import as_nodes
from motorbus.families.feetech.driver.torque import all_limp
from tests.families.feetech.driver_script import (
    ALL,
    SYNC_WRITE,
    Line,
    Played,
    packet,
    play,
    prepared,
    reads,
    unheard,
    watch,
    writes,
)
from tests.support.machines import machine


def off(id: int, error: int = 0) -> Line:
    return writes(id, 40, 0, error=error)


def all_off(*ids: int) -> Line:
    return Line(packet(ALL, SYNC_WRITE, 40, 1, *(byte for id in ids for byte in (id, 0))), None)


def test_a_stranger_is_let_go_with_one_packet_that_passes_everyone() -> None:
    (request,) = watch(disable_torque(Node(3)), off(3)).requests
    assert (request.priority, request.effect) == (Priority.STOP, Effect.TORQUE)


def test_each_frame_names_whom_it_lets_go_so_that_nobody_else_counts_as_stopped() -> None:
    silent, known = prepared(2, at_8=0), Nodes(FAMILY.open(), 1_000_000)
    (let_go, _) = watch(disable_torque(silent), unheard(off(2)), reads(2, 40, 0)).requests
    assert addressed(let_go) == {2}
    (together,) = all_limp(as_nodes([2, 3]))
    known.stopped(together)
    assert [known.last_stop(node) for node in (1, 2, 3)] == [0, 1, 1]
    assert not known  # whether there is anybody the answers tell


def test_who_is_let_go_does_not_end_the_movement_of_another_and_does_not_hide_its_restart() -> None:
    with machine(arm="1-3", exit="hold") as (made, sims), Robot.of(made) as robot:
        bus, first = robot["a1"].bus, robot["a1"]

        async def off() -> None:
            await Sleep(0.5)
            await disable_torque_all([2, 3])

        bus.run(gather(type(first).move.function(first, 0.8), off()))
        assert first.position() == pytest.approx(0.8, abs=0.01)
        robot["a2"].device.write(status_return_level=0)
        robot["a2"].device.disable_torque()
        bus.run(disable_torque_all([2, 3]))
        sims["arm"][1].unplug()
        sims["arm"][1].plug()
        bus.run(Sleep(1.0))
        first.state()
        assert set(robot.faults) == {"a1"}


def test_alarms_do_not_matter() -> None:
    node = Node(3)
    play(disable_torque(node), off(3, error=0x3F))
    assert "overload" in node.alarm


def test_it_is_said_three_times_and_then_read_back() -> None:
    play(disable_torque(Node(3)), unheard(off(3)), off(3))
    play(disable_torque(Node(3)), *[unheard(off(3))] * 3, reads(3, 40, 0))


def test_torque_that_stays_on_is_told() -> None:
    with pytest.raises(VerificationFailed, match="register 40"):
        play(disable_torque(Node(3)), *[unheard(off(3))] * 3, reads(3, 40, 1))


def test_nobody_there_is_in_doubt() -> None:
    with pytest.raises(OutcomeUnknown):
        play(disable_torque(Node(3)), *[unheard(off(3))] * 3, unheard(reads(3, 40, 0)))


def test_a_servo_that_acknowledges_nothing_is_read_back() -> None:
    play(disable_torque(prepared(at_8=0)), unheard(off(3)), reads(3, 40, 0))


def test_where_no_acknowledgement_is_due_it_is_said_until_it_reads_so() -> None:
    still, limp = reads(3, 40, 1), reads(3, 40, 0)
    silent = unheard(off(3))
    play(disable_torque(prepared(at_8=0)), silent, still, silent, limp)
    play(disable_torque(prepared(at_8=0)), silent, unheard(limp), silent, still, silent, limp)
    with pytest.raises(VerificationFailed, match="register 40"):
        play(disable_torque(prepared(at_8=0)), *[silent, still] * 3)


def test_everyone_is_let_go_at_once_and_then_one_by_one() -> None:
    assert play(disable_torque_all([1, 2, 3]), all_off(1, 2, 3), off(1), off(2), off(3)) == {}


def test_nobody_is_no_packet() -> None:
    assert play(disable_torque_all([])) == {}


def test_more_than_a_packet_carries_are_split() -> None:
    played = Played([all_off(*range(125)), all_off(125, 126), *map(off, range(127))])
    assert played.run(disable_torque_all(range(127))) == {}


def test_a_dead_servo_does_not_hold_up_the_others() -> None:
    errors = play(
        disable_torque_all([1, 2, 3]),
        *(all_off(1, 2, 3), off(1), *[unheard(off(2))] * 3, unheard(reads(2, 40, 0)), off(3, error=0x20)),
    )
    assert {id: type(error) for id, error in errors.items()} == {2: OutcomeUnknown}


@pytest.mark.parametrize("failure", [RequestError("no gate"), ChecksumError("c")])
def test_every_error_is_collected(failure: MotorbusError) -> None:
    lines = [Line(all_off(1, 2).sent, failure), Line(off(1).sent, failure)]
    if isinstance(failure, ChecksumError):
        lines += [Line(off(1).sent, failure)] * 2 + [Line(reads(1, 40, 0).sent, failure)]
    errors = play(disable_torque_all([1, 2]), *lines, off(2))
    assert set(errors) == {1}
    if isinstance(failure, ChecksumError):  # of an order that has left
        assert isinstance(errors[1], OutcomeUnknown)
    else:
        assert errors[1] is failure


@pytest.mark.parametrize("step", range(4))
def test_an_interruption_does_not_keep_anyone_from_being_let_go(step: int) -> None:
    whole = [all_off(1, 2, 3), off(1), off(2), off(3)]
    cut = [Line(whole[0].sent, KeyboardInterrupt()), *whole[1:]]
    played = Played(whole, interrupt_at=step) if step else Played(cut)
    with pytest.raises(KeyboardInterrupt):
        played.run(disable_torque_all([1, 2, 3]))
    assert played.script == []
