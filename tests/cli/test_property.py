"""Whatever anybody types, no bytes order a place outside the limits of the machine file, or too far from where it is.

Lines of the shell by chance: names of axes and addresses, degrees, radians and raw numbers, one device and several,
moves and writes. Bytes are judged by decoders that know the manuals and not the drivers.
"""

from __future__ import annotations

from collections.abc import Callable
from math import degrees, radians
from pathlib import Path
from random import Random
from typing import Any

import pytest

from motorbus.cli.exits import Exit
from tests.cli.conftest import Run
from tests.safety.calls import AXES, BOUNDS, SLACK, SURELY
from tests.safety.decoders import COUNT, TENTH, FeetechWitness, KstWitness, Witness
from tests.support.machines import machine

SLOW = 30
"""A line of the shell takes so much longer than a call."""
LINES = 100
"""Of one seed; after so many there is a new machine."""
ODD = (
    "nan",
    "inf",
    "-inf",
    "1e400",
    "0x10",
    "--",
    "90",
    "1e3deg",
    "ten",
    "32768raw",
    "-32769raw",
    "65535raw",
)
UNSAFE = (Exit.USAGE, Exit.UNSAFE)


class Typist:
    """Draws lines, types them, and judges what reached the wires."""

    def __init__(self, run: Run, addresses: dict[str, str], sims: Any, seed: int) -> None:
        self.run = run
        self.addresses = addresses
        self.sims = sims
        self.chance = Random(seed)
        self.wires: dict[str, Witness] = {"arm": FeetechWitness(), "can": KstWitness(0x25, 0x26)}
        for name, wire in self.wires.items():
            sims[name].line = wire
        self.gone = self.refused = 0

    def here(self, spot: tuple[str, int]) -> float:
        """Where a device really is (rad)."""
        return float(self.sims[spot[0]][spot[1]].raw_position) * (COUNT if spot[0] == "arm" else TENTH)

    def word(self, spot: tuple[str, int]) -> str:
        """The device as somebody may name it."""
        bus, node = spot
        return self.chance.choice((BOUNDS[spot].axis, f"{bus}#{node}", f"{self.addresses[bus]}#{node}"))

    def goal(self, spot: tuple[str, int]) -> tuple[str, float | None]:
        """A goal as it is typed, and what it means (rad of the device; None: nothing)."""
        bound, here, chance = BOUNDS[spot], self.here(spot), self.chance
        kind = chance.randrange(8)
        if kind == 0:
            return chance.choice(ODD), None
        to = chance.uniform(-7, 7) if kind == 1 else here + chance.uniform(-1.3, 1.3) * bound.step
        count = COUNT if spot[0] == "arm" else TENTH
        raw = round(to / count)
        return chance.choice(((f"{degrees(to):.4f}deg", to), (f"{to:.6f}", to), (f"{raw}raw", raw * count)))

    def line(self) -> tuple[list[str], dict[tuple[str, int], float | None]]:
        """What is typed, and where it must lead when all of it is allowed."""
        spot = self.chance.choice(list(BOUNDS))
        typed, to = self.goal(spot)
        device = self.word(spot)
        if self.chance.randrange(2):
            return ["write", device, f"goal_position={typed}", "--yes", "--expert"], {spot: to}
        device = (
            self.addresses[spot[0]] + f"#{spot[1]}"
        )  # by its name it is an axis, with an angle of its own
        to = None if typed.endswith("raw") else to  # a move takes quantities only
        speed = ["--velocity", "1.5"] if spot[0] == "arm" else []
        return ["move", f"{device}={typed}", *speed, "--yes", "--no-wait"], {spot: to}

    def type(self) -> None:
        """One line, and what became of it."""
        words, wants = self.line()
        for wire in self.wires.values():
            wire.targets.clear()
        verdicts = [self.verdict(spot, to) for spot, to in wants.items()]
        ran = self.run(*words)
        for spot, bound in BOUNDS.items():
            for target in (one for one in self.wires[spot[0]].targets if one.node == spot[1]):
                assert target.heard is not None, words
                assert bound.low - SLACK <= target.to <= bound.high + SLACK, (words, target, bound)
                assert abs(target.to - target.heard) <= bound.step + SLACK, (words, target, bound)
        if False in verdicts:
            assert ran.code in UNSAFE, (words, ran)
            self.refused += 1
        elif None not in verdicts:
            assert ran.code == 0, (words, ran)
            self.gone += 1

    def verdict(self, spot: tuple[str, int], to: float | None) -> bool | None:
        """Whether it must reach the device; None where that is too close to say."""
        if to is None:
            return False
        bound = BOUNDS[spot]
        beyond = max(bound.low - to, to - bound.high, abs(to - self.here(spot)) - bound.step)
        return None if abs(beyond) < SURELY else beyond < 0


@pytest.mark.timeout(0)
def test_no_line_of_the_shell_leads_out_of_the_limits(
    rounds: Callable[[int], int], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    left, seed, gone, refused = rounds(1_000_000) // SLOW, 0, 0, 0
    while left > 0:
        seed += 1
        with machine(arm="1-2", can="0x25,0x26", axes=AXES) as (made, sims):
            Path("motorbus.toml").write_text(made.text(), encoding="utf-8")
            addresses = {name: bus.address for name, bus in made.buses.items()}
            typist = Typist(run, addresses, sims, seed)
            for _ in range(min(left, LINES)):
                typist.type()
        left, gone, refused = left - LINES, gone + typist.gone, refused + typist.refused
    assert min(gone, refused) > seed * LINES / 10, (gone, refused)
    print(f"{gone} lines went, {refused} were refused")


def test_the_decoders_know_what_a_line_orders(run: Run) -> None:
    """So that a typist without ears is found out."""
    with machine(arm="1", axes={"a1": {"max_step": "15 deg"}}) as (made, sims):
        wire = sims["arm"].line = FeetechWitness()
        address = made.buses["arm"].address
        assert run("write", f"{address}#1", "goal_position=190deg").code == 0
        assert [(one.node, round(degrees(one.to))) for one in wire.targets] == [(1, 190)]
        assert wire.targets[0].to == pytest.approx(radians(190), abs=COUNT)
