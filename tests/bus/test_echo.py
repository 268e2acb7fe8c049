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


def test_what_comes_back_where_nothing_was_expected_is_told_once_it_is_whole() -> None:
    echo = Echo()
    echo.excluded()
    echo.sent(REQUEST, testing=False)
    assert echo.strip(REQUEST[:5]) == REQUEST[:5]
    assert not echo.returned
    assert echo.strip(REQUEST[5:] + ANSWER) == REQUEST[5:] + ANSWER
    assert echo.returned
    echo.strip(ANSWER)
    assert not echo.returned, "told once"


def test_an_echo_that_is_taken_off_is_none_that_returned() -> None:
    echo = echoing()
    echo.sent(REQUEST, testing=False)
    echo.strip(REQUEST + ANSWER)
    assert not echo.returned


def test_of_an_echo_that_is_due_the_beginning_is_not_enough() -> None:
    echo = echoing()
    echo.sent(REQUEST, testing=False)
    assert echo.strip(REQUEST[:6]) == b""
    assert echo.give_up() == REQUEST[:6]
    assert echo.broken
    assert echo.present is None


@pytest.mark.parametrize(("present", "may"), [(None, True), (False, False), (True, False)])
def test_a_reply_may_be_an_echo_only_while_nobody_knows(present: bool | None, may: bool) -> None:
    echo = Echo()
    assert not echo.disproved
    echo.present = present
    echo.sent(REQUEST, testing=False)
    assert echo.may_be(REQUEST[:6]) is may
    assert not echo.may_be(ANSWER)


def test_an_answer_that_comes_first_disproves_an_echo() -> None:
    echo = Echo()
    echo.sent(REQUEST, testing=False)
    echo.strip(ANSWER[:3])
    assert not echo.disproved, "so far an echo begins in the same way"
    echo.strip(ANSWER[3:])
    assert echo.disproved
    echo.sent(REQUEST, testing=False)
    assert not echo.disproved
