"""A servo that loses its supply for a moment, between any two packets: no verb may send it to a goal it has forgotten.

It comes back limp, with its goal at 0 and its speed at the maximum; whoever then switched its torque on would send it
thousands of counts away. The supply is cut before each packet of each verb, in every mode of every map, and the shaft
may not go farther than it was told to.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

import motorbus
from motorbus.cli.feetech import move_together
from motorbus.errors import MotionError, MotorbusError
from motorbus.families.feetech import Servo
from motorbus.families.feetech.table import CONTROL, TABLES, Mode
from tests.families.feetech.maps import MODELS
from tests.families.feetech.test_driver_every_map import MODES, RATES, later, world

if TYPE_CHECKING:
    from collections.abc import Iterator

FORGETFUL: dict[str, Any] = {"goal_at_power_up": "zero", "zero_velocity": "maximum"}
TURN = 0.1
"""rad that a move or a step is told to go."""
NOISE = 2.0
"""Counts."""


def stand(simulated: Any) -> int:
    """Far from 0 and from the middle, where a forgotten goal would show."""
    return int(simulated.model.turn * 0.7)


@contextmanager
def cut_before(bus: Any, packet: int, servos: list[Any]) -> Iterator[list[bytes]]:
    """Before so many packets from here have left, the supply of these fails for a moment; gives all that leave."""
    sent: list[bytes] = []
    write = bus.link.write

    def counted(data: bytes) -> None:
        if len(sent) == packet:
            for servo in servos:
                servo.power_cycle()
        sent.append(bytes(data))
        write(data)

    bus.link.write = counted
    try:
        yield sent
    finally:
        bus.link.write = write


def gone(
    name: str,
    mode: Mode,
    verb: Callable[[Any], object],
    packet: int,
    *,
    held: bool,
    before: Callable[[Any], object] = lambda _: None,
    **options: Any,
) -> tuple[float, int, object]:
    """Counts that the shaft has gone in the end, packets, and what the verb told or raised."""
    with world(name, **FORGETFUL, **options) as (bus, servo, simulated):
        if mode is not Mode.POSITION:
            servo.set_mode(mode)
        simulated.raw_position = stand(simulated)
        if held:
            servo.enable_torque()
        before(simulated)
        here = simulated.motion.position(bus.link.now())
        with cut_before(bus, packet, [simulated]) as sent:
            try:
                told: object = verb(servo)
            except MotorbusError as error:
                told = error
        later(bus, 3.0)
        return simulated.motion.position(bus.link.now()) - here, len(sent), told


def every_cut(name: str, mode: Mode, verb: Callable[[Any], object], most: float, **how: Any) -> None:
    """No cut makes it go farther than `most` counts; and there is something to cut."""
    _, packets, _ = gone(name, mode, verb, -1, **how)
    assert packets > 0
    for packet in range(packets + 1):
        way, _, told = gone(name, mode, verb, packet, **how)
        assert abs(way) <= most + NOISE, (
            f"cut before packet {packet} of {packets}: {way:.0f} counts, {told!r}"
        )


def counts(name: str, angle: float) -> float:
    return abs(angle) / TABLES[name]["goal_position"].scale


@pytest.mark.parametrize("held", [False, True], ids=["limp", "held"])
@pytest.mark.parametrize(("name", "mode"), MODES, ids=lambda value: getattr(value, "value", value))
def test_torque_on(name: str, mode: Mode, held: bool) -> None:
    every_cut(name, mode, lambda servo: servo.enable_torque(), 0, held=held)


@pytest.mark.parametrize("torque", [False, True], ids=["limp", "on"])
@pytest.mark.parametrize("name", TABLES)
def test_torque_on_where_the_torque_comes_back_with_the_supply(name: str, torque: bool) -> None:
    every_cut(
        name,
        Mode.POSITION,
        lambda servo: servo.enable_torque(),
        0,
        held=False,
        torque_at_power_up=torque,
        startup_time=0.0,
    )


@pytest.mark.parametrize("held", [False, True], ids=["limp", "held"])
@pytest.mark.parametrize("name", TABLES)
def test_move(name: str, held: bool) -> None:
    def verb(servo: Servo) -> None:
        servo.move(servo.position() - TURN, wait=False)

    every_cut(name, Mode.POSITION, verb, counts(name, TURN), held=held)


@pytest.mark.parametrize("name", ["sts", "smbl"])
def test_step(name: str) -> None:
    every_cut(name, Mode.STEP, lambda servo: servo.step(TURN, wait=False), counts(name, TURN), held=False)


@pytest.mark.parametrize("held", [False, True], ids=["limp", "held"])
@pytest.mark.parametrize(("name", "mode"), MODES, ids=lambda value: getattr(value, "value", value))
def test_stop(name: str, mode: Mode, held: bool) -> None:
    every_cut(name, mode, lambda servo: servo.stop(), 0, held=held)


@pytest.mark.parametrize("name", TABLES)
def test_recover_overload(name: str) -> None:
    every_cut(
        name,
        Mode.POSITION,
        lambda servo: servo.recover_overload(),
        0,
        held=True,
        before=lambda simulated: setattr(simulated, "alarm", 0x20),
    )


ORDERS: dict[Mode, Callable[[Any], object]] = {
    Mode.VELOCITY: lambda servo: servo.set_velocity(0.0),
    Mode.PWM: lambda servo: servo.set_duty(0.0),
    Mode.CURRENT: lambda servo: servo.set_current(0.0),
}


@pytest.mark.parametrize(
    ("name", "mode"),
    [one for one in MODES if one[1] in ORDERS],
    ids=lambda value: getattr(value, "value", value),
)
def test_torque_on_and_an_order_to_stay(name: str, mode: Mode) -> None:
    def verb(servo: Servo) -> None:
        servo.enable_torque()
        ORDERS[mode](servo)

    every_cut(name, mode, verb, 0, held=False)


@pytest.mark.parametrize("name", [name for name in TABLES if CONTROL[name].limit])
def test_a_torque_limit_that_is_raised_again(name: str) -> None:
    def verb(servo: Servo) -> None:
        servo.set_torque_limit(0)
        servo.set_torque_limit(1.0)

    every_cut(name, Mode.POSITION, verb, 0, held=True)


@pytest.mark.parametrize("name", TABLES)
def test_move_together(name: str) -> None:
    def one(packet: int) -> tuple[list[float], int]:
        told: dict[str, Any] = {"ids": "1-2", "model": MODELS[name], **FORGETFUL}
        with (
            motorbus.simulate("feetech", **told) as sim,
            motorbus.open(sim.url, baud=RATES.get(name, 1_000_000)) as bus,
        ):
            for node in (1, 2):
                sim[node].raw_position = stand(sim[node])
            goals = {node: Servo(bus, node).position() - TURN for node in (1, 2)}
            start = [sim[node].motion.position(bus.link.now()) for node in (1, 2)]
            with cut_before(bus, packet, [sim[1], sim[2]]) as sent:
                move_together(bus, goals, wait=False)
            later(bus, 3.0)
            end = [sim[node].motion.position(bus.link.now()) for node in (1, 2)]
            return [abs(there - here) for here, there in zip(start, end, strict=True)], len(sent)

    ways, packets = one(-1)
    assert ways == pytest.approx([counts(name, TURN)] * 2, abs=NOISE)
    for packet in range(packets + 1):
        ways, _ = one(packet)
        assert max(ways) <= counts(name, TURN) + NOISE, f"cut before packet {packet} of {packets}: {ways}"


class Shaft:
    """Where the shaft stood at first, or when the supply failed: then the turns are counted anew."""

    def __init__(self, bus: Any, simulated: Any) -> None:
        self._bus, self._simulated = bus, simulated
        self.stood = simulated.motion.position(bus.link.now())

    def power_cycle(self) -> None:
        self._simulated.power_cycle()
        self.stood = self._simulated.motion.position(self._bus.link.now())


@pytest.mark.parametrize("verb", ["enable_torque", "stop"])
@pytest.mark.parametrize("held", [False, True], ids=["limp", "held"])
@pytest.mark.parametrize("name", [name for name in TABLES if CONTROL[name].many_turns])
def test_turns_that_it_counts_are_forgotten_with_the_supply(name: str, held: bool, verb: str) -> None:
    """What it told before is turns away from where it says it stands then; it has begun to move by the time that this
    is seen, by no more than fits into a packet."""

    def one(packet: int) -> tuple[float, int, object]:
        with world(name, **FORGETFUL) as (bus, servo, simulated):
            servo.set_many_turns(True)
            servo.enable_torque()
            servo.move(14.0)
            if not held:
                servo.disable_torque()
            shaft = Shaft(bus, simulated)
            with cut_before(bus, packet, [shaft]) as sent:
                try:
                    told: object = getattr(servo, verb)()
                except MotorbusError as error:
                    told = error
            later(bus, 3.0)
            return simulated.motion.position(bus.link.now()) - shaft.stood, len(sent), told

    _, packets, _ = one(-1)
    seen = []
    for packet in range(packets + 1):
        way, _, told = one(packet)
        assert abs(way) <= 20, f"cut before packet {packet} of {packets}: {way:.0f} counts, {told!r}"
        seen.append("has forgotten its turns" in str(told))
    assert any(seen)


@pytest.mark.parametrize("name", TABLES)
def test_torque_that_went_with_the_supply_is_no_success(name: str) -> None:
    """Its own inrush: the supply fails as soon as the torque is on."""

    def verb(servo: Servo) -> None:
        servo.enable_torque()

    _, packets, _ = gone(name, Mode.POSITION, verb, -1, held=False)
    way, _, told = gone(name, Mode.POSITION, verb, packets - 1, held=False)
    assert abs(way) <= NOISE
    assert isinstance(told, MotionError)
    assert "lost its supply" in told.cause
