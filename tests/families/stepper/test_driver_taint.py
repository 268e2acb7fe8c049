"""Through the whole bus: a reply that is late, echoed, of another command or damaged is never a value.

And EE DD, whenever it comes, reaches who listens and casts no doubt on anybody.
"""

from __future__ import annotations

from itertools import product
from random import Random

import pytest

from motorbus.core.operation import Listen, Notice, Operation
from motorbus.errors import MotorbusError
from tests.families.stepper.bench import Bench, Tampering, bench
from tests.families.stepper.vectors import DUMP_A

NOTICE = b"\xee\xdd"
ACTIVE = (2, 5)
"""Inputs that are active, so that an answer about another one shows."""


def asked(there: Bench, port: int) -> bool | None:
    """The level that is told, None for an error; a wrong level fails the test."""
    try:
        told = there.device.read_input(port)
    except MotorbusError:
        return None
    assert told is (port in ACTIVE), port
    return told


def with_inputs(there: Bench) -> Bench:
    for port in ACTIVE:
        there.simulated.set_input(port, True)
    return there


@pytest.mark.parametrize("late", [0.01, 0.19, 0.25, 0.3, 0.5, 0.9, 2.0])
@pytest.mark.parametrize("every", [1, 2, 3])
def test_a_late_reply_is_never_taken_for_the_next(late: float, every: int) -> None:
    with bench(reply_fault="late", fault_time=late, fault_every=every) as there:
        with_inputs(there)
        for port in (1, 2, 3, 2, 5, 4, 5, 1):
            asked(there, port)


@pytest.mark.parametrize("fault", ["lost", "bit", "other", "split", "noise"])
@pytest.mark.parametrize("every", [1, 2, 3])
def test_no_fault_makes_a_value(fault: str, every: int) -> None:
    with bench(reply_fault=fault, fault_every=every, fault_time=0.02) as there:
        with_inputs(there)
        told = [asked_unless_flipped(there, port, fault) for port in (1, 2, 3, 2, 5, 4, 5, 1)]
    assert every == 1 or any(level is not None for level in told)


def asked_unless_flipped(there: Bench, port: int, fault: str) -> bool | None:
    """A bit of the level itself is the one thing that nobody can tell: there is no checksum."""
    if fault != "bit":
        return asked(there, port)
    try:
        return bool(there.device.read_input(port))
    except MotorbusError:
        return None


class Changing(Tampering):
    """One bit of one byte of every reply, and which."""

    def __init__(self) -> None:
        super().__init__()
        self.at = self.bit = 0

    def change(self, data: bytes, number: int) -> bytes:
        return data[: self.at] + bytes((data[self.at] ^ 1 << self.bit,)) + data[self.at + 1 :]


def test_a_bit_wrong_in_what_a_reply_answers_is_no_value() -> None:
    line = Changing()
    for line.at, line.bit in product(range(5), range(8)):
        with bench(line=line) as there, pytest.raises(MotorbusError):
            there.device.read_input(2)


@pytest.mark.parametrize("echo", [True, False])
def test_an_echo_is_found_out_and_taken_off(echo: bool) -> None:
    with bench(echo=echo) as there:
        test = there.bus.family.echo_test()
        assert test is not None
        there.bus.turns.expect_echo(test)
        assert there.run(test) == DUMP_A
        assert there.bus.turns.echo.present is echo
        with_inputs(there)
        assert [asked(there, port) for port in range(1, 6)] == [port in ACTIVE for port in range(1, 6)]
        assert there.device.stop()
        assert there.device.dump(1) == DUMP_A


def test_a_line_that_only_echoes_is_no_controller() -> None:
    with bench(echo=True) as there:
        there.simulated.unplug()
        test = there.bus.family.echo_test()
        assert test is not None
        there.bus.turns.expect_echo(test)
        with pytest.raises(MotorbusError):
            there.run(test)
        assert there.device.ping() is False
        for verb in (there.device.stop, lambda: there.device.read_input(1), there.device.dump):
            with pytest.raises(MotorbusError):
                verb()


class Noticing(Tampering):
    """EE DD before everything that the device says, and behind it."""

    def change(self, data: bytes, number: int) -> bytes:
        return NOTICE + data + NOTICE


def test_a_notice_at_any_moment_reaches_who_listens_and_taints_nobody() -> None:
    with bench(line=Noticing()) as there:
        with_inputs(there)
        heard = there.bus.notices.subscribe()
        assert [asked(there, port) for port in range(1, 6)] == [port in ACTIVE for port in range(1, 6)]
        assert there.device.dump(1) == DUMP_A
        assert len(there.sent()) == 5 + 2, "nothing had to be asked again"
        assert [one._replace(at=0.0) for one in heard] == [Notice(1, "completed", NOTICE)] * 14
        assert there.bus.statistics.nodes[1].errors == {}


def test_the_end_of_a_project_is_heard_while_one_listens() -> None:
    def waited() -> Operation[Notice | None]:
        return (yield from Listen(lambda notice: notice.kind == "completed", 10.0))

    with bench(notice_on_in3=True) as there:
        assert there.device.ping()
        there.simulated.set_input(3, True)
        begun = there.link.now()
        assert there.run(waited()) == Notice(1, "completed", NOTICE, there.link.now())
        assert there.link.now() - begun == pytest.approx(1.6876, abs=0.01)  # a turn, then a second


def test_thousands_of_damaged_exchanges_tell_nothing_false() -> None:
    """Every byte of what a reply answers, at random, lost pieces and doubled ones; nothing hangs and nothing lies."""

    class Rough(Tampering):
        random = Random(5)

        def change(self, data: bytes, number: int) -> bytes:
            kind = self.random.randrange(8)
            if kind == 0:
                return b""
            if kind == 1:
                at = self.random.randrange(min(5, len(data)))
                return data[:at] + bytes((self.random.randrange(256),)) + data[at + 1 :]
            if kind == 2:
                return data[: self.random.randrange(len(data))]
            return data + data if kind == 3 else data

    right = 0
    with bench(line=Rough()) as there:
        with_inputs(there)
        ports = Random(7)
        for _ in range(2000):
            right += asked(there, ports.randrange(1, 6)) is not None
    assert right > 1000
