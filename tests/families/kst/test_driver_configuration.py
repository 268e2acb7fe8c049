"""Reports, mid point, limits, sense of rotation: the frames of the public drivers, and what is verified."""

from __future__ import annotations

import pytest

from motorbus.errors import RequestError, VerificationFailed
from motorbus.families.kst import driver
from tests.families.kst.bench import bench, node, play

SAVE = ("605#2210100173617665", None)
BITS = "605#400F300000000000"


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
        (BITS, told),
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
