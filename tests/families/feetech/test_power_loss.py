"""A servo that loses its supply for a moment during a motion command goes no farther than the command orders.

It comes back limp, with its goal at 0 and its speed at the maximum; torque that is switched on then would send it
thousands of counts away. Its supply is cut before every frame of every command, in every mode of every map.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import count
from typing import Any

import pytest

import motorbus
from motorbus.errors import MotionError
from motorbus.families.feetech import FAMILY, Node, Servo
from motorbus.families.feetech.driver.motion import Motion, move_all
from motorbus.families.feetech.registers import TABLES
from motorbus.families.feetech.traits import TRAITS, Mode
from tests.conformance.cuts import Call, Command, Cut, Kind, Moment, World
from tests.families.feetech.worlds import MODELS, MODES, RATES
from tests.support.catalogue.cuts import feetech_address

FORGETFUL = {"goal_at_power_up": "zero"}
TURN = 0.1
"""rad that a move or a step is ordered to go."""
NOISE = 2.0
"""Counts."""
ENABLE, STOP = Call("enable_torque"), Call("stop")
ZERO = {
    Mode.VELOCITY: Call("set_velocity", (0.0,)),
    Mode.PWM: Call("set_duty", (0.0,)),
    Mode.CURRENT: Call("set_current", (0.0,)),
}
COMMANDS: list[tuple[str, Mode, str, tuple[Call, ...]]] = [
    *((name, mode, "torque", (ENABLE,)) for name, mode in MODES),
    *((name, mode, "stop", (STOP,)) for name, mode in MODES),
    *((name, mode, "zero", (ENABLE, ZERO[mode])) for name, mode in MODES if mode in ZERO),
    *(
        (name, Mode.POSITION, "limit", (Call("cap_torque", (0,)), Call("cap_torque", (1.0,))))
        for name in TABLES
        if TRAITS[name].limit
    ),
]

every_map = pytest.mark.parametrize("name", TABLES)
held_and_limp = pytest.mark.parametrize("held", [False, True], ids=["limp", "held"])


def world(name: str, mode: Mode, held: bool, **quirks: Any) -> World:
    """A servo in this mode, far from 0 and from the middle of its turn."""
    made = World(
        Command(
            name=name,
            subject=replace(FAMILY, registers={name: TABLES[name]}),
            ids=(3, 9),
            call=Call("ping"),
            state=lambda device: device.memory["id"],
            address=feetech_address,
            quirks={"model": MODELS[name], **FORGETFUL, **quirks},
        )
    )
    if mode is not Mode.POSITION:
        made.execute(Call("set_mode", (mode,)))
    made.device.raw_position = int(TRAITS[name].turn * 0.7)
    if held:
        made.execute(ENABLE)
    return made


def shaft(made: World) -> float:
    return float(made.device.motion.position(made.now))


def counts(name: str, angle: float) -> float:
    return abs(angle) / TABLES[name]["goal_position"].scale


def cuts(make: Callable[[], World], calls: Sequence[Call]) -> Iterator[World]:
    """This world once for each frame of these calls; its supply will be cut before that frame."""
    whole = make()
    whole.moments.clear()
    for call in calls:
        whole.execute(call)
    assert whole.moments
    for number, moment in enumerate(whole.moments):
        if moment is Moment.BEFORE:
            made = make()
            made.moments.clear()
            made.cuts = [Cut(Kind.POWER, number)]
            yield made


def check_every_cut(make: Callable[[], World], calls: Sequence[Call], most: float = 0.0) -> None:
    """No cut makes the shaft go farther than `most` counts."""
    for made in cuts(make, calls):
        start = shaft(made)
        outcomes = [made.execute(call) for call in calls]
        assert abs(shaft(made) - start) <= most + NOISE, outcomes


@held_and_limp
@pytest.mark.parametrize(
    ("name", "mode", "calls"),
    [
        pytest.param(name, mode, calls, id=f"{name}-{mode.value}-{what}")
        for name, mode, what, calls in COMMANDS
    ],
)
def test_torque_and_stop_do_not_move_shaft_after_power_loss(
    name: str, mode: Mode, calls: tuple[Call, ...], held: bool
) -> None:
    check_every_cut(lambda: world(name, mode, held), calls)


@pytest.mark.parametrize("torque", [False, True], ids=["limp", "on"])
@every_map
def test_enable_torque_does_not_move_shaft_of_servo_that_starts_at_once(name: str, torque: bool) -> None:
    quirks = {"torque_at_power_up": torque, "startup_time": 0.0}
    check_every_cut(lambda: world(name, Mode.POSITION, False, **quirks), (ENABLE,))


@held_and_limp
@every_map
def test_move_goes_no_farther_after_power_loss(name: str, held: bool) -> None:
    goal = world(name, Mode.POSITION, held).execute(Call("position")) - TURN
    move = Call("move", (goal,), {"wait": False})
    check_every_cut(lambda: world(name, Mode.POSITION, held), (move,), counts(name, TURN))


@pytest.mark.parametrize("name", ["sts", "smbl"])
def test_step_goes_no_farther_after_power_loss(name: str) -> None:
    step = Call("step", (TURN,), {"wait": False})
    check_every_cut(lambda: world(name, Mode.STEP, False), (step,), counts(name, TURN))


@every_map
def test_recover_overload_does_not_move_shaft_after_power_loss(name: str) -> None:
    def overloaded() -> World:
        made = world(name, Mode.POSITION, True)
        made.device.alarm = 0x20
        return made

    check_every_cut(overloaded, (Call("recover_overload"),))


class Shaft:
    """A servo that notes where its shaft stood when its supply came back: it counts its turns from there."""

    def __init__(self, made: World) -> None:
        self.servo, self.made = made.device, made
        self.stood = shaft(made)

    @property
    def motion(self) -> Any:
        return self.servo.motion

    def power_cycle(self) -> None:
        self.servo.power_cycle()
        self.stood = self.motion.position(self.made.link.now())


@held_and_limp
@pytest.mark.parametrize("command", [ENABLE, STOP], ids=lambda call: call.method)
@pytest.mark.parametrize("name", [name for name in TABLES if TRAITS[name].many_turns])
def test_servo_that_forgets_its_turns_stays_where_it_is(name: str, held: bool, command: Call) -> None:
    """It may begin to move before that is seen, by no more than fits into a frame."""

    def turned() -> World:
        made = world(name, Mode.POSITION, False)
        for call in (Call("set_multi_turn", (True,)), ENABLE, Call("move", (14.0,))):
            made.execute(call)
        if not held:
            made.execute(Call("disable_torque"))
        made.device = Shaft(made)
        return made

    errors = []
    for made in cuts(turned, (command,)):
        errors.append(str(made.execute(command)))
        assert abs(shaft(made) - made.device.stood) <= 20
    assert any("has forgotten its turns" in error for error in errors)


@every_map
def test_enable_torque_raises_when_supply_fails_with_it(name: str) -> None:
    """By the inrush of its own motor: before the last frame."""
    *_, made = cuts(lambda: world(name, Mode.POSITION, False), (ENABLE,))
    error = made.execute(ENABLE)
    assert isinstance(error, MotionError)
    assert "lost its supply" in error.cause


@every_map
def test_a_move_of_two_goes_no_farther_after_power_loss(name: str) -> None:
    for number in count():
        with (
            motorbus.simulate("feetech", ids="1-2", model=MODELS[name], **FORGETFUL) as sim,
            motorbus.open(sim.url, baud=RATES.get(name, 1_000_000)) as bus,
        ):
            for node in (1, 2):
                sim[node].raw_position = int(TRAITS[name].turn * 0.7)
            goals: dict[Node, float] = {
                servo: servo.position() - TURN for servo in (Servo(bus, 1), Servo(bus, 2))
            }
            start = [sim[node].motion.position(bus.link.now()) for node in (1, 2)]
            link: Any = bus.link
            write, sent = link.write, [0]

            def cut_write(data: Any, sim: Any = sim, write: Any = write, sent: list[int] = sent) -> None:
                if sent[0] == number:  # noqa: B023 - called in this round only
                    sim[1].power_cycle()
                    sim[2].power_cycle()
                sent[0] += 1
                write(data)

            link.write = cut_write
            with suppress(MotionError):  # one that restarted is noticed
                bus.run(move_all(Motion(), goals, wait=False))
            link.write = write
            link.advance(3.0)
            end = [sim[node].motion.position(bus.link.now()) for node in (1, 2)]
            ways = [abs(there - here) for here, there in zip(start, end, strict=True)]
        assert max(ways) <= counts(name, TURN) + NOISE, number
        if number >= sent[0]:
            break
    assert ways == pytest.approx([counts(name, TURN)] * 2, abs=NOISE)
