"""Why an exchange failed, in the right class and in words."""

from __future__ import annotations

import pytest

from motorbus.bus import verdict
from motorbus.bus.ticket import Flight
from motorbus.core.operation import Answer, CanFrame, Due, Effect, Exchange, Reply
from motorbus.errors import ChecksumError, FramingError, NoReply, OutcomeUnknown, UnexpectedReply
from tests.bus.script import position, reply


@pytest.mark.parametrize(
    ("kind", "error"),
    [
        ("silence", NoReply),
        ("checksum", ChecksumError),
        ("framing", FramingError),
        ("surplus", UnexpectedReply),
        ("echo", UnexpectedReply),
        ("unexpected", UnexpectedReply),
        ("early", UnexpectedReply),
    ],
)
def test_every_fault_has_its_class_cause_and_advice(kind: str, error: type[Exception]) -> None:
    found = verdict.error(Flight(position(3)), kind, 1)
    assert type(found) is error
    assert found.node == 3
    assert found.cause
    assert found.advice
    assert set(verdict.CAUSES) == set(verdict.ERRORS)


def test_the_fault_of_a_try_is_the_worst_thing_seen() -> None:
    flight = Flight(position(3))
    assert verdict.fault(flight) == "silence"
    flight.noise.append(("framing", b"\x01"))
    assert verdict.fault(flight) == "framing"
    flight.noise.append(("checksum", b"\x02"))
    assert verdict.fault(flight) == "checksum"
    flight.surplus = True
    assert verdict.fault(flight) == "surplus"
    flight.spoiled = "echo"
    assert verdict.fault(flight) == "echo"


def test_a_write_that_was_not_confirmed_is_unknown_and_shows_what_came() -> None:
    write: Exchange[Answer] = Exchange(
        b"\x01\x02", (Due(3, 3, 6),), effect=Effect.PERSISTENT, repeatable=True
    )
    flight = Flight(write)
    assert isinstance(verdict.error(flight, "silence", 1), NoReply), "it never left"
    flight.left = True
    flight.take(Reply(0, 3, reply(3)[:6]))
    found = verdict.error(flight, "surplus", 2)
    assert isinstance(found, OutcomeUnknown)
    assert "(2 tries)" in str(found)
    assert "received: FF FF 03" in str(found)


def test_things_are_called_what_they_are_called_on_the_bus() -> None:
    serial = verdict.error(Flight(position(3)), "silence", 1)
    can: Exchange[Answer] = Exchange(CanFrame(0x603, bytes(8)), (Due(3, 3, 8),), repeatable=True)
    frames = verdict.error(Flight(can), "silence", 1)
    assert "baud rate" in serial.cause
    assert "--baud all" in serial.advice
    assert "another bit rate" in frames.cause
    assert "terminating resistors" in frames.cause
    assert "--bitrate all" in frames.advice


def test_what_the_adapter_says_is_the_cause() -> None:
    found = verdict.error(Flight(position(3)), "silence", 1, "the adapter refused 3 frames")
    assert found.cause == "the adapter refused 3 frames"
