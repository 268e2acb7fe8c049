"""Who has obeyed a stop: only who gave every reply that stopping it calls for, and did not say no."""

from __future__ import annotations

from typing import Any

from motorbus.bus import obedience
from motorbus.bus.ticket import Flight
from motorbus.core.operation import ANY, Answer, Due, Effect, Exchange
from motorbus.errors import DeviceError


def order(*nodes: int, key: str = "off", effect: Effect = Effect.TORQUE, **more: Any) -> Exchange[Answer]:
    return Exchange(b"\x01", tuple(Due(node, (node, key), 6) for node in nodes), effect=effect, **more)


def test_who_acknowledges() -> None:
    assert obedience.nodes(order(1, 2)) == [1, 2]
    assert obedience.nodes(Exchange(b"\x01", ANY)) == []
    assert obedience.answered([Exchange(b"\x01"), order(3)])
    assert not obedience.answered([Exchange(b"\x01")])


def test_who_gave_one_of_two_replies_has_not_obeyed() -> None:
    both = [Flight(order(1)), Flight(order(1, key="hold")), Flight(order(2))]
    assert obedience.obeyed(both, [], []) == [1, 2]
    assert obedience.obeyed(both, both[1:2], []) == [2]
    assert obedience.obeyed(both, [], [1]) == [2], "who had obeyed before is not told again"


def test_who_was_only_asked_has_not_obeyed() -> None:
    assert obedience.obeyed([Flight(order(1, effect=Effect.NONE))], [], []) == []


def test_a_refusal_is_no_obedience() -> None:
    def refuse(answer: Answer) -> Answer:
        raise DeviceError("no", node=1)

    flight = Flight(order(1, read=refuse))
    flight.finish(Answer((), (), 0.0))
    assert obedience.refused(flight)
    assert not obedience.refused(Flight(order(1)))
