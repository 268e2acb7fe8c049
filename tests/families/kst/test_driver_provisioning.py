"""Provisioning: found out, written, saved, restarted, proved; and cut at every point, it goes on from there."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import inf
from typing import Any

import pytest

from motorbus.core.request import Data
from motorbus.core.steps import Progress
from motorbus.errors import NoReply, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.kst import PowerCycleNeeded, Provisioned
from motorbus.families.kst.driver.provisioning import provision
from motorbus.link.memory import MemoryLink
from tests.families.kst.bench import Bench, bench, node, play
from tests.families.kst.test_driver_scanning import Deaf
from tests.support.world import is_listening

SAVE = "605#2210100173617665"


def cycling(there: Bench, servo: int = 0) -> None:
    """Somebody who takes the supply away and gives it back when asked to."""

    def on(event: object) -> None:
        if isinstance(event, PowerCycleNeeded):
            there.simulator.servos[servo].power_cycle()

    there.on = on


WAYS = [{"new_id": 9}, {"new_rate": 250_000}, {"new_id": 9, "new_rate": 1_000_000}]


@pytest.mark.parametrize("wanted", WAYS, ids=str)
@pytest.mark.parametrize("pending", ["pending", "active"])
@pytest.mark.parametrize("profile", ["kst", "xqpower"])
def test_from_the_first_look_to_the_proof(wanted: dict[str, int], pending: str, profile: str) -> None:
    with bench(profile=profile, pending_id=pending) as there:
        cycling(there)
        done = there.servo().provision(**wanted)
        there.on = lambda event: None
        node, rate = wanted.get("new_id", 5), wanted.get("new_rate", 500_000)
        assert done == Provisioned(node, rate, "1.00", False)
        assert (there.simulator.servos[0].node, there.simulator.servos[0].bit_rate) == (node, rate)
        assert there.of(PowerCycleNeeded) == [PowerCycleNeeded(5, node, rate)]
        assert [event.done for event in there.of(Progress)] == [0, 1, 2, 3, 4]
        assert (there.bus.rate, there.link.rate, is_listening(there.bus)) == (500_000, 500_000, False)
        there.sent()
        assert there.servo().provision(**wanted) == done._replace(resumed=True)
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}, "nothing is written again"


class Gone(Exception):
    """The program was killed."""


def killed_at(done: int) -> Callable[[Any], None]:
    def on(event: object) -> None:
        if isinstance(event, Progress) and event.done == done:
            raise Gone

    return on


@pytest.mark.parametrize("wanted", WAYS, ids=str)
@pytest.mark.parametrize("cut", [False, True], ids=["power stays", "power goes"])
@pytest.mark.parametrize("done", [0, 1, 2, 3, 4])
def test_killed_at_any_point_it_goes_on_from_where_things_stand(
    wanted: dict[str, int], cut: bool, done: int
) -> None:
    with bench() as there:
        cycle = killed_at(done)
        there.on = lambda event: (
            there.simulator.servos[0].power_cycle() if isinstance(event, PowerCycleNeeded) else cycle(event)
        )
        with pytest.raises(Gone):
            there.servo().provision(**wanted)
        assert there.bus.rate == 500_000
        if cut:
            there.simulator.servos[0].power_cycle()
        cycling(there)
        result = there.servo().provision(**wanted)
        assert (result.node, result.rate) == (wanted.get("new_id", 5), wanted.get("new_rate", 500_000))
        there.simulator.servos[0].power_cycle()
        there.on = lambda event: None
        assert there.servo().provision(**wanted).resumed is True


class Timed(MemoryLink):
    """Lets something happen at a moment."""

    when = inf
    then: Callable[[], None]

    def read(self, until: float) -> list[Data]:
        if self.now() >= self.when:
            self.when = inf
            self.then()
        return super().read(until)


@pytest.mark.parametrize("wanted", WAYS, ids=str)
@pytest.mark.parametrize("pending", ["pending", "active"])
def test_d11_power_that_goes_during_the_save_is_told_and_never_called_saved(
    wanted: dict[str, int], pending: str
) -> None:
    with bench(flash_time=2.0, pending_id=pending, link=Timed) as there:
        servo, link = there.simulator.servos[0], there.link
        assert isinstance(link, Timed)
        link.then = servo.plug
        gone: list[bool] = []

        def on(event: object) -> None:
            if isinstance(event, PowerCycleNeeded):  # this flash is slower than anybody knew
                servo.unplug()
                gone.append(not servo.plugged)
                link.when = link.now() + 1.0
            assert not isinstance(event, Progress) or event.done <= 2, "it was called saved"

        there.on = on
        with pytest.raises(VerificationFailed, match="came back as it was") as raised:
            there.servo().provision(**wanted)
        assert "call provision again" in raised.value.advice
        assert (servo.node, servo.bit_rate) == (5, 500_000)
        assert any(gone)


def test_an_id_that_is_forgotten_by_a_short_power_cycle_is_noticed() -> None:
    with bench(flash_time=2.0) as there:
        cycling(there)
        with pytest.raises(VerificationFailed, match="came back as it was"):
            there.servo().provision(new_id=9)


def test_an_id_that_is_taken_is_refused_before_anything_is_written() -> None:
    with bench(ids=(5, 9)) as there:
        with pytest.raises(RequestError, match=r"0x09 \(9\) is taken"):
            there.servo().provision(new_id=9)
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}


@pytest.mark.parametrize("delay", [0.0, 0.0003])
def test_d2_two_servos_with_one_id_are_refused_before_anything_is_written(delay: float) -> None:
    with bench(ids=(5,), duplicate="5", duplicate_delay=delay) as there:
        there.simulator.servos[-1].raw_position = 7
        with pytest.raises(RequestError, match=r"two servos answer as 0x05 \(5\)"):
            there.servo().provision(new_id=9)
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}


def test_nobody_there() -> None:
    with bench() as there:
        with pytest.raises(NoReply, match="0x06 \\(6\\) or 0x09 \\(9\\)"):
            there.servo(6).provision(new_id=9, new_rate=250_000)
        assert there.bus.rate == 500_000
        assert there.servo().ping() is True


def test_d12_a_bus_in_use_at_the_old_rate_is_not_spoken_to_at_the_new_one() -> None:
    with bench(ids=(5, 6), profile="kst-ext") as there:
        there.servo(6).start_reports(0.02)
        there.sent()
        with pytest.raises(RequestError, match="nothing is sent at 250000"):
            there.servo(7).provision(new_rate=250_000)
        assert there.sim(6).errors == 0
        assert there.bus.rate == 500_000


def test_what_it_asks_for_says_all_that_a_person_needs() -> None:
    with bench() as there:
        with pytest.raises(OutcomeUnknown) as raised:
            there.servo().provision(new_id=9, timeout=1.0)
        (needed,) = there.of(PowerCycleNeeded)
        assert needed == PowerCycleNeeded(5, 9, 500_000)
        assert SAVE in there.sent()
        assert raised.value.node == 5


class Interrupting(MemoryLink):
    """Ctrl-C at one call of `read`."""

    countdown = 0

    def read(self, until: float) -> list[Data]:
        self.countdown -= 1
        if not self.countdown:
            raise KeyboardInterrupt
        return super().read(until)


@pytest.mark.parametrize("wanted", WAYS[1:], ids=str)
def test_interrupted_at_any_moment_the_rate_of_the_bus_is_set_again(wanted: dict[str, int]) -> None:
    for countdown in range(1, 400, 7):
        with bench(link=Interrupting) as there:
            cycling(there)
            link = there.link
            assert isinstance(link, Interrupting)
            link.countdown = countdown
            with suppress(KeyboardInterrupt):
                there.servo().provision(**wanted)
            assert (there.bus.rate, link.rate, link.listen_only) == (500_000, 500_000, False), countdown
            link.countdown = 0
            assert there.servo().provision(**wanted).rate == wanted["new_rate"]


def test_an_adapter_that_cannot_listen_provisions_all_the_same() -> None:
    with bench(link=Deaf) as there:
        cycling(there)
        assert there.servo().provision(new_rate=250_000).rate == 250_000
        assert there.servo().provision(new_rate=250_000).resumed is True


def test_with_29_bit_identifiers() -> None:
    with bench(settings={"id_format": "ext"}, id_format="ext") as there:
        cycling(there)
        assert there.servo().provision(new_id=9).node == 9


# --- other servos on the bus ---------------------------------------------------------------------------------


def joining(there: Bench, *, restarts: bool) -> None:
    """Somebody plugs in the second servo when asked for a power cycle, of which the first one may take part."""
    second = there.simulator.servos[1]
    second.unplug()

    def on(event: object) -> None:
        if isinstance(event, PowerCycleNeeded):
            second.plug()
            if restarts:
                there.simulator.servos[0].power_cycle()

    there.on = on


def test_another_servo_with_the_new_id_is_not_taken_for_the_one_that_has_not_restarted() -> None:
    with bench(ids=(5, 9)) as there:
        joining(there, restarts=False)
        with pytest.raises(OutcomeUnknown, match="did not come back"):
            there.servo().provision(new_id=9, timeout=2.0)


@pytest.mark.parametrize("turned", [0, 77])
def test_two_servos_that_have_the_new_id_after_the_restart_are_told(turned: int) -> None:
    delay = 0.0 if turned else 0.0003
    with bench(ids=(5, 9)) as there:
        joining(there, restarts=True)
        there.simulator.servos[1].delay = delay
        there.simulator.servos[1].raw_position = turned
        with pytest.raises(VerificationFailed, match=r"two servos answer as 0x09 \(9\)"):
            there.servo().provision(new_id=9)


def test_a_servo_that_has_the_old_id_after_the_restart_is_told() -> None:
    with bench(ids=(5, 5), link=Timed) as there:
        first, second = there.simulator.servos
        second.unplug()
        link = there.link
        assert isinstance(link, Timed)

        def both() -> None:
            first.plug()
            second.plug()

        def on(event: object) -> None:
            if isinstance(event, PowerCycleNeeded):
                first.unplug()
                link.then, link.when = both, link.now() + 1.0

        there.on = on
        with pytest.raises(OutcomeUnknown, match="which of them") as raised:
            there.servo().provision(new_id=9)
        assert "take one of them off the bus" in raised.value.advice
        second.unplug()
        assert there.servo().provision(new_id=9) == Provisioned(9, 500_000, "1.00", True)


def test_an_id_that_was_written_before_is_not_saved_by_mistake() -> None:
    with bench() as there:
        there.servo().set_node_id(7)
        cycling(there)
        assert there.servo().provision(new_rate=250_000).node == 5
        assert there.simulator.servos[0].node == 5


def test_a_silence_without_a_restart_is_no_restart() -> None:
    with bench(link=Timed) as there:
        servo, link = there.simulator.servos[0], there.link
        assert isinstance(link, Timed)

        def on(event: object) -> None:
            if isinstance(event, PowerCycleNeeded):  # a loose cable, and its supply is another one
                servo.plugged = False
                link.then, link.when = lambda: setattr(servo, "plugged", True), link.now() + 1.0

        there.on = on
        with pytest.raises(OutcomeUnknown, match="did not come back"):
            there.servo().provision(new_id=9, timeout=3.0)
        servo.power_cycle()
        assert there.servo().provision(new_id=9).resumed is True


@pytest.mark.parametrize("timeout", [0, -1.0, float("nan"), float("inf"), "120s", True])
def test_nobody_waits_for_ever(timeout: Any) -> None:
    with pytest.raises(RequestError, match="timeout"):
        play(provision(node(), new_id=9, timeout=timeout))


def test_the_rate_of_one_among_others_is_not_changed() -> None:
    with bench(ids=(5, 6, 9)) as there:
        with pytest.raises(RequestError, match=r"not alone: 0x06 \(6\), 0x09 \(9\) would stay at 500000"):
            there.servo().provision(new_rate=250_000)
        assert {frame.partition("#")[2][:2] for frame in there.sent()} == {"40"}


def test_while_it_is_waited_for_nobody_at_another_rate_is_disturbed() -> None:
    with bench(ids=(5, 6), profile="kst-ext", broadcast_read=False) as there:
        there.servo(6).start_reports(0.02)
        there.on = lambda event: (
            there.simulator.servos[0].unplug() if isinstance(event, PowerCycleNeeded) else None
        )
        with pytest.raises(OutcomeUnknown):
            there.servo().provision(new_rate=250_000, timeout=5.0)
        assert there.sim(6).errors == 0
        assert (there.bus.rate, is_listening(there.bus)) == (500_000, False)
