"""One byte of a reply changed, lost, doubled or too many, for each of the 27 commands: no wrong value, ever.

And what is asked next is right at its first try. A level of an input is one bit that nothing vouches for, so it is
read until two readings agree, as a dump is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import chain
from typing import NamedTuple

import pytest

from motorbus.core.request import Data
from motorbus.families.stepper import protocol
from motorbus.link.base import Delivery, PerfectLine, Side
from tests.conftest import Figures
from tests.families.stepper.rig import BYTE, KEPT, MOTIONS, STOPS, FalseWord, Rig
from tests.support import single_faults
from tests.support.lines import ByteFault, ByteFaultLine

EDGES = (0x00, 0x02, 0x5E, 0xEE, 0xFF)
"""Values that mean something somewhere in a reply."""
COMMANDS = tuple(protocol.COMMANDS)
UNNAMED = ("set_segment_loop", "set_project_loop")
"""Their replies name a project that their requests do not: one that is none is an error, and not asked for again."""


def ask(rig: Rig, name: str) -> bool:
    """Say this command once, with numbers drawn by lot, and judge what is told."""
    if protocol.COMMANDS[name].is_edit:
        return rig.edit(name)
    if name in KEPT or name in MOTIONS:
        return rig.keep(name) if name in KEPT else rig.motion(name)
    if name in STOPS:
        return rig.stop_by(name)
    other: dict[str, Callable[[], bool]] = {
        "read_project": rig.dump,
        "read_input": rig.input,
        "set_output": rig.output,
    }
    return other[name]()


def length_of(name: str) -> int:
    return protocol.DUMP_LENGTH if name == "read_project" else protocol.REPLY_LENGTH


def every_fault(length: int, values: Iterable[int], places: Iterable[int] | None = None) -> list[ByteFault]:
    """All but the late bytes: a line at 9600 baud has no packets that a pause could part."""
    return [one for one in single_faults.every_fault(length, values, places=places) if one.action != "delay"]


class Tally(NamedTuple):
    """How many faults there were, how many calls succeeded in spite of theirs, and what they told that is not so."""

    total: int
    succeeded: int
    false: list[str]


def suffer(name: str, faults: Iterable[ByteFault], *, bytewise: bool = False) -> Tally:
    """Every fault in turn, each of which must happen; what is asked next must be right at its first try."""
    rig = Rig(PerfectLine(), 1, pace=False)
    rig.open()
    total = succeeded = 0
    false: list[str] = []
    for fault in faults:
        total += 1
        line = ByteFaultLine(fault)
        rig.link.line = single_faults.Bytewise(line, BYTE) if bytewise else line
        try:
            succeeded += ask(rig, name)
        except FalseWord as told:
            false.append(f"{fault}: {told}")
        assert len(line.fired) == 1, f"{fault} did not happen"
        rig.link.line = PerfectLine()
        again = rig.tried_again
        assert rig.stop_by("stop_project") if name in MOTIONS else rig.output()
        assert rig.input()
        assert rig.tried_again == again, f"{fault}: not right at the first try"
    return Tally(total, succeeded, false)


@pytest.mark.parametrize("name", [name for name in COMMANDS if name != "read_project"])
def test_single_byte_faults_with_telling_values(name: str) -> None:
    total, succeeded, false = suffer(name, every_fault(length_of(name), EDGES), bytewise=True)
    assert false == []
    assert total == 6 * (2 + len(EDGES) - 1) + 7 * len(EDGES)
    if protocol.COMMANDS[name].repeatable and name not in STOPS:
        assert succeeded >= total - (name in UNNAMED), "what may be said again gets over any single fault"
    else:
        assert 0 < succeeded < total, "a byte too many in front does no harm"


@pytest.mark.parametrize("bytewise", [False, True])
def test_single_byte_faults_of_a_dump(bytewise: bool) -> None:
    places = chain(range(30), range(30, 227, 19), range(222, 227))
    faults = (fault for at in places for fault in every_fault(226, (0x01, 0xEE, 0xFF), range(at, at + 1)))
    total, succeeded, false = suffer("read_project", faults, bytewise=bytewise)
    assert false == []
    assert succeeded == total > 200


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("bytewise", [False, True])
def test_every_single_byte_fault_of_every_command(bytewise: bool, figures: Figures) -> None:
    names = [name for name in COMMANDS if name != "read_project"]
    tallies = [suffer(name, every_fault(6, range(256)), bytewise=bytewise) for name in names]
    false = [told for tally in tallies for told in tally.false]
    total, succeeded = sum(tally.total for tally in tallies), sum(tally.succeeded for tally in tallies)
    how = "byte by byte" if bytewise else "in one piece"
    what = f"L1 L2 single byte faults in replies to {len(names)} commands, {how}"
    figures(what, family="stepper", faults=total, wrong=len(false), succeeded=succeeded)
    assert false == []
    assert total == 26 * (6 * 257 + 7 * 256)


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("part", range(4))
def test_every_single_byte_fault_of_a_dump(part: int, figures: Figures) -> None:
    places = range(part * 57, min(227, (part + 1) * 57))
    total, succeeded, false = suffer("read_project", every_fault(226, range(256), places))
    what = f"L1 L2 single byte faults in a dump, bytes {places[0]} to {places[-1]}"
    figures(what, family="stepper", faults=total, wrong=len(false), succeeded=succeeded)
    assert false == []
    assert succeeded == total


class Inserting(PerfectLine):
    """Puts EE DD into the next thing that the device says, before this byte."""

    def __init__(self, place: int) -> None:
        self.place = place
        self.done = False

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        if sender is Side.DEVICE and isinstance(data, bytes) and not self.done:
            self.done = True
            data = data[: self.place] + protocol.NOTICE + data[self.place :]
        return super().carry(sender, data, at)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_notice_between_any_two_bytes_makes_no_value_and_no_acknowledgement(name: str) -> None:
    rig = Rig(PerfectLine(), 1, pace=False)
    rig.open()
    whole = length_of(name)
    for place in range(whole + 1):
        rig.bus.run(rig.device_stop())
        heard = rig.bus.notices.subscribe()
        rig.link.line = line = Inserting(place)
        done = ask(rig, name)
        assert line.done
        assert done or not protocol.COMMANDS[name].repeatable or name in STOPS
        assert done or 0 < place < whole, "before and behind a reply it is a notice like any other"
        inside_a_dump = whole > protocol.REPLY_LENGTH and 0 < place < whole
        told = list(heard)
        assert [one.data for one in told] in ([protocol.NOTICE], []), "never more than there was"
        assert not (inside_a_dump and place > 5 and told), "what is inside a dump is no notice"
        rig.bus.notices.unsubscribe(heard)
        rig.link.line = PerfectLine()
        assert rig.input()
