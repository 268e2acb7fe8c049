"""The judge says no where it must, and every error of the package says one thing of what was asked for."""

from __future__ import annotations

import pkgutil
from importlib import import_module

import pytest

import motorbus
from motorbus.bus.pump import Bus
from motorbus.errors import (
    DeviceError,
    LinkLost,
    MotorbusError,
    NoReply,
    OutcomeUnknown,
    Refused,
    RequestError,
    Stalled,
    VerificationFailed,
)
from motorbus.families.feetech import FAMILY
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety import Gate
from tests.support.history import History
from tests.support.oracle import SAYS, FalseWord, Oracle, Outcome, outcome


class Bench:
    """A servo whose acceleration is written as a test likes, and its judge."""

    def __init__(self) -> None:
        self.simulator = FAMILY.simulator((1,))
        self.history = History(self.simulator)
        self.link = MemoryLink(self.history)
        self.bus = Bus(self.link, FAMILY, interlock=Gate())
        self.oracle = Oracle(self.link, self.history)

    def put(self, raw: int) -> None:
        """The servo holds this from now on."""
        self.link.advance(0.001)
        self.simulator.nodes[1].memory["acceleration"] = raw  # type: ignore[index]
        self.history.look(self.link.now())
        self.link.advance(0.001)


def everything(kind: type[MotorbusError]) -> set[type[MotorbusError]]:
    """This kind of error and all that are made of it."""
    return {kind}.union(*(everything(one) for one in kind.__subclasses__()))


def test_every_error_says_exactly_one_thing() -> None:
    for found in pkgutil.walk_packages(motorbus.__path__, "motorbus."):
        if not found.name.endswith("__main__"):
            import_module(found.name)
    ours = {kind for kind in everything(MotorbusError) if kind.__module__.startswith("motorbus.")}
    verbs = {kind for kind in ours if not kind.__module__.startswith("motorbus.cli.")}
    assert len(verbs) > 20
    for kind in verbs - {MotorbusError}:
        assert [says for base, says in SAYS if issubclass(kind, base)], kind
    assert outcome(RequestError("")) is outcome(Refused("")) is Outcome.NOT_SENT
    assert outcome(DeviceError("")) is Outcome.REJECTED
    assert outcome(NoReply("")) is Outcome.UNREAD
    for kind in (OutcomeUnknown, LinkLost, Stalled, VerificationFailed):
        assert outcome(kind("")) is Outcome.UNKNOWN
    with pytest.raises(AssertionError, match="does not say"):
        outcome(MotorbusError(""))


def test_a_success_must_have_been_applied_within_the_call() -> None:
    bench = Bench()
    with bench.oracle.call() as window:
        bench.put(7)
    bench.oracle.wrote(window, 1, "acceleration", 7)
    with bench.oracle.call() as window:
        pass
    bench.put(8)
    with pytest.raises(FalseWord, match="succeeded, and it was"):
        bench.oracle.wrote(window, 1, "acceleration", 8)


@pytest.mark.parametrize("error", [RequestError("r"), DeviceError("d"), NoReply("n")])
def test_what_is_said_not_to_be_applied_must_not_be_then_or_later(error: MotorbusError) -> None:
    bench = Bench()
    with bench.oracle.call() as window:
        bench.put(7)
        raise error
    with pytest.raises(FalseWord, match="failed, by its error"):
        bench.oracle.wrote(window, 1, "acceleration", 7)
    with bench.oracle.call() as window:
        raise error
    bench.oracle.wrote(window, 1, "acceleration", 9)
    bench.put(9)
    with pytest.raises(FalseWord, match="was said not to be written"):
        bench.oracle.follow(1, "acceleration")


@pytest.mark.parametrize("applied", [True, False])
def test_an_unknown_outcome_may_be_either(applied: bool) -> None:
    bench = Bench()
    with bench.oracle.call() as window:
        if applied:
            bench.put(7)
        raise OutcomeUnknown("o")
    bench.oracle.wrote(window, 1, "acceleration", 7)
    bench.put(7)
    bench.oracle.follow(1, "acceleration")
    assert bench.oracle.failed[Outcome.UNKNOWN] == 1


def test_a_call_that_takes_too_long_hangs() -> None:
    bench = Bench()
    with pytest.raises(FalseWord, match="at most 0.500 s were due"), bench.oracle.call(at_most=0.5):
        bench.link.advance(1.0)
    assert bench.oracle.longest >= 1.0


def test_any_other_error_is_nobodys_to_judge() -> None:
    bench = Bench()
    with pytest.raises(ZeroDivisionError), bench.oracle.call():
        raise ZeroDivisionError
