"""What is made of what is heard at a rate, without a memory and with one."""

from __future__ import annotations

import pytest

from motorbus.core.operation import Operation, Tune, afterwards
from motorbus.errors import RequestError
from motorbus.families.kst import Heard, dialect_of
from motorbus.families.kst.driver import PLAIN
from motorbus.families.kst.driver.listening import heard
from tests.families.kst.bench import Bench, bench


def listened(there: Bench, rate: int, *, memory: bool = True) -> Operation[Heard]:
    dialect = dialect_of(there.family) if memory else PLAIN
    return afterwards(heard(dialect, rate, 0.25), lambda: iter(Tune(500_000)))


@pytest.mark.parametrize("memory", [True, False])
def test_traffic_errors_silence(memory: bool) -> None:
    with bench(reports_ms=100, profile="kst-ext") as there:
        assert there.run(listened(there, 500_000, memory=memory)) is Heard.TRAFFIC
        assert there.run(listened(there, 250_000, memory=memory)) is Heard.ERRORS
        there.sim().unplug()
        assert there.run(listened(there, 250_000, memory=memory)) is Heard.SILENCE
        assert there.sent() == []


def test_nothing_can_be_sent_while_listening() -> None:
    def speaking(there: Bench) -> Operation[object]:
        yield from heard(PLAIN, 500_000, 0.01)
        return (yield from there.family.identify(5))

    with bench() as there:
        with pytest.raises(RequestError, match="only listens"):
            there.run(afterwards(speaking(there), lambda: iter(Tune(500_000))))
        assert there.servo().ping() is True
