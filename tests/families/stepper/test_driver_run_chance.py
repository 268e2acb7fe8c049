"""Any project on any controller with any fault: never falsely completed, and completed whenever that was told."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorbus.core.operation import Operation, Pause
from motorbus.errors import MotorbusError
from motorbus.families.stepper import driver
from motorbus.families.stepper.driver import Outcome, Ran
from motorbus.families.stepper.execution import Happening
from motorbus.families.stepper.program import estimate
from motorbus.families.stepper.program.earliest import earliest
from motorbus.families.stepper.table import Project
from tests.families.stepper.behaviours import short_projects, switches
from tests.families.stepper.runs import Armed, Running, armed

LONGEST = 8.0
FAULTS = {
    "reply_fault": ("none", "none", "lost", "unheard", "late", "doubled", "bit", "other", "split", "noise"),
    "notice_fault": ("none", "lost", "doubled", "late", "early", "inside_dump"),
    "dump_fault": ("none", "short", "byte"),
    "fault_every": (1, 2, 3),
    "fault_time": (0.1, 0.5, 1.5),
    "byte_errors": (0.0, 0.0, 0.001, 0.02),
    "request_errors": (0.0, 0.0, 0.02),
    "deaf_while_moving": (False, False, True),
    "seed": tuple(range(8)),
}
ACTIONS = (
    "press 1",
    "press 2",
    "press 3",
    "press 4",
    "stop",
    "dump",
    "look",
    "notice",
    "power_cycle",
    "unplug",
)


class Meddling(NamedTuple):
    """What somebody does, and how long after the one before (s)."""

    pause: float
    action: str


def meddlings() -> st.SearchStrategy[list[Meddling]]:
    return st.lists(st.builds(Meddling, st.floats(0, 3), st.sampled_from(ACTIONS)), max_size=5)


def faults() -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({name: st.sampled_from(values) for name, values in FAULTS.items()})


def meddled(there: Running, what: list[Meddling], least: float) -> Operation[None]:
    """A notice out of nothing comes only when it cannot be true; all else at any time."""
    began = yield from Pause(0)
    for pause, action in what:
        now = yield from Pause(pause)
        try:
            yield from _done(there, action, now - began < least)
        except MotorbusError:
            continue


def _done(there: Running, action: str, early: bool) -> Operation[None]:
    verb, _, port = action.partition(" ")
    if verb == "press":
        there.simulated.set_input(int(port), True)
        there.simulated.set_input(int(port), False)
    elif verb == "stop":
        yield from driver.stop(there.device)
    elif verb == "dump":
        yield from driver.dump(there.device, 2)
    elif verb == "look":
        yield from driver.read_input(there.device, 1)
    elif verb == "power_cycle":
        there.power_cycle()
    elif verb != "notice" or (early and there.simulated.powered):
        getattr(there.simulated, verb)()


def began(there: Running) -> float:
    """When the start was on the line."""
    assert isinstance(there.link.line, Armed)
    return there.link.line.started[0]


def records(there: Running) -> Iterator[Happening]:
    """What the controller itself knows to have happened since the start."""
    assert isinstance(there.link.line, Armed)
    if there.link.line.started:
        yield from (one for one in [*there.kept, *there.simulated.told] if one.at >= began(there))


def carried_out(there: Running, project: Project, what: list[Meddling], **options: Any) -> Ran | None:
    """What the run came to, None where it raised: then nothing was claimed."""
    timeout = LONGEST if estimate(project).waits else None
    least = earliest(project) * 0.98
    try:
        return there.beside(meddled(there, what, least), timeout=timeout, **options)
    except MotorbusError:
        return None


@pytest.mark.timeout(600)
@settings(max_examples=300, deadline=None)
@given(
    project=short_projects(),
    how=switches(),
    harm=faults(),
    what=meddlings(),
    watch=st.sampled_from(((), (), (1, 2), (4,))),
)
def test_it_is_never_falsely_completed(
    project: Project, how: dict[str, Any], harm: dict[str, Any], what: list[Meddling], watch: tuple[int, ...]
) -> None:
    with armed(project, how, **harm) as there:
        ran = carried_out(there, project, what, watch=watch)
        told = list(records(there))
        assert there.starts <= 1
        if ran is not None and ran.outcome is Outcome.COMPLETED:
            ends = [one.at for one in told if one.kind == "completed"]
            assert ends, (ran, told)
            assert ends[0] >= began(there) + earliest(project) * 0.98 - 1e-9
            assert there.owed is False
            if not how["notice_on_stop"] and not how["notice_on_in3"]:
                assert "ended" in [one.kind for one in told]
        elif ran is not None and ran.outcome is Outcome.TIMEOUT:
            assert there.owed or there.device.memory.stops


@pytest.mark.timeout(600)
@settings(max_examples=300, deadline=None)
@given(
    project=short_projects(),
    how=switches(),
    acknowledged=st.sampled_from(("none", "lost", "doubled", "noise", "other", "late")),
    presses=st.lists(st.floats(0.1, 1.5), min_size=5, max_size=30),
    watch=st.sampled_from(((), (1,))),
)
def test_it_is_completed_whenever_its_notice_arrived(
    project: Project, how: dict[str, Any], acknowledged: str, presses: list[float], watch: tuple[int, ...]
) -> None:
    """Under every switch, with somebody at the buttons; and whatever became of the acknowledgement."""
    with armed(project, how, reply_fault=acknowledged) as there:
        moment = 0.0
        for number, pause in enumerate(presses):
            moment += pause
            there.simulator.press(1 + number % 2, True, moment)
            there.simulator.press(1 + number % 2, False, moment + pause / 2)
        ran = there.go(timeout=40.0, watch=watch)
        told = list(records(there))
        ends = [one.at for one in told if one.kind == "ended"]
        if not ends:
            assert ran.outcome is not Outcome.COMPLETED or how["notice_on_stop"]
            return
        assert ran.outcome is Outcome.COMPLETED, (ran, told)
        assert ran.seconds == pytest.approx(ends[0] - began(there), abs=0.01)
