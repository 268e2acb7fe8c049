"""A line that hands back what is sent: in full, its first six bytes, or late.

Six bytes are a whole acknowledgement of 15 of the 27 commands. So these tests let the controller be deaf while the
line echoes, and whatever is acknowledged then is forged.
"""

from __future__ import annotations

from random import Random

import pytest

from motorbus.core.request import Data
from motorbus.errors import MotorbusError
from motorbus.families.stepper import wire
from motorbus.families.stepper.table import ORDERS
from motorbus.link.base import Delivery, Side
from tests.families.stepper.rig import BYTE, MOTIONS, FalseWord, HeardLine, Rig
from tests.faults.test_stepper_single_faults import ask

OFF, FULL, SIX, LATE = "off", "full", "six", "late"


class Echoing(HeardLine):
    """Echoes as `mode` says, in pieces of so many bytes, at the moments at which a wire of 9600 baud has them.

    While `deaf` nothing reaches the controller. `pace` is whether the link takes its time and says so; else this line
    does, and the bus cannot know it. A late echo comes by `lateness` later, in s, or by lot.
    """

    def __init__(self, mode: str, *, piece: int = 1, pace: bool = True, deaf: bool = False) -> None:
        super().__init__()
        self.random = Random(1)
        self.mode = mode
        self.piece = piece
        self.pace = pace
        self.deaf = deaf
        self.lateness: float | None = None
        self.echoes = 0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        assert isinstance(data, bytes)
        if sender is Side.DEVICE:
            return super().carry(sender, data, at)
        echo = self._echo(data, at)
        self.echoes += bool(echo)
        heard = at if self.pace else at + len(data) * BYTE
        return echo + ([] if self.deaf else super().carry(sender, data, heard))

    def _echo(self, data: bytes, at: float) -> list[Delivery]:
        back = {OFF: b"", SIX: data[: wire.REPLY_LENGTH]}.get(self.mode, data)
        begin = at - len(data) * BYTE if self.pace else at
        if self.mode == LATE:
            begin += self.random.uniform(0.01, 0.3) if self.lateness is None else self.lateness
        pieces = range(0, len(back), self.piece)
        ends = [min(start + self.piece, len(back)) for start in pieces]
        return [
            Delivery(begin + end * BYTE, Side.HOST, back[start:end])
            for start, end in zip(pieces, ends, strict=True)
        ]


def rig_on(line: Echoing, *, opened: bool) -> Rig:
    rig = Rig(line, 2, pace=line.pace)
    if opened:
        rig.open()
    return rig


@pytest.mark.parametrize("opened", [True, False])
@pytest.mark.parametrize("pace", [True, False])
@pytest.mark.parametrize("piece", [1, 4, 6, 11])
def test_a_line_that_only_echoes_acknowledges_nothing(piece: int, pace: bool, opened: bool) -> None:
    line = Echoing(FULL, piece=piece, pace=pace, deaf=True)
    rig = rig_on(line, opened=opened)
    for name in (*ORDERS, "stop_motor", "start_project"):
        assert not ask(rig, name), f"{name} was acknowledged by its own echo"
    assert rig.device.ping() is False
    assert line.echoes > 27


@pytest.mark.parametrize("pace", [True, False])
@pytest.mark.parametrize("piece", [1, 4, 6, 11])
def test_with_a_controller_behind_it_everything_is_right_at_its_first_try(piece: int, pace: bool) -> None:
    rig = rig_on(Echoing(FULL, piece=piece, pace=pace), opened=True)
    assert rig.bus.echoes
    for name in ORDERS:
        assert ask(rig, name), name
    assert rig.tried_again == 0


@pytest.mark.parametrize("pace", [True, False])
@pytest.mark.parametrize("piece", [1, 4, 6, 11])
def test_an_echo_that_nobody_has_tested_for_is_found_by_what_comes_of_it(piece: int, pace: bool) -> None:
    rig = rig_on(Echoing(FULL, piece=piece, pace=pace), opened=False)
    told = [ask(rig, name) for name in ORDERS]
    assert rig.bus.echoes
    assert all(told[-10:])


def forged(rig: Rig, name: str) -> bool:
    try:
        return ask(rig, name)
    except FalseWord:
        return True


def test_six_bytes_and_silence_are_the_known_limit_where_nobody_knows_the_rate() -> None:
    """Behind a socket nothing tells such an echo from a reply. It acknowledges these commands, and no other."""
    names = []
    for name in ORDERS:
        rig = rig_on(Echoing(SIX, piece=6, pace=False, deaf=True), opened=False)
        if forged(rig, name):
            names.append(name)
    print(f"\nsix bytes echoed, without pace: {len(names)} of 27 commands are forged: {', '.join(names)}")
    assert set(names) <= {name for name in ORDERS if _may_be_its_reply(name)}
    assert "read_project" not in names


def _may_be_its_reply(name: str) -> bool:
    """Whether the reply may be the first six bytes of the request, for some numbers of it."""
    zero = {place.name: 0 for place in ORDERS[name].command.places}
    return wire.looks_like_echo(wire.encode(name, **{**zero, "project": 1} if "project" in zero else zero))


@pytest.mark.parametrize("pace", [True, False])
@pytest.mark.parametrize("piece", [1, 6])
def test_with_nobody_behind_such_an_echo_nothing_that_reads_first_succeeds(piece: int, pace: bool) -> None:
    rig = rig_on(Echoing(SIX, piece=piece, pace=pace, deaf=True), opened=True)
    for verb in (
        rig.device.ping,
        rig.device.identify,
        rig.device.dump,
        rig.device.read_project,
        rig.device.read,
    ):
        with pytest.raises(MotorbusError):
            verb()


@pytest.mark.parametrize("name", MOTIONS)
def test_a_controller_behind_such_an_echo_that_was_tested_is_doubted_and_not_believed(name: str) -> None:
    """Both come, the echo and the reply: more than was asked for."""
    rig = rig_on(Echoing(SIX), opened=True)
    assert not ask(rig, name)
