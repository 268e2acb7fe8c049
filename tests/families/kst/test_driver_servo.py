"""The servo as a user holds it: spoken to as its bus is, in a blocking and an awaitable face."""

from __future__ import annotations

import asyncio

from motorbus.bus.aio import AsyncBus
from motorbus.families.kst import AsyncServo, Servo
from motorbus.families.kst.driver import ServoVerbs
from motorbus.motion.safety import Gate
from tests.families.kst.bench import bench


def test_a_servo_is_of_the_make_its_bus_is_configured_for() -> None:
    with bench(profile="xqpower") as there:
        assert there.servo().profile.name == "xqpower"
        assert there.servo(profile="kst-ext").profile.name == "kst-ext"
    assert Servo(None, 5).profile.name == "kst"  # type: ignore[arg-type]


def test_every_verb_has_a_docstring_and_both_faces_have_them_all() -> None:
    verbs = {name for name, value in vars(ServoVerbs).items() if not name.startswith("_")}
    assert verbs >= {"move", "stop", "provision", "set_reversed", "status", "save"}
    for name in verbs:
        assert getattr(Servo, name).__doc__, name
        assert hasattr(AsyncServo, name)


def test_the_awaitable_face() -> None:
    async def moved() -> float:
        with bench() as there:
            bus = AsyncBus(there.link, there.family, admit=Gate())
            servo = AsyncServo(bus, 5)
            await servo.move(0.5)
            position = await servo.position()
            await bus.close()
            return position

    assert abs(asyncio.run(moved()) - 0.5) < 0.02
