"""Rows L3, L4 and L7 on the straight way: damage and lateness by chance strike what a control loop keeps.

As in `test_chance`, with the same bound: wrong values are arithmetic where a reading has an 8-bit sum and nobody
confirms it, and there is none where two readings agree, or where answers are late.
"""

from __future__ import annotations

from functools import partial

import pytest

from motorbus.errors import VerificationFailed
from tests.bus.struck import Landings
from tests.conftest import Figures, Rounds
from tests.faults.chance import expected_of_bits, expected_of_bytes, poisson_line
from tests.faults.single import tried_again
from tests.faults.straight import GROUP, KEPT, WORD, StraightRig
from tests.faults.test_chance import LONGEST, SHARE, Ledger, mean

READINGS = 8
"""How often a confirmed reading is tried."""
BY_BYTE = {
    "corrupt": mean(lambda reply: expected_of_bytes(len(reply), WORD, SHARE)),
    "flip": mean(lambda reply: expected_of_bits(reply, WORD, SHARE)),
}
"""Of a reply with one word, by what happens to its bytes, the share that tells a wrong one."""

DEAR = ("sync_read_states", "volley")
"""Those of which 10 000 take five seconds and more."""


@pytest.mark.timeout(7200)
@pytest.mark.parametrize(("row", "what"), [("L3", "corrupt"), ("L4", "flip")])
@pytest.mark.parametrize("name", ["position()", "sync_read_positions", "sync_read_raw", "volley"])
def test_l3_l4_chance_on_the_straight_way_passes_as_often_as_arithmetic_says(
    name: str, row: str, what: str, rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1 % of the bytes toward the host, or a bit in them."""
    full = 1_000_000 if name == "position()" else 300_000
    seed, total, rig, landings = 13, rounds(full, 600), StraightRig(), Landings(monkeypatch)
    ledger = Ledger(rig, f"seed {seed}; 1% of bytes to host: {what}")
    for _ in range(total):
        ledger.call(partial(KEPT[name].act, rig))
    replies = (1 if name == "position()" else len(GROUP)) * total + tried_again(rig.bus)
    expected = BY_BYTE[what] * replies
    figures(
        f"{row} on the straight way, {name}, 1 % of bytes struck ({what}), unconfirmed",
        family="feetech", promise=2, seed=seed, calls=ledger.calls, expected=round(expected, 2),
        straight=len(landings.ids), struck_in_the_air=rig.struck, missing=rig.missing, **ledger.told(),
    )  # fmt: skip
    assert ledger.wrong <= poisson_line(expected)
    assert rig.struck > 0.04 * total
    assert len(landings.ids) > 0.5 * total
    assert (ledger.untouched_again, rig.missing > 0) == (0, name != "position()")
    assert ledger.longest < LONGEST


def agreed(rig: StraightRig) -> None:
    """Read by a kept reading until two in a row agree, as `position(confirmed=True)` does."""
    raw, last = rig.stir(), None
    for _ in range(READINGS):
        told = rig.hosts[0].position()
        if told == last:
            assert rig.row.to_raw(told) == raw
            return
        last = told
    raise VerificationFailed("no two agreed")


@pytest.mark.timeout(7200)
@pytest.mark.parametrize(("row", "what"), [("L3", "corrupt"), ("L4", "flip")])
def test_l3_l4_two_kept_readings_that_agree_are_never_wrong(
    row: str, what: str, rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    seed, total, rig, landings = 14, rounds(500_000, 1_000), StraightRig(), Landings(monkeypatch)
    ledger = Ledger(rig, f"seed {seed}; 1% of bytes to host: {what}")
    for _ in range(total):
        ledger.call(partial(agreed, rig))
    figures(
        f"{row} positions on the straight way of which two agree, 1 % of bytes struck ({what})",
        family="feetech", promise=2, seed=seed, positions=ledger.calls, straight=len(landings.ids),
        struck_in_the_air=rig.struck, **ledger.told(),
    )  # fmt: skip
    assert (ledger.wrong, ledger.untouched_again) == (0, 0)
    assert rig.struck > 0.08 * total
    assert len(landings.ids) > total
    assert ledger.failed < 0.03 * total, "of so bad a line a few reads get no answer in three tries"


@pytest.mark.timeout(7200)
@pytest.mark.parametrize("name", KEPT)
def test_l7_late_answers_give_no_stale_value_on_the_straight_way(
    name: str, rounds: Rounds, figures: Figures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1 % late by up to half a second, and all behind it held up; every reading has another right answer."""
    full = 1_000_000 if name == "position()" else 300_000
    total = rounds(full, 800) if name in DEAR else rounds(full)
    seed, rig, landings = 15, StraightRig(), Landings(monkeypatch)
    ledger = Ledger(rig, f"seed {seed}; 1% of packets to host: delay 0.001-0.5")
    for _ in range(total):
        ledger.call(partial(KEPT[name].act, rig))
        rig.link.advance(0.02)
    figures(
        f"L7 late answers on the straight way, {name}",
        family="feetech", promise=3, seed=seed, calls=ledger.calls, straight=len(landings.ids),
        struck_in_the_air=rig.struck, missing=rig.missing, **ledger.told(),
    )  # fmt: skip
    assert (ledger.wrong, ledger.untouched_again) == (0, 0)
    assert rig.struck > total / 200
    assert ledger.untouched > 0.1 * total
    assert len(landings.ids) > 0.5 * total
    assert ledger.good > total - 12 * ledger.line.count, "while the line is held up, a few find it silent"
    assert rig.bus.statistics.other["late"] > 0
