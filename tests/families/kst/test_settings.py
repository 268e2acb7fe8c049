"""Settings of newer firmware: mid point, travel limits, reverse bit; writes that survive power-off."""

from __future__ import annotations

from collections.abc import Callable
from math import radians

import pytest

from motorbus.errors import Interrupted, OutcomeUnknown, VerificationFailed
from motorbus.families.kst import Servo
from tests.families.kst.bench import Answers, Bench
from tests.simulators.kst.host import SAVE

LIMIT = "605#220A30000CFE0000"
READ = "605#400A300000000000"
ACK, NEW, OLD = "585#600A300000000000", "585#4B0A30000CFE0000", "585#4B0A300018FC0000"


SETTINGS: dict[str, tuple[Callable[[Servo], object], dict[str, int]]] = {
    "limits": (lambda servo: servo.write(negative_limit=-0.5, positive_limit=0.75), {"positive_limit": 430}),
    "reverse bit": (lambda servo: servo.set_reversed(True), {"function_enable": 0x53 | 0x20}),
    "mid point": (lambda servo: servo.set_mid_point(), {"present_position": 0}),
}


@pytest.mark.parametrize("name", SETTINGS)
def test_setting_survives_power_off(name: str) -> None:
    call, expected = SETTINGS[name]
    with Bench(profile="kst-ext") as bench:
        bench[5].values["function_enable"] = 0x53
        bench[5].raw_position = 600
        call(bench.servo())
        assert bench.written().count(SAVE) == 1
        call(bench.servo())
        assert bench.written()[-1] == SAVE, "another program may have written it without a save"
        bench[5].power_cycle()
        assert {name: bench[5].memory[name] for name in expected} == expected


def test_latched_stop_refuses_settings_that_may_move_the_servo() -> None:
    with Bench(profile="kst-ext", position=300) as bench:
        assert bench.servo().ping() is True
        bench.bus.estop()
        bench.sent()
        for call, _ in SETTINGS.values():
            with pytest.raises(Interrupted):
                call(bench.servo())
        assert bench.written() == []


def test_settings_read_as_they_were_written() -> None:
    with Bench(profile="kst-ext") as bench:
        servo = bench.servo()
        servo.set_reversed(True)
        assert servo.reversed() is True
        with pytest.raises(VerificationFailed) as raised:
            servo.write(negative_limit=-0.5, positive_limit=0.25)
        assert "set_reversed(False) first" in raised.value.advice


def test_xqpower_needs_half_a_second_after_a_mid_point() -> None:
    with Bench(profile="xqpower", position=600) as bench:
        start = bench.link.now()
        assert bench.servo().set_mid_point() == 0.0
        assert bench.link.now() - start >= 0.5
        assert bench.written()[0] == "2209300001000000"


def set_limit(servo: Servo) -> None:
    servo.write(negative_limit=radians(-50))


def test_write_is_repeated_until_it_reads_back() -> None:
    reads = [OLD, OLD, OLD, NEW]
    with Bench(profile="kst-ext", line=Answers({READ: reads, LIMIT: ACK})) as bench:
        set_limit(bench.servo())
        assert bench.written() == [LIMIT[4:]] * 3 + [SAVE]
    with Bench(profile="kst-ext", line=Answers({READ: OLD, LIMIT: ACK})) as bench:
        with pytest.raises(VerificationFailed, match="reads back -1000, not -500"):
            set_limit(bench.servo())
        assert bench.written() == [LIMIT[4:]] * 3


def test_setting_undone_by_the_save_is_an_error() -> None:
    with Bench(profile="kst-ext", line=Answers({READ: [OLD, NEW, NEW, OLD], LIMIT: ACK})) as bench:
        with pytest.raises(VerificationFailed):
            set_limit(bench.servo())
        assert bench.written() == [LIMIT[4:], SAVE]


def test_write_that_cannot_be_read_back_is_saved_by_the_next_call() -> None:
    """Three times silence is one failed read: a request is repeated twice."""
    line = Answers({READ: [OLD, "", "", "", NEW], LIMIT: ACK})
    with Bench(profile="kst-ext", line=line) as bench:
        servo = bench.servo()
        with pytest.raises(OutcomeUnknown, match="negative_limit"):
            set_limit(servo)
        assert bench.written() == [LIMIT[4:]]
        set_limit(servo)
        assert bench.written() == [SAVE]
