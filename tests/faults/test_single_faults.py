"""Rows L1 and L2 on FEETECH: one byte changed, lost, doubled, too many or late, in every exchange, in both directions.

Toward the host it gives no wrong value and no false acknowledgement. Toward the servos nobody obeys what was not said,
with one exception that the protocol leaves: a byte too many can make a shorter request whose sum is right. So what
matters is read back, and then nothing false is told either.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import pytest

from motorbus.link.base import Line, Side
from tests.conftest import Figures, Rounds
from tests.support.catalogue.feetech import KINDS, Kind, another_request
from tests.support.rigs.feetech import Rig
from tests.support.single_faults import EDGES, EVERY, Bytewise, Tally, every_fault, number_of, suffer

ALL = [(model, name) for model, kinds in KINDS.items() for name in kinds]
TO_HOST = [(model, name) for model, name in ALL if KINDS[model][name].back]
AT_MOST = 1.0
"""s that any of them may take: three tries, their quiet times and probes."""


def suffered(
    model: str,
    name: str,
    values: Iterable[int],
    to: Side,
    *,
    bytewise: bool = False,
    actions: tuple[str, ...] = (),
    places: Iterable[int] | None = None,
) -> Tally:
    kind = KINDS[model][name]
    faults = [
        fault
        for fault in every_fault(_length(kind, to), values, to, places)
        if not actions or fault.action in actions
    ]
    tally = suffer(
        Rig(model=model),
        kind.act,
        faults,
        before=kind.before,
        wrap=Bytewise if bytewise else _plainly,
        at_most=AT_MOST,
        misleading=another_request if to is Side.DEVICE else _never,
    )
    assert tally.faults == len(faults) > 0
    assert tally.misled <= _length(kind, to), "at each place one byte more completes the sum"
    if kind.sure:
        assert tally.succeeded + tally.misled == tally.faults, (
            "what may be said again gets over any single fault"
        )
    elif actions == ("corrupt",):
        assert tally.succeeded == 0, "a changed byte was believed"
    else:
        assert 0 < tally.succeeded < tally.faults, "a byte too many in front does no harm"
    return tally


def _length(kind: Kind, to: Side) -> int:
    return kind.back if to is Side.HOST else kind.there


def _never(_: object) -> bool:
    return False


def _plainly(line: Line) -> Line:
    return line


@pytest.mark.parametrize(("model", "name"), TO_HOST)
def test_l1_a_changed_byte_of_a_reply_is_no_value(model: str, name: str) -> None:
    suffered(model, name, EDGES, Side.HOST, actions=("corrupt",))


@pytest.mark.parametrize(("model", "name"), TO_HOST)
def test_l2_a_byte_of_a_reply_that_is_lost_or_too_many_gives_no_value(model: str, name: str) -> None:
    suffered(model, name, EDGES, Side.HOST, actions=("drop", "duplicate", "insert", "delay"))


@pytest.mark.parametrize(("model", "name"), ALL)
def test_l1_l2_a_damaged_request_makes_nobody_do_what_was_not_said(model: str, name: str) -> None:
    suffered(model, name, EDGES, Side.DEVICE)


def test_l1_l2_every_fault_of_the_reading_that_is_used_most(rounds: Rounds) -> None:
    values = EVERY[:: 256 // rounds(256, 64)]
    tally = suffered("sts3215", "read 2 bytes", values, Side.HOST)
    assert tally.faults == number_of(8, len(values)) == 8 * (4 + len(values) - 1) + 9 * len(values)


def _both(kind: Kind) -> Iterator[tuple[Side, bool]]:
    yield Side.DEVICE, False
    if kind.back:
        yield from ((Side.HOST, bytewise) for bytewise in (False, True))


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(("model", "name"), ALL)
def test_l1_l2_every_fault_of_every_exchange(model: str, name: str, figures: Figures) -> None:
    kind = KINDS[model][name]
    for to, bytewise in _both(kind):
        tally = suffered(model, name, EVERY, to, bytewise=bytewise)
        assert tally.faults == number_of(_length(kind, to))
        how = f"toward the {to.value}{', byte by byte' if bytewise else ''}"
        figures(
            f"L1 L2 single byte faults, {model}, {name}, {how}",
            family="feetech" if to is Side.HOST else "",
            **tally.told,
        )


def test_l1_l5_a_write_that_is_read_back_is_never_called_done_when_it_is_not(rounds: Rounds) -> None:
    values = EVERY[:: 256 // rounds(256, 64)]
    tally = suffered(
        "sts3215", "write 2 bytes and read back", values, Side.DEVICE, actions=("insert", "corrupt")
    )
    assert tally.false == 0
    assert tally.misled > 0, "the servo heard another request, and reading back told so"
