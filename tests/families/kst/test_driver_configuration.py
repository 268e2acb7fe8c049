"""Reports, mid point, limits, sense of rotation: the frames of the public drivers, and what is verified."""

from __future__ import annotations

import pytest

from motorbus.core.operation import CanFrame, Data
from motorbus.errors import Interrupted, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.kst import driver
from motorbus.families.kst.driver.exchanges import order
from motorbus.families.kst.table import REVERSED
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.families.kst.bench import bench, node, play

SAVE = ("605#2210100173617665", None)
BITS = "605#400F300000000000"
MID_POINT_DONE = bytes.fromhex("6009300000000000")


class Deafening(PerfectLine):
    """Loses each acknowledgement of a mid point."""

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if isinstance(data, CanFrame) and data.data == MID_POINT_DONE:
            return []
        return super().carry(sender, data, at)


def test_reports_are_set_and_started_in_the_form_of_the_profile() -> None:
    play(
        driver.start_reports(node("kst-ext"), 0.02),
        ("605#2200220014000000", "6000220000000000"),
        ("005#0100", None),
    )
    play(driver.start_reports(node("xqpower")), ("000#0105", None))
    play(driver.stop_reports(node("kingmax")), ("005#0200", None))
    for interval in (0.0, 0.256, 0.009):
        with pytest.raises(RequestError, match="report_interval"):
            play(driver.start_reports(node("xqpower"), interval))


@pytest.mark.parametrize(("profile", "value"), [("kst-ext", "00"), ("kingmax", "00"), ("xqpower", "01")])
def test_the_mid_point_is_set_and_saved(profile: str, value: str) -> None:
    assert (
        play(
            driver.set_mid_point(node(profile)),
            ("605#4002600000000000", "4b02600064000000"),
            (f"605#22093000{value}000000", "6009300000000000"),
            SAVE,
            ("605#4002600000000000", "4b02600000000000"),
        )
        == 0.0
    )
    with bench(profile=profile) as there:
        there.servo().move(0.4)
        there.servo().set_mid_point()
        assert there.servo().position() == pytest.approx(0.0, abs=0.002)
        there.sim().power_cycle()
        assert there.servo().position() == pytest.approx(0.0, abs=0.002)


@pytest.mark.parametrize("verb", ["set_mid_point", "set_reversed"])
def test_what_gives_positions_another_meaning_is_seen_by_gate_and_stop(verb: str) -> None:
    with bench(profile="kst-ext") as there:
        servo = there.servo()
        there.sim().raw_position = 600
        servo.position()
        name, raw = ("mid_point", 0) if verb == "set_mid_point" else ("function_enable", 1 << REVERSED)
        there.run(order(servo, servo.table[name], raw))
        there.sent()
        assert there.estop().acknowledged == (5,)
        here = there.sim().raw_position
        assert there.sent()[0] == "605#4002600000000000", "what was read before is no place to hold at"
        assert there.sim().memory["goal_position"] == here
        there.sim().raw_position = 300
        with pytest.raises(Interrupted):
            servo.set_mid_point() if verb == "set_mid_point" else servo.set_reversed(False)
        with pytest.raises(Interrupted):
            servo.set_travel_limits(-0.5, 0.5)
        assert [frame for frame in there.sent() if "#22" in frame] == []


@pytest.mark.parametrize("name", ["mid_point", "function_enable"])
def test_a_servo_that_sets_off_with_another_zero_is_stopped(name: str) -> None:
    with bench(profile="kst-ext", old_target="kept") as there:
        servo = there.servo()
        servo.move(0.7)
        there.run(order(servo, servo.table[name], 0 if name == "mid_point" else 1 << REVERSED))
        there.link.advance(0.1)
        assert there.sim().status()["moving"] is True
        assert there.estop().acknowledged == (5,)
        there.link.advance(1.0)
        assert there.sim().status()["moving"] is False
        assert abs(there.sim().raw_position) < 399, "it is not at 40 degrees of the new counting"


def test_a_mid_point_is_never_set_twice() -> None:
    with bench(profile="kst-ext", line=Deafening()) as there:
        there.sim().raw_position = 600
        with pytest.raises(OutcomeUnknown):
            there.servo().set_mid_point()
        assert [frame for frame in there.sent() if "#2209" in frame] == ["605#2209300000000000"]


def test_limits_are_kept() -> None:
    with bench(profile="kst-ext") as there:
        servo = there.servo()
        servo.set_travel_limits(-0.5, 0.25)
        there.sim().power_cycle()
        assert servo.travel_limits() == pytest.approx((-0.5, 0.25), abs=0.001)


@pytest.mark.parametrize("limits", [(0.1, 0.5), (-0.5, -0.1), (-2.0, 1.0), (0.0, 0.0), (float("nan"), 1.0)])
def test_impossible_limits_are_refused(limits: tuple[float, float]) -> None:
    with pytest.raises(RequestError):
        play(driver.set_travel_limits(node("kst-ext"), *limits))


def test_the_trap_of_the_reversed_state_is_told() -> None:
    with bench(profile="kst-ext") as there:
        servo = there.servo()
        servo.set_reversed(True)
        with pytest.raises(VerificationFailed, match="reads back") as raised:
            servo.set_travel_limits(-0.5, 0.25)
        assert "reversed" in raised.value.cause
        servo.set_travel_limits(-0.5, 0.5)
        assert servo.travel_limits() == pytest.approx((-0.5, 0.5), abs=0.001)


def test_only_the_one_known_bit_is_changed() -> None:
    told, turned = "4f0f300091000000", "4f0f3000b1000000"
    play(
        driver.set_reversed(node("kst-ext"), True),
        *[(BITS, told), (BITS, told)],
        ("605#220F3000B1000000", "600f300000000000"),
        *[(BITS, turned), (BITS, turned), SAVE, (BITS, turned)],
    )
    assert play(driver.reversed_(node("kst-ext")), (BITS, turned)) is True
    assert play(driver.reversed_(node("kst-ext")), (BITS, told)) is False


def test_a_reverse_bit_that_a_restart_undoes_is_seen_by_reading_it() -> None:
    with bench(profile="kst-ext", reverse_rolls_back=True) as there:
        servo = there.servo()
        servo.set_reversed(True)
        assert servo.reversed() is True
        there.sim().power_cycle()
        assert servo.reversed() is False
