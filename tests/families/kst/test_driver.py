"""The driver as a whole: every profile against the simulator, and what must never be sent."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from motorbus.errors import LimitExceeded, LinkLost, NoReply, RequestError
from motorbus.families.kst import Servo
from tests.families.kst.bench import bench

IMPOSSIBLE: dict[str, Callable[[Servo], object]] = {
    "id 0": lambda servo: servo.set_node_id(0),
    "id 128": lambda servo: servo.set_node_id(128),
    "id True": lambda servo: servo.set_node_id(True),
    "a rate": lambda servo: servo.set_bit_rate(123_456),
    "a code for a rate": lambda servo: servo.set_bit_rate(5),
    "200°": lambda servo: servo.move(math.radians(200)),
    "NaN": lambda servo: servo.move(math.nan),
    "infinity": lambda servo: servo.move(-math.inf),
    "a word": lambda servo: servo.move("90deg"),  # type: ignore[arg-type]
    "no tolerance": lambda servo: servo.move(0.1, tolerance=0),
    "no time": lambda servo: servo.move(0.1, timeout=math.nan),
    "unknown object": lambda servo: servo.read("no_such_object"),
    "write-only object": lambda servo: servo.read("bit_rate_code"),
    "write to read-only": lambda servo: servo.write(present_position=0.0),
    "provision nothing": lambda servo: servo.provision(),
    "provision to 0": lambda servo: servo.provision(new_id=0),
    "provision to a rate": lambda servo: servo.provision(new_rate=1),
    "goal by name": lambda servo: servo.write(goal_position=2.0),
    "current": lambda servo: servo.current(),
    "temperature": lambda servo: servo.temperature(),
    "reports": lambda servo: servo.start_reports(),
    "no reports": lambda servo: servo.stop_reports(),
    "mid point": lambda servo: servo.set_mid_point(),
    "limits": lambda servo: servo.travel_limits(),
    "set limits": lambda servo: servo.set_travel_limits(-1, 1),
    "reversed": lambda servo: servo.reversed(),
    "set reversed": lambda servo: servo.set_reversed(True),
}


@pytest.mark.parametrize("say", IMPOSSIBLE.values(), ids=IMPOSSIBLE.keys())
def test_the_impossible_is_refused_and_nothing_is_sent(say: Callable[[Servo], object]) -> None:
    with bench() as there:
        servo = there.servo()
        with pytest.raises((RequestError, LimitExceeded)) as raised:
            say(servo)
        assert there.sent() == []
        assert len(str(raised.value).splitlines()) > 1, "one line says what, others why and what to do"


@pytest.mark.parametrize("number", [0, 128, -1, True, 5.0, "5"])
def test_only_ids_of_one_servo_make_a_servo(number: Any) -> None:
    with bench() as there:
        with pytest.raises(RequestError, match="is not the id of a servo"):
            there.servo(number)
        assert there.sent() == []


def test_what_a_profile_lacks_names_those_that_have_it() -> None:
    with bench() as there, pytest.raises(RequestError, match="kst-ext or kingmax") as raised:
        there.servo().travel_limits()
    assert "profile=kst-ext" in raised.value.advice
    with bench(profile="xqpower") as there, pytest.raises(RequestError, match="no reverse bit"):
        there.servo().reversed()


def test_there_is_no_verb_for_a_torque_switch() -> None:
    assert not hasattr(Servo, "enable_torque")
    assert not hasattr(Servo, "disable_torque")


def test_at_a_wrong_bit_rate_nobody_answers() -> None:
    with bench(rate=250_000) as there, pytest.raises(NoReply):
        there.servo().position()


def test_an_adapter_that_is_unplugged_under_way_is_lost_at_once() -> None:
    with bench() as there:
        servo = there.servo()
        servo.position()
        there.link.unplug(there.link.now() + 0.00005)
        with pytest.raises(LinkLost):
            servo.position()


def test_reports_on_the_reply_id_disturb_no_read() -> None:
    with bench(profile="kst-ext", reports_ms=2) as there:
        servo = there.servo()
        there.sim().raw_position = 0x60  # a report that begins like an acknowledgement
        for _ in range(500):
            assert servo.read_raw("present_position") == {"present_position": 0x60}
            there.link.advance(0.0003)
        assert there.bus.statistics.other["notices"] > 50
        assert there.bus.statistics.of(5).retries == 0


def test_reports_and_how_they_are_ended() -> None:
    with bench(profile="kst-ext") as there:
        servo = there.servo()
        servo.start_reports(0.01)
        heard = there.bus.notices.subscribe()
        there.link.advance(0.1)
        assert servo.ping()
        assert 9 <= len([notice for notice in heard if notice.kind == "report"]) <= 11
        servo.stop_reports()
        there.link.advance(0.1)
        assert servo.ping()
        assert there.sent()[-2:] == ["005#0200", "605#4000300000000000"]


@pytest.mark.parametrize("form", ["vendor", "standard"])
def test_the_form_of_start_can_be_chosen(form: str) -> None:
    with bench(profile="kst-ext", settings={"nmt": form}, nmt=form) as there:
        there.servo().start_reports()
        assert there.sent() == [{"vendor": "005#0100", "standard": "000#0105"}[form]]
    with bench(profile="kst-ext", settings={"nmt": "none"}) as there:
        for say in (there.servo().start_reports, there.servo().stop_reports):
            with pytest.raises(RequestError, match="no form of start"):
                say()
        assert there.sent() == []
