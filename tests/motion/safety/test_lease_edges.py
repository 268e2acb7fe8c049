"""The moment at which a lease is lost, what its holder may say, and what those are told who may not."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any

import pytest

from motorbus.errors import Refused, RequestError
from motorbus.motion.safety.lease import Lease, Standing, check_lasts


def held(lasts: float | None = 0.5, **options: Any) -> Lease:
    lease = Lease(lasts)
    lease.take("ann", 1.0, **options)
    return lease


def refusal(work: Any, *arguments: Any) -> Refused:
    with pytest.raises(Refused) as caught:
        work(*arguments)
    assert caught.value.reason == "lease"
    return caught.value


def test_it_is_held_up_to_its_very_end_and_lost_after_it() -> None:
    lease = held()
    assert lease.until == 1.5
    assert [lease.standing(at) for at in (1.5, 1.5001)] == [Standing.HELD, Standing.LOST]
    assert (lease.losses, lease.holder, lease.until) == (1, "", inf)
    assert [lease.standing(at) for at in (1.0, 9.0)] == [Standing.LOST, Standing.LOST]
    assert lease.losses == 1


def test_a_clock_that_goes_back_prolongs_nothing() -> None:
    lease = held()
    lease.standing(1.4)
    lease.beat("ann", 1.0)
    assert lease.until == 1.9
    assert lease.standing(0.0) is Standing.HELD


def test_one_that_does_not_run_out_is_held_for_ever() -> None:
    lease = held(None)
    assert lease.until == inf
    assert lease.standing(1e9) is Standing.HELD


def test_whoever_was_lost_is_told_until_somebody_resets_it() -> None:
    lease = held(attended=True)
    assert lease.loss(1.5) is None
    loss = lease.loss(2.0)
    assert loss is not None
    assert "ann was silent for more than 0.5 s" in loss.summary
    assert not loss.unmoved
    assert not lease.is_attended(2.0)
    for work, arguments in (
        (lease.take, ("ann", 2.0)),
        (lease.beat, ("ann", 2.0)),
        (lease.attend, ("ann", 2.0)),
        (lease.release, ("ann", 2.0)),
        (lease.check, (2.0,)),
    ):
        assert "was lost" in refusal(work, *arguments).summary
    lease.reset(2.0)
    assert [lease.standing(2.0), lease.loss(2.0)] == [Standing.FREE, None]
    lease.take("bob", 2.0)
    assert lease.standing(2.5) is Standing.HELD
    assert not lease.is_attended(2.0)


def test_a_reset_sees_first_whether_it_has_been_lost_meanwhile() -> None:
    lease = held()
    lease.reset(9.0)
    assert (lease.losses, lease.standing(9.0)) == (1, Standing.FREE)


def test_only_its_holder_has_a_word_and_others_are_told_whose_it_is() -> None:
    lease = held()
    for work in (lease.beat, lease.attend, lease.release):
        assert (
            "bob does not hold the lease of this machine: ann holds it" in refusal(work, "bob", 1.0).summary
        )
        refusal(work, "", 1.0)
    error = refusal(lease.take, "bob", 1.25)
    assert error.summary == "ann holds the lease of this machine"
    assert "for 0.25 s at least" in str(error.expected)
    assert "until its holder gives it back" in str(refusal(held(None).take, "bob", 1.0).expected)
    lease.release("ann", 1.25)
    assert "nobody holds it" in refusal(lease.beat, "ann", 1.25).summary
    refusal(lease.beat, "", 1.25)


def test_to_attend_counts_as_a_sign_of_life_and_ends_with_the_holder() -> None:
    lease = held()
    assert not lease.is_attended(1.0)
    lease.attend("ann", 1.25)
    assert lease.until == 1.75
    assert lease.is_attended(1.75)
    lease.attend("ann", 1.75, False)
    assert not lease.is_attended(1.75)
    lease.attend("ann", 1.75)
    lease.release("ann", 1.75)
    lease.take("bob", 1.75)
    assert not lease.is_attended(1.75)
    lease.take("bob", 1.75, attended=True)
    assert lease.is_attended(1.75)


def test_those_who_watch_are_told_of_every_word_but_a_sign_of_life() -> None:
    lease, heard = Lease(0.5), [0]
    lease.watchers.append(lambda: heard.append(len(heard)))
    words: tuple[Callable[[], None], ...] = (
        lambda: lease.take("ann", 1.0),
        lambda: lease.beat("ann", 1.0),
        lambda: lease.attend("ann", 1.0),
        lambda: lease.release("ann", 1.0),
        lambda: lease.reset(1.0),
    )
    told = []
    for word in words:
        before = len(heard)
        word()
        told.append(len(heard) - before)
    assert told == [1, 0, 1, 1, 1]


def test_one_that_is_needed_lets_nothing_move_while_nobody_has_it() -> None:
    assert "nobody holds the lease" in refusal(Lease().check, 0.0).summary
    Lease(needed=False).check(0.0)
    held().check(1.0)


@pytest.mark.parametrize("lasts", [0, 0.0, -1.0, inf, nan, True, "1"])
def test_what_is_no_time_is_none_that_it_can_last(lasts: object) -> None:
    with pytest.raises(RequestError):
        check_lasts(lasts)


@pytest.mark.parametrize("lasts", [None, 1, 1e-9, 1e9])
def test_every_finite_time_above_zero_is_one(lasts: object) -> None:
    check_lasts(lasts)


def test_a_holder_has_a_name() -> None:
    with pytest.raises(RequestError, match="name of its holder"):
        Lease().take("", 0.0)
