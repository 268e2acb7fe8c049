"""Taking off exactly what was sent, and noticing when it does not come."""

from __future__ import annotations

import pytest

from motorbus.bus.echo import Echo

REQUEST = b"\xff\xff\x01\x04\x02\x05\x03\xf0"
ANSWER = b"\xff\xff\x01\x05\x00\x01\x02\x03\xf3"


def echoing() -> Echo:
    echo = Echo()
    echo.present = True
    return echo


@pytest.mark.parametrize("cut", range(len(REQUEST) + len(ANSWER)))
def test_an_echo_is_taken_off_wherever_it_is_cut(cut: int) -> None:
    echo = echoing()
    echo.sent(REQUEST, testing=False)
    stream = REQUEST + ANSWER
    assert echo.strip(stream[:cut]) + echo.strip(stream[cut:]) == ANSWER
    assert not echo.broken


def test_several_requests_are_taken_off_in_order() -> None:
    echo = echoing()
    echo.sent(REQUEST, testing=False)
    echo.sent(ANSWER, testing=False)
    assert echo.strip(REQUEST + ANSWER + b"\x01") == b"\x01"


@pytest.mark.parametrize("cut", range(1, len(ANSWER)))
def test_without_echo_a_test_gives_every_byte_back(cut: int) -> None:
    echo = Echo()
    echo.sent(REQUEST, testing=True)
    assert echo.strip(ANSWER[:cut]) + echo.strip(ANSWER[cut:]) + echo.give_up() == ANSWER
    assert echo.present is None
    echo.excluded()
    assert echo.present is False


def test_a_test_finds_the_echo() -> None:
    echo = Echo()
    echo.sent(REQUEST, testing=True)
    assert echo.strip(REQUEST[:3]) == b""
    assert echo.present is None
    assert echo.strip(REQUEST[3:] + ANSWER) == ANSWER
    assert echo.present is True


def test_an_echo_that_does_not_come_is_broken_and_unknown() -> None:
    echo = echoing()
    echo.sent(REQUEST, testing=False)
    assert echo.strip(ANSWER) == ANSWER
    assert echo.broken
    assert echo.present is None


def test_where_echo_is_excluded_nothing_is_expected() -> None:
    echo = Echo()
    echo.excluded()
    echo.sent(REQUEST, testing=True)
    assert echo.strip(REQUEST) == REQUEST
