"""Row L15: the wall clock is set, or the computer sleeps for a night. Nothing expires too early, or too late.

The clock on the wall is asked for what people read: a stamp in a file. All waiting goes by the clock of the link, which
nobody can set. After a freeze a lease is lost, what moved is stopped first, and nothing moves again by itself.
"""

from __future__ import annotations

import ast
import datetime
import re
import time
from contextlib import suppress
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest

import motorbus
from motorbus.core.operation import Data, Pause
from motorbus.errors import MotorbusError, Refused
from motorbus.link.memory import MemoryLink
from motorbus.motion.safety.lease import Lease
from motorbus.session.robot import Robot
from tests.faults.scenes import IDS, KINDS, Scene, off
from tests.support.machines import machine

PACKAGE = Path(motorbus.__file__).parent
WALL = {"time.time", "time.time_ns", "time.localtime", "time.gmtime", "time.ctime", "time.strftime"}
WALL |= {
    f"{name}.{call}" for name in ("datetime", "datetime.datetime") for call in ("now", "utcnow", "today")
}
STAMPS = {"bus/stop_socket.py", "journal.py", "cli/simulate.py", "cli/stepper/copies.py"}
"""Who may ask the wall clock: a stamp on a record, on a recording, on a copy, on a latched stop."""
DAY, NIGHT = 86_400.0, 8 * 3600.0


def asked_of_the_wall(file: Path) -> list[str]:
    """Where this file asks the wall clock, by whatever name it has imported it."""
    text = file.read_text(encoding="utf-8")
    if not re.search(r"\bdatetime\b|\btime\.|from time import", text):
        return []
    tree = ast.parse(text)
    called = [ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)]
    names = [
        f"{node.module}.{name.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "time"
        for name in node.names
    ]
    return [name for name in called + names if name in WALL]


def test_l15_nobody_waits_by_the_clock_on_the_wall() -> None:
    asking = {
        file.relative_to(PACKAGE).as_posix(): found
        for file in PACKAGE.rglob("*.py")
        if (found := asked_of_the_wall(file))
    }
    assert set(asking) == STAMPS


class Jumping:
    """A wall clock that is a day ahead and a day behind, by turns; `jumped` counts."""

    def __init__(self) -> None:
        self.jumped = 0
        self._by = cycle((DAY, -DAY, 0.0))
        self._real = time.time

    def __call__(self) -> float:
        by = next(self._by)
        self.jumped += by != 0.0
        return self._real() + by


@pytest.fixture
def jumping(monkeypatch: pytest.MonkeyPatch) -> Jumping:
    clock = Jumping()
    monkeypatch.setattr(time, "time", clock)
    return clock


@pytest.mark.parametrize("family", IDS)
def test_l15_a_wall_clock_that_jumps_by_a_day_changes_nothing(family: str, jumping: Jumping) -> None:
    """On the real clock of the system: reads, a pause, a lease and a stop."""
    there = Scene(family, virtual=False)
    lease = Lease(60.0)  # a day is longer, and nobody is held up for so long
    lease.take("somebody", there.link.now())
    for _ in range(20):
        before = time.time(), there.link.now()
        there.stir()
        assert there.true(there.bus.run(there.asked()))
        assert there.bus.run(iter(Pause(0.001))) >= before[1] + 0.001
        lease.beat("somebody", there.link.now())
        assert datetime.datetime.now(datetime.UTC)
    assert jumping.jumped, "it was never seen to jump"
    assert lease.losses == 0
    assert there.bus.statistics.of(there.ids[0]).retries == 0
    assert there.ids[0] in there.bus.estop().acknowledged
    there.bus.close()


def sleep(link: MemoryLink) -> None:
    """The computer sleeps for a night."""
    link.advance(NIGHT)


class Freezing(MemoryLink):
    """A link of a host that is frozen once, at its nth look at the line; what came in those hours is there then."""

    freeze_at = 0
    looks = 0
    frozen = False

    def read(self, until: float) -> list[Data]:
        self.looks += 1
        if self.looks == self.freeze_at:
            self.frozen = True
            self.advance(NIGHT)
        return super().read(until)


def after_the_night(there: Scene) -> list[str]:
    """What is wrong with the bus: its second read must be right, and a stop must be acknowledged."""
    with suppress(MotorbusError):
        there.bus.run(there.asked())
    there.stir()
    wrong = [] if there.true(there.bus.run(there.asked())) else ["the second read is wrong"]
    return wrong + (
        [] if there.ids[0] in there.bus.estop().acknowledged else ["the stop was not acknowledged"]
    )


def night(kind: str, look: int) -> tuple[bool, list[str]]:
    """Whether a transaction of this kind was frozen at this look; what was wrong with it, and with the bus then."""
    there = Scene(KINDS[kind].family, link=Freezing)
    KINDS[kind].prepare(there)
    link = there.link
    assert isinstance(link, Freezing)
    link.freeze_at = link.looks + look
    wrong: list[str] = []
    try:
        value = there.bus.run(KINDS[kind].act(there))
    except MotorbusError:
        pass
    else:
        if kind.endswith(
            "stop"
        ):  # it holds where it was seen before the night, and may have to go back there
            there.link.advance(60.0)
        wrong += [] if KINDS[kind].done(there, value) else [f"a value that is not true: {value!r}"]
    if link.frozen and there.link.now() < NIGHT:
        wrong.append("the night has not passed")
    return link.frozen, wrong + after_the_night(there)


@pytest.mark.parametrize("kind", KINDS)
def test_l15_a_night_at_any_look_at_the_line(kind: str) -> None:
    """What is asked across it is answered truly, or fails; what is asked after it is right."""
    look, frozen, nights = 0, True, 0
    while frozen and look < 40:
        look += 1
        frozen, wrong = night(kind, look)
        nights += frozen
        assert wrong == [], look
    assert nights


@pytest.mark.parametrize("family", IDS)
def test_l15_a_reply_that_came_before_the_night_is_not_called_late(family: str) -> None:
    there = Scene(family, link=Freezing)
    there.stir()
    link = there.link
    assert isinstance(link, Freezing)
    there.bus.run(there.asked())
    there.stir()
    link.freeze_at = link.looks + 2
    assert there.true(there.bus.run(there.asked()))
    assert link.frozen
    assert there.bus.statistics.of(there.ids[0]).retries == 0


@pytest.mark.parametrize("family", ["feetech", "kst"])
def test_l15_what_was_heard_before_the_night_is_as_old_as_it_is(family: str) -> None:
    """So nobody holds a motor, or lets one move, by where it was hours ago."""
    there = Scene(family, link=Freezing)
    link = there.link
    assert isinstance(link, Freezing)
    there.bus.run(there.asked())
    link.freeze_at = link.looks + 2
    there.bus.run(there.asked())
    assert link.frozen
    assert link.now() >= NIGHT
    assert there.devices[0].at < 1.0
    assert there.bus.turns.known.fresh(link.now())[there.ids[0]] is None


def test_l15_after_a_night_the_lease_is_lost_and_what_moved_is_stopped_and_stays_so() -> None:
    with machine(arm="1") as (made, sims), Robot.of(made) as robot:
        device = robot["a1"].device
        device.set_mode("velocity")
        device.enable_torque()
        bus = robot.buses["arm"]
        link: Any = bus.link

        def sleeps() -> None:
            with robot.attended(lasts=0.5) as hand:
                device.set_velocity(0.5)
                hand.beat()
                sleep(link)
                robot.positions()
                bus.run(iter(Pause(0.5)))  # type: ignore[attr-defined]
                assert not sims["arm"][1].status()["moving"]
                hand.beat()

        with pytest.raises(Refused) as caught:
            sleeps()
        assert caught.value.reason == "lease"
        sleep(link)
        robot.positions()
        assert not sims["arm"][1].status()["moving"]
        with pytest.raises(Refused):
            device.set_velocity(0.5)


@pytest.mark.parametrize("family", IDS)
def test_l15_the_millisecond_counter_of_a_host_that_wraps_changes_nothing(family: str) -> None:
    """2**32 ms are 49.7 days: before it, across it and after it everything is right, and a stop goes out."""
    wrap = 2**32 / 1000
    begin = wrap - 1.0
    there = Scene(family, start=begin)
    off(there)
    while there.link.now() < begin + 2.0:
        there.stir()
        assert there.true(there.bus.run(there.asked()))
        there.bus.run(iter(Pause(0.05)))
    assert begin < wrap < there.link.now()
    assert there.ids[0] in there.bus.estop().acknowledged
