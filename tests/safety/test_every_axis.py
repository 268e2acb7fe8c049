"""A stop, a torque-off and the end of a robot visit every axis, whatever fails on the way.

For each axis it is drawn whether it answers, has an alarm, is dead, or has a driver that fails. That each axis was
visited is seen by what left for it on the wire, on all families at once.
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
from tests.support.machines import listen, machine, sent

SERVOS = {f"a{node}": node for node in (1, 2, 3, 4)}
CANS = {"c1": 0x25, "c2": 0x26}
NAMES = (*SERVOS, *CANS, "lift")
FATES = ("well", "well", "alarm", "dead", "raises")
VERBS = ("stop", "verify", "disable_torque", "stop group", "broadcast", "exit", "estop")
FAILS = "a driver that fails"
Fates = dict[str, str]


def drawn(random: Random) -> Fates:
    """A fate for each axis; only a servo can have an alarm."""
    found = {name: random.choice(FATES) for name in NAMES}
    return {name: "dead" if fate == "alarm" and name not in SERVOS else fate for name, fate in found.items()}


def inflict(robot: Any, sims: Any, fates: Fates) -> None:
    """Let it happen to axes that have torque and move."""
    for name, fate in fates.items():
        axis = robot.axes[name]
        axis.status.engaged = axis.status.moving = True
        device = sims[axis.config.bus][axis.config.node]
        if fate == "dead":
            device.unplug()
        elif fate == "alarm":
            device.alarm = 0x20
        elif fate == "raises":
            broken = axis.driver.names & {"stop", "disable_torque"}
            axis.driver = replace(
                axis.driver, **{name: breaking(getattr(axis.driver, name)) for name in broken}
            )
    listen(sims)


def breaking(inner: Callable[[Any], Any]) -> Callable[[Any], Any]:
    async def breaks(device: Any) -> None:
        await catch(inner(device))
        raise MotorbusError(FAILS)

    return breaks


def visited(sims: Any) -> set[str]:
    """The axes for which something left; a broadcast counts for none."""
    return {name for bus in sims for data in sent({bus: sims[bus]}) for name in named(bus, data)}


def named(bus: str, data: Data) -> list[str]:
    if isinstance(data, CanFrame):
        return [name for name, node in CANS.items() if data.id & 0x7F == node]
    if bus == "stage":
        return ["lift"] if data[2] == 0x5E or data[2:4] == b"\x03\x0d" else []
    return [name for name, node in SERVOS.items() if data[2] == node]


def limp(sims: Any, fates: Fates) -> None:
    """Each servo that is not dead has no torque."""
    alive = [node for name, node in SERVOS.items() if fates[name] != "dead"]
    assert [sims["arm"][node].memory["torque_enable"] for node in alive] == [0] * len(alive)


def checked(verb: str, sims: Any, fates: Fates, error: BaseException | None) -> None:
    """Every axis was visited, those that can are without torque, and each that failed is named."""
    without = {"disable_torque": {*CANS, "lift"}, "broadcast": {*CANS, "lift"}, "stop group": {"lift"}}
    wanted = set(NAMES) - without.get(verb, set())
    assert visited(sims) >= wanted, (fates, wanted - visited(sims))
    if verb in ("disable_torque", "broadcast", "estop", "exit"):
        limp(sims, fates)
    if verb in ("broadcast", "estop"):
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
    with machine(**MACHINE) as (config, sims), suppress(MotorbusError):
        robot = Robot(config)
        try:
            robot.enable_torque()
            inflict(robot, sims, fates)
            acts: dict[str, Callable[[], object]] = {
                "stop": robot.stop,
                "verify": lambda: robot.stop(verify=True),
                "disable_torque": robot.disable_torque,
                "stop group": lambda: robot.stop("led"),
                "broadcast": lambda: robot.buses["arm"].run(disable_torque_all(SERVOS.values())),
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
        with machine(**MACHINE) as (config, sims), suppress(MotorbusError):
            async with AsyncRobot(config) as robot:
                await robot.enable_torque()
                inflict(robot, sims, fates)
                acts: dict[str, Callable[[], Awaitable[object]]] = {
                    "stop": robot.stop,
                    "verify": lambda: robot.stop(verify=True),
                    "disable_torque": robot.disable_torque,
                    "stop group": lambda: robot.stop("led"),
                    "broadcast": lambda: robot.buses["arm"].run(disable_torque_all(SERVOS.values())),
                    "exit": lambda: robot.__aexit__(None, None, None),
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
def test_08_every_axis_is_visited_whatever_fails(
    face: Callable[[str, Fates], None], verb: str, rounds: Callable[[int], int]
) -> None:
    random = Random(VERBS.index(verb))
    for _ in range(max(1, rounds(100_000) // 500)):
        face(verb, drawn(random))


@pytest.mark.parametrize("face", [blocking, awaited], ids=["blocking", "async"])
@pytest.mark.parametrize("fate", ["alarm", "dead", "raises"])
@pytest.mark.parametrize("verb", VERBS)
def test_08_every_axis_is_visited_when_all_fail(
    face: Callable[[str, Fates], None], verb: str, fate: str
) -> None:
    face(verb, {name: "dead" if fate == "alarm" and name not in SERVOS else fate for name in NAMES})
