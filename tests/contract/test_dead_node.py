"""A dead servo in a group that is read in a loop: the others stay right and fast, and it returns when it is back."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

import motorbus
from motorbus import feetech
from tests.conftest import Rounds

IDS: Final = (1, 2, 3, 4, 5, 6)
DEAD: Final = 4
TIMEOUT: Final = 0.03
"""s that a group with a silent member takes at most: its time-out, and not a probe of the silent one each time."""
BACK_OFF: Final = 1.0
"""s after which a servo that is back is asked again."""


def turn(sim: Any, index: int) -> dict[int, float]:
    """Give each servo a new position; return them (rad)."""
    for node in IDS:
        sim[node].raw_position = 100 + (index * 7 + node * 31) % 900
    return {node: (100 + (index * 7 + node * 31) % 900) * math.tau / 4096 for node in IDS}


def test_a_group_read_in_a_loop(rounds: Rounds) -> None:
    cycles = rounds(20_000, 300)
    with motorbus.simulate("feetech", ids=IDS) as sim:
        sim.pace = True
        with motorbus.open(sim.url) as bus:
            servos = [feetech.Servo(bus, node) for node in IDS]
            for servo in servos:
                servo.prepare()

            def read(index: int) -> set[int]:
                right = turn(sim, index)
                found = bus.run(feetech.ServoGroup(servos).positions)
                assert all(abs(right[node] - value) < 1e-3 for node, value in found.values.items()), index
                assert set(found.values) | set(found.missing) == set(IDS)
                return set(found.missing)

            assert read(0) == set()
            sim[DEAD].unplug()
            begun, trace = sim.now, bus.trace.subscribe(10 * cycles)
            for index in range(cycles):
                assert read(index) == {DEAD}
            requests = sum(record.direction == "tx" for record in trace)
            assert sim.now - begun < TIMEOUT * cycles
            assert requests < 1.1 * cycles + 5
            sim[DEAD].plug()
            back = sim.now
            assert any(not read(cycles + more) for more in range(100))
            assert sim.now - back < BACK_OFF + TIMEOUT


def test_a_control_loop_survives_a_gap(tmp_path: Path) -> None:
    """A servo is silent for a while: the loop runs on, the others are fresh in each cycle, then all are."""
    with motorbus.simulate("feetech", ids=IDS) as sim:
        sim.pace = True
        axes = [f'[axis.a{node}]\ndevice = "arm#{node}"\nexit = "leave"' for node in IDS]
        file = tmp_path / "motorbus.toml"
        file.write_text("\n".join(["format = 1", "[bus.arm]", f'address = "{sim.url}"', *axes]) + "\n")
        seen: list[dict[str, str]] = []
        with motorbus.Robot.load(file) as robot, robot.loop(rate=100) as loop:
            for state in loop:
                seen.append({name: quality.name for name, quality in state.quality.items()})
                if len(seen) == 50:
                    sim[DEAD].unplug()
                elif len(seen) == 60:
                    sim[DEAD].plug()
                elif len(seen) == 250:
                    break
    silent = [cycle for cycle in seen if cycle[f"a{DEAD}"] != "FRESH"]
    assert 9 <= len(silent) <= 20
    assert all(cycle[f"a{node}"] == "FRESH" for cycle in seen for node in IDS if node != DEAD)
    assert seen[-1][f"a{DEAD}"] == "FRESH"
