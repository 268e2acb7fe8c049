"""Nobody is skipped: a stop, and letting go, visit every axis, whatever happens to some of them on the way.

For each axis it is drawn whether it answers as it should, sets an alarm, is dead, or has a driver that fails behind its
last word; on all families at once. That each was visited is seen by what left for it on the wire.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from random import Random
from typing import Any

import pytest

from motorbus import AsyncRobot, Robot
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.core.steps import catch
from motorbus.errors import MotorbusError
from motorbus.families.feetech import disable_torque_all
from tests.support.machines import Heard, listened, machine

SERVOS = {f"a{node}": node for node in (1, 2, 3, 4)}
CANS = {"c1": 0x25, "c2": 0x26}
NAMES = (*SERVOS, *CANS, "lift")
FATES = ("well", "well", "alarm", "dead", "raises")
VERBS = ("stop", "stopped", "disable_torque", "stop group", "let go", "exit", "estop")
FAILS = "a driver that fails"
Fates = dict[str, str]


def drawn(random: Random) -> Fates:
    """What befalls each; the alarm of whoever cannot have one is that he is dead."""
    found = {name: random.choice(FATES) for name in NAMES}
    return {name: "dead" if fate == "alarm" and name not in SERVOS else fate for name, fate in found.items()}


def befall(robot: Any, sims: Any, fates: Fates) -> None:
    """Let it happen, when everything has been recognised and has its torque."""
    for name, fate in fates.items():
        axis = robot[name]
        axis.engaged = axis.under_way = True
        bus, _, node = axis.spec.device.partition("#")
        if fate == "dead":
            sims[bus][int(node, 0)].unplug()
        elif fate == "alarm":
            sims[bus][int(node, 0)].alarm = 0x20
        elif fate == "raises":
            broken = axis.able.names & {"stop", "disable_torque"}
            axis.able = replace(axis.able, **{name: breaking(getattr(axis.able, name)) for name in broken})
    listened(sims)


def breaking(inner: Callable[[Any], Any]) -> Callable[[Any], Any]:
    async def breaks(device: Any) -> None:
        await catch(inner(device))
        raise MotorbusError(FAILS)

    return breaks


def visited(sims: Any) -> set[str]:
    """For whom something left; what is for everyone counts for nobody."""
    found: set[str] = set()
    for bus in ("arm", "can", "stage"):
        line = sims[bus].line
        assert isinstance(line, Heard)
        found |= {name for data in line.sent for name in named(bus, data)}
    return found


def named(bus: str, data: Data) -> list[str]:
    if isinstance(data, CanFrame):
        return [name for name, node in CANS.items() if data.id & 0x7F == node]
    if bus == "stage":
        return ["lift"] if data[2] == 0x5E or data[2:4] == b"\x03\x0d" else []
    return [name for name, node in SERVOS.items() if data[2] == node]


def limp(sims: Any, fates: Fates) -> None:
    """Whoever is not dead has let go."""
    alive = [node for name, node in SERVOS.items() if fates[name] != "dead"]
    assert [sims["arm"][node].memory["torque_enable"] for node in alive] == [0] * len(alive)


def checked(verb: str, sims: Any, fates: Fates, error: BaseException | None) -> None:
    """Everyone was visited, those who can let go have, and whoever failed is named."""
    without = {"disable_torque": {*CANS, "lift"}, "let go": {*CANS, "lift"}, "stop group": {"lift"}}
    wanted = set(NAMES) - without.get(verb, set())
    assert visited(sims) >= wanted, (fates, wanted - visited(sims))
    if verb in ("disable_torque", "let go", "estop", "exit"):
        limp(sims, fates)
    if verb in ("let go", "estop"):
        return
    failed = {name for name in wanted if fates[name] in ("dead", "raises")}
    text = f"{error}{getattr(error, '__notes__', '')}"
    assert (error is not None) == bool(failed), text
    for name in failed:
        assert name in text, (name, text)


MACHINE: dict[str, Any] = {
    "arm": "1-4",
    "can": "0x25,0x26",
    "lift": True,
    "axes": {name: {"exit": "torque_off"} for name in SERVOS},
}


def blocking(verb: str, fates: Fates) -> None:
    error: BaseException | None = None
    with machine(**MACHINE) as (made, sims), suppress(MotorbusError):
        robot = Robot.of(made)
        try:
            robot.enable_torque()
            befall(robot, sims, fates)
            acts: dict[str, Callable[[], object]] = {
                "stop": robot.stop,
                "stopped": lambda: robot.stopped(patience=0.1),
                "disable_torque": robot.disable_torque,
                "stop group": lambda: robot.stop("led"),
                "let go": lambda: robot.buses["arm"].run(disable_torque_all(SERVOS.values())),  # type: ignore[attr-defined]
                "exit": robot.close,
                "estop": robot.estop,
            }
            try:
                acts[verb]()
            except MotorbusError as raised:
                error = raised
            checked(verb, sims, fates, error)
        finally:
            robot.close()


def awaited(verb: str, fates: Fates) -> None:
    async def main() -> None:
        error: BaseException | None = None
        with machine(**MACHINE) as (made, sims), suppress(MotorbusError):
            async with AsyncRobot.of(made) as robot:
                await robot.enable_torque()
                befall(robot, sims, fates)
                acts: dict[str, Callable[[], Awaitable[object]]] = {
                    "stop": robot.stop,
                    "stopped": lambda: robot.stopped(patience=0.1),
                    "disable_torque": robot.disable_torque,
                    "stop group": lambda: robot.stop("led"),
                    "let go": lambda: robot.buses["arm"].run(disable_torque_all(SERVOS.values())),  # type: ignore[attr-defined]
                    "exit": robot.close,
                    "estop": lambda: asyncio.to_thread(robot.estop),
                }
                try:
                    await acts[verb]()
                except MotorbusError as raised:
                    error = raised
                checked(verb, sims, fates, error)

    asyncio.run(main())


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("face", [blocking, awaited], ids=["blocking", "async"])
def test_08_nobody_is_skipped_whoever_fails(
    face: Callable[[str, Fates], None], verb: str, rounds: Callable[[int], int]
) -> None:
    random = Random(VERBS.index(verb))
    for _ in range(max(1, rounds(100_000) // 500)):
        face(verb, drawn(random))


@pytest.mark.parametrize("face", [blocking, awaited], ids=["blocking", "async"])
@pytest.mark.parametrize("fate", ["alarm", "dead", "raises"])
@pytest.mark.parametrize("verb", VERBS)
def test_08_nobody_is_skipped_when_all_fail_at_once(
    face: Callable[[str, Fates], None], verb: str, fate: str
) -> None:
    face(verb, {name: "dead" if fate == "alarm" and name not in SERVOS else fate for name in NAMES})
