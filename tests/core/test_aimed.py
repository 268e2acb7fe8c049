"""An order made in a mould is an exchange like any other: what it is asked, it answers as one that was made in full."""

from __future__ import annotations

from collections.abc import Sequence

from motorbus.core.aimed import Aim, Aimed
from motorbus.core.operation import Answer, Effect, Exchange, Goal, Rank, Stops
from motorbus.errors import MotorbusError, RequestError

NOBODY = Answer((), (), 1.0)
NOT_ONE = ("request", "read", "refusal", "goals")


class Asked:
    """An aim that counts how often goals are made."""

    def __init__(self, why: MotorbusError | None = None) -> None:
        self.times = 0
        self.why = why

    def goals(self, raws: Sequence[int]) -> tuple[Goal, ...]:
        self.times += 1
        return tuple(
            Goal(node, "position", float(raw), 0.0, 9.0) for node, raw in zip((1, 2), raws, strict=True)
        )

    def refusal(self, _: Stops) -> MotorbusError | None:
        return self.why

    def aimed(self) -> Aimed:
        return Aimed(b"\x01\x02", Aim((1, 2), self.goals, self.refusal), (3, 4))


def test_it_is_asked_for_everything_that_an_exchange_is_asked_for() -> None:
    asked = Asked()
    order = asked.aimed()
    full: Exchange[None] = Exchange(
        order.request, (), lambda _: None, rank=Rank.CONTROL, effect=Effect.MOTION, goals=order.goals
    )
    for name in set(Exchange.__slots__) - set(NOT_ONE):
        assert getattr(order, name) == getattr(full, name), name
    assert order.goals == full.goals
    assert list(order.ordered) == full.ordered == [1, 2]
    assert repr(order) == repr(full) == "<Exchange 01 02>"
    assert next(iter(order)) is order
    assert (order.sure, full.sure) == (True, False)
    order.read(NOBODY)


def test_its_goals_are_made_when_somebody_looks_and_once() -> None:
    asked = Asked()
    order = asked.aimed()
    assert asked.times == 0
    assert order.goals is order.goals
    assert order.goals == (Goal(1, "position", 3.0, 0.0, 9.0), Goal(2, "position", 4.0, 0.0, 9.0))
    assert asked.times == 1


def test_another_aim_changes_who_refuses_it_and_nothing_else() -> None:
    order, other = Asked().aimed(), Asked(RequestError("no"))
    again = order.under(Aim((1, 2), other.goals, other.refusal))
    assert again.goals == order.goals
    assert again.request == order.request
    assert order.refusal(lambda _: 0) is None
    assert again.refusal(lambda _: 0) is other.why


def test_its_answer_may_be_read_in_another_way() -> None:
    order = Asked(RequestError("no")).aimed()
    again = order.reading(lambda answer: answer.at)
    assert again.read is not None
    assert again.read(NOBODY) == 1.0
    same = (again.request, again.goals, again.effect, again.rank, again.replies)
    assert same == (order.request, order.goals, Effect.MOTION, Rank.CONTROL, ())
    assert again.refusal is not None
    assert again.refusal(lambda _: 0) is order.refusal(lambda _: 0)
