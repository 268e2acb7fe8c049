"""A torque-off ends what was ordered before it: nothing older may reach the device after it."""

from __future__ import annotations

from typing import Any

import pytest

from motorbus.bus.ticket import Flight
from motorbus.core.operation import Due, Effect, Exchange, Goal, Rank, Stops
from motorbus.errors import Interrupted, MotorbusError, RequestError
from motorbus.families.feetech import wire
from tests.bus.script import Script, position, probe_reply, reply


def move(node: int, *, effect: Effect = Effect.MOTION, **options: Any) -> Exchange[Any]:
    goal = Goal(node, "position", 1.0, 0.0, 2.0)
    request = wire.write(node, 42, b"\0\1")
    return Exchange(
        request,
        (Due(node, node, 6),),
        effect=effect,
        goals=(goal,),
        repeatable=True,
        rank=Rank.CONTROL,
        **options,
    )


def limp(node: int) -> Exchange[Any]:
    request = wire.write(node, 40, b"\0")
    return Exchange(request, (Due(node, node, 6),), effect=Effect.TORQUE, rank=Rank.STOP, repeatable=True)


def everybody_limp() -> Exchange[Any]:
    return Exchange(wire.write(wire.BROADCAST, 40, b"\0"), (), effect=Effect.TORQUE, rank=Rank.STOP)


def acknowledge(script: Script, node: int) -> None:
    script.feed(wire.encode_status(node, 0))


@pytest.mark.parametrize("effect", [Effect.MOTION, Effect.TORQUE])
def test_an_order_that_is_lost_is_not_sent_again_behind_a_torque_off(effect: Effect) -> None:
    script = Script()
    order = script.submit(move(1, effect=effect))
    script.sent()
    off = script.submit(limp(1))
    with pytest.raises(Interrupted, match="the order was withdrawn") as caught:
        order.result()
    assert "torque-off" in caught.value.cause
    assert "give it again" in caught.value.advice
    script.time_out()
    assert script.sent() == wire.write(1, 40, b"\0")
    acknowledge(script, 1)  # this may be the answer to the lost order
    assert not off.done
    acknowledge(script, 1)
    assert off.done
    assert script.send() is None


def test_an_order_that_waits_is_withdrawn_and_those_of_others_and_later_ones_go() -> None:
    script = Script()
    reading = script.submit(position(1))
    script.sent()
    before, other, kept = (
        script.submit(move(1)),
        script.submit(move(2)),
        script.submit(move(1, effect=Effect.PERSISTENT)),
    )
    script.submit(limp(1))
    later = script.submit(move(1))
    assert isinstance(before.error, Interrupted)
    assert [one.done for one in (other, later, kept)] == [False] * 3
    script.feed(reply(1))
    assert reading.done
    assert reading.error is None
    assert script.sent() == wire.write(1, 40, b"\0")
    acknowledge(script, 1)
    assert script.sent() == wire.write(2, 42, b"\0\1")
    acknowledge(script, 2)
    script.feed(probe_reply(script.sent(), 1))
    for _ in (kept, later):
        assert script.sent() == wire.write(1, 42, b"\0\1")
        acknowledge(script, 1)
    assert [one.error for one in (other, later, kept)] == [None] * 3
    assert script.send() is None


def test_a_torque_off_for_everybody_withdraws_the_orders_for_each() -> None:
    script = Script()
    script.submit(position(3))
    script.sent()
    orders = [script.submit(move(node)) for node in (1, 2)]
    script.submit(everybody_limp())
    assert all(isinstance(order.error, Interrupted) for order in orders)
    script.feed(reply(3))
    assert script.sent() == everybody_limp().request
    assert script.send() is None


def test_who_made_an_order_is_asked_at_every_try_and_told_of_stops() -> None:
    script = Script()
    asked: list[int] = []

    def refusal(stops: Stops) -> MotorbusError | None:
        asked.append(stops(1))
        return RequestError("it is no longer wanted") if len(asked) > 1 else None

    script.submit(limp(1))
    script.sent()
    acknowledge(script, 1)
    order = script.submit(move(1, refusal=refusal))
    script.feed(probe_reply(script.sent(), 1))
    assert asked == []
    script.sent()
    script.time_out()
    script.clear(1)
    assert script.send() is None
    assert asked == [1, 1]
    with pytest.raises(RequestError, match="no longer wanted"):
        order.result()


def test_nor_is_the_gate_asked_about_what_its_maker_refuses() -> None:
    script = Script(admit=pytest.fail)
    order = script.submit(move(1, refusal=lambda _: RequestError("made under other settings")))
    assert script.send() is None
    assert isinstance(order.error, RequestError)
    short = Flight(move(1, refusal=lambda _: RequestError("made under other settings")))
    assert script.turns.short(short, script.now) is None
    assert isinstance(short.error, RequestError)
