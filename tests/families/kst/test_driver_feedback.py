"""What a servo feels; and the status of the manual, which nothing decodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from motorbus.core.operation import CanFrame, Exchange
from motorbus.errors import RequestError
from motorbus.families.kst import driver
from motorbus.families.kst.driver import Node, RawStatus, Status
from motorbus.families.kst.driver.feedback import SAME_FRAME, position_exchange
from tests.families.kst.bench import bench, node, play

POSITION = "605#4002600000000000"
STATUS = "605#4005600000000000"


def test_a_position_is_a_prepared_exchange() -> None:
    exchange = driver.position(node())
    assert isinstance(exchange, Exchange)
    assert exchange.tells_position
    assert play(exchange, (POSITION, "4b02600084030000")) == pytest.approx(1.5707963)


QUANTITIES: list[Callable[[Node], Any]] = [
    driver.position,
    driver.current,
    driver.temperature,
    driver.status,
    driver.raw_status,
]


def test_each_quantity_is_one_exchange_that_is_kept() -> None:
    one, other = node("kst-ext"), node("kst-ext", 6)
    first = [say(one) for say in QUANTITIES]
    assert [say(one) for say in QUANTITIES] == first, "made once"
    assert len(set(first)) == len(QUANTITIES), "and each of them is another"
    assert not {*first} & {say(other) for say in QUANTITIES}, "another node is asked by others"
    assert [(exchange.request.id, exchange.request.extended) for exchange in first] == [(0x605, False)] * 5


def test_what_is_kept_goes_when_the_id_format_is_another() -> None:
    one = node("kst-ext", id_format="auto")
    assert not isinstance(driver.position(one), Exchange), "it is asked first"
    for extended in (False, True, False):
        one.dialect.learn_format(5, extended)
        for say in QUANTITIES:
            request = say(one).request
            assert isinstance(request, CanFrame)
            assert (request.id, request.extended) == (0x605, extended)
            assert say(one) is say(one)


def test_what_is_kept_does_not_make_the_format_known() -> None:
    one = node(id_format="auto")
    assert position_exchange(one) is position_exchange(one)
    assert not isinstance(driver.position(one), Exchange)


def test_the_status_of_the_manual_is_two_raw_bytes_and_a_warning() -> None:
    exchange = driver.status(node())
    assert isinstance(exchange, Exchange)
    assert not exchange.tells_position
    assert play(exchange, (POSITION, "4b02600084030000")) == RawStatus(0x84, 3, SAME_FRAME)
    assert play(driver.status(node()), (POSITION, "4f02600084030000")) == RawStatus(0x84, 0)
    assert "may be returning the position" in SAME_FRAME
    with bench(status_6002="x1x2", x1=0x20, x2=1) as there:
        assert there.servo().status() == RawStatus(0x20, 1)


@pytest.mark.parametrize(("profile", "amperes"), [("kst-ext", 3.0), ("kingmax", 3.0), ("xqpower", 0.3)])
def test_newer_firmware_tells_current_and_temperature(profile: str, amperes: float) -> None:
    back = (STATUS, "430560002c01f600")
    status = play(driver.status(node(profile)), back)
    assert isinstance(status, Status)
    assert status.current == pytest.approx(amperes)
    assert status.temperature == -10.0
    assert play(driver.current(node(profile)), back) == pytest.approx(amperes)
    assert play(driver.temperature(node(profile)), back) == -10.0


def test_the_manual_s_status_can_be_asked_of_any_profile() -> None:
    assert play(driver.raw_status(node("kst-ext")), (POSITION, "4b02600001020000"))[:2] == (1, 2)


def test_a_sample_holds_what_the_profile_tells() -> None:
    state = play(driver.telemetry(node()), (POSITION, "4b02600084030000"))
    assert (state.current, state.temperature, state.moving, state.velocity) == (None, None, None, None)
    state = play(
        driver.telemetry(node("kst-ext")), (POSITION, "4b02600084030000"), (STATUS, "430560002c01f600")
    )
    assert state.position == pytest.approx(1.5707963)
    assert state.current == pytest.approx(3.0)
    assert state.temperature == -10.0
    assert state.at == pytest.approx(100.001), "when the position came"


def test_an_alarm_travels_beside_the_values_and_fades() -> None:
    with bench(profile="kst-ext") as there:
        servo = there.servo()
        assert servo.telemetry().alarm == ()
        there.sim().voltage = 5.0
        assert servo.telemetry().alarm == servo.alarm == ("low voltage",)
        there.link.advance(6.0)
        assert servo.telemetry().alarm == ()


def test_what_the_manual_does_not_have_is_refused_before_sending() -> None:
    for say in (driver.current, driver.temperature):
        with pytest.raises(RequestError, match="kst-ext or kingmax or xqpower|current and temperature"):
            say(node())
