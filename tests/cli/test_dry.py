"""A dry run reads, withholds what would change something, and goes to the end of guarded sequences."""

from __future__ import annotations

from typing import Any

import pytest

import motorbus
from motorbus.cli import dry
from motorbus.cli.dry import DryBus
from motorbus.cli.exits import Unforeseeable
from motorbus.cli.output import Output
from motorbus.core.request import Request
from motorbus.core.steps import (
    INTENT,
    Emit,
    Exclusive,
    JournalEntry,
    Progress,
    SetBitrate,
    Sleep,
    WaitFor,
    gather,
)
from motorbus.errors import LimitExceeded
from motorbus.families.feetech import FAMILY, Servo
from motorbus.families.feetech.driver import action_all
from motorbus.simulation.named import Simulation


def test_reads_are_carried_out_and_writes_are_not(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        rehearsal = DryBus(bus)
        servo = Servo(rehearsal, 1)
        assert servo.read("torque_limit") == {"torque_limit": 1.0}
        servo.write(torque_limit=0.5)
        assert [frame[4] for frame in rehearsal.frames] == [3]
        assert Servo(bus, 1).read("torque_limit") == {"torque_limit": 1.0}


def test_a_guarded_sequence_is_shown_with_its_lock(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        rehearsal = DryBus(bus)
        Servo(rehearsal, 1).write(max_temperature=60, max_torque=0.5)
        assert [frame[5] for frame in rehearsal.frames] == [55, 40, 13, 16, 55]


def test_the_gate_stands_in_a_dry_run_too(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        rehearsal = DryBus(bus)
        with pytest.raises(LimitExceeded):
            Servo(rehearsal, 1).move(9.0)
        assert rehearsal.frames == []


def test_nobody_waits_in_a_rehearsal_but_its_time_passes(arm: Simulation) -> None:
    async def waiting() -> float:
        began = await Sleep(0)
        heard = await WaitFor(lambda _: True, 100.0)
        assert heard is None
        return await Sleep(1000.0) - began

    with motorbus.open(arm.url) as bus:
        before = bus.link.now()
        assert DryBus(bus).run(waiting()) == pytest.approx(1100.0, abs=0.1)
        assert bus.link.now() - before < 0.1


def test_events_are_heard_and_no_journal_is_kept(arm: Simulation) -> None:
    async def told() -> None:
        await Emit(JournalEntry("set_id", INTENT, {"node": 1}))
        await Emit(Progress(1, 2))

    heard: list[object] = []
    with motorbus.open(arm.url) as bus:
        DryBus(bus).run(told(), report=heard.append)
    assert heard == [Progress(1, 2)]


def test_what_cannot_be_foreseen_says_so(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus, pytest.raises(Unforeseeable):
        Servo(DryBus(bus), 1).move(3.0)  # waits for an arrival that will not be


def test_an_answer_that_only_a_real_run_gets_is_no_number(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        servo = Servo(DryBus(bus), 1)
        servo.prepare()
        servo.disable_torque()
        answer: Any = servo.position()
        assert answer == 1.0
        for use in (
            lambda: answer + 1,
            lambda: answer < 1,
            lambda: answer[0],
            lambda: int(answer),
            lambda: list(answer),
        ):
            with pytest.raises(Unforeseeable):
                use()


def test_who_is_asked_for_the_first_time_after_a_withheld_write_is_not_foreseen(arm: Simulation) -> None:
    """Nothing is known of the servo, and its answer would be one of before the write."""
    with motorbus.open(arm.url) as bus:
        servo = Servo(DryBus(bus), 1)
        servo.disable_torque()
        for verb in (servo.position, servo.read, servo.stop, servo.enable_torque):
            with pytest.raises(Unforeseeable):
                verb()


def test_another_device_is_apart_and_its_frames_are_shown_with_the_rest(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        rehearsal = DryBus(bus)
        rehearsal.run(action_all())
        Servo(rehearsal.apart(), 2).enable_torque()
        assert [frame[4] for frame in rehearsal.frames] == [5, 3]


def test_the_rate_of_the_bus_is_known(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        assert DryBus(bus).run(SetBitrate(0)) == 1_000_000


def test_every_kind_of_step_is_gone_through(arm: Simulation) -> None:
    async def inner(name: str) -> str:
        await Sleep(1.0)
        await Emit(name)
        return name

    async def outer() -> list[str]:
        return [await Exclusive(inner("a")), *await gather(inner("b"), inner("c"))]

    with motorbus.open(arm.url) as bus:
        assert DryBus(bus).run(outer()) == ["a", "b", "c"]


def test_an_error_reaches_the_operation(arm: Simulation) -> None:
    absent = motorbus.feetech.FAMILY.open().probe(9, 0)

    async def careful(request: Request[bool]) -> str:
        try:
            await request
        except motorbus.NoReply:
            return "nobody"
        return "somebody"

    with motorbus.open(arm.url) as bus:
        assert DryBus(bus).run(careful(absent)) == "nobody"


def test_what_was_withheld_from_one_hides_nothing_of_another(arm: Simulation) -> None:
    with motorbus.open(arm.url) as bus:
        rehearsal = DryBus(bus)
        Servo(rehearsal, 1).enable_torque()
        assert rehearsal.run(FAMILY.open().probe(1, 0)) is not True
        assert rehearsal.run(FAMILY.open().probe(2, 0)) is True
        rehearsal.run(action_all())  # which everyone hears
        assert rehearsal.run(FAMILY.open().probe(2, 0)) is not True


def test_frames_are_explained_without_their_framing(
    arm: Simulation, capsys: pytest.CaptureFixture[str]
) -> None:
    with motorbus.open(arm.url) as bus:
        rehearsal = DryBus(bus)
        Servo(rehearsal, 1).write(torque_limit=0.5)
        dry.show(rehearsal, Output())
    shown = capsys.readouterr().out
    assert shown.startswith("would send FF FF 01 05 03 30 F4 01 D1\n")
    assert "WRITE to servo 1; address register 48, torque_limit; torque_limit 500" in shown
    assert "checksum" not in shown
    assert "status packet" not in shown


def test_that_nothing_is_withheld_is_told(arm: Simulation, capsys: pytest.CaptureFixture[str]) -> None:
    with motorbus.open(arm.url) as bus:
        rehearsal = DryBus(bus)
        Servo(rehearsal, 1).read("torque_limit")
        dry.show(rehearsal, Output())
    assert capsys.readouterr().out == "nothing that changes anything would be sent\n"


def test_a_field_that_says_its_name_is_named_once(capsys: pytest.CaptureFixture[str]) -> None:
    with motorbus.simulate("kst", ids="0x25", profile="xqpower") as simulation:
        with motorbus.open(simulation.url) as bus:
            rehearsal = DryBus(bus)
            bus.family.devices.blocking(rehearsal, 0x25).start_reports()
        dry.show(rehearsal, Output())
    shown = capsys.readouterr().out
    assert "would send 000#0125" in shown
    assert "; node 37" in shown
    assert "node node" not in shown
