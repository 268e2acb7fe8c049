"""One holder at a time, who is there; when he falls silent nothing moves until somebody says so."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from motorbus.errors import MotorbusError, Refused, RequestError
from motorbus.motion.safety.lease import LASTS, Lease, Standing


def held(*, attended: bool = False) -> Lease:
    lease = Lease()
    lease.take("page", 10.0, attended=attended)
    return lease


def test_nothing_may_move_while_nobody_holds_it() -> None:
    with pytest.raises(Refused, match="nobody holds the lease") as caught:
        Lease().check(0.0)
    assert caught.value.reason == "lease"
    assert caught.value.unmoved


def test_who_holds_it_may_until_it_runs_out() -> None:
    lease = held()
    lease.check(10.0 + LASTS)
    assert lease.standing(10.0 + LASTS) is Standing.HELD
    with pytest.raises(Refused, match="page was silent for more than 0.5 s"):
        lease.check(10.0 + LASTS + 1e-6)


def test_a_heartbeat_prolongs_it() -> None:
    lease = held()
    lease.beat("page", 10.4)
    lease.check(10.9)
    assert lease.standing(10.91) is Standing.LOST


@pytest.mark.parametrize("late", ["beat", "take", "release", "attend"])
def test_who_comes_too_late_has_lost_it(late: str) -> None:
    lease = held()
    with pytest.raises(Refused, match="was lost"):
        getattr(lease, late)("page", 11.0)
    assert lease.standing(11.0) is Standing.LOST


def test_what_is_lost_stays_lost_until_it_is_reset_and_is_free_then() -> None:
    lease = held()
    assert lease.standing(11.0) is Standing.LOST
    assert lease.standing(10.1) is Standing.LOST  # time does not go back
    lease.reset(12.0)
    assert lease.standing(12.0) is Standing.FREE
    with pytest.raises(Refused, match="nobody holds it"):
        lease.beat("page", 12.0)
    lease.take("page", 12.0)
    lease.check(12.1)


def test_a_reset_finds_out_first_what_was_lost() -> None:
    lease = held()
    lease.reset(10.1)
    assert lease.standing(10.1) is Standing.HELD
    lease.reset(99.0)
    assert lease.standing(99.0) is Standing.FREE


def test_another_cannot_take_it_nor_keep_it_alive_nor_give_it_back() -> None:
    lease = held()
    for act in (lease.take, lease.beat, lease.release, lease.attend):
        with pytest.raises(Refused, match="page holds"):
            act("shell", 10.1)
    assert lease.holder == "page"


def test_its_holder_may_take_it_again_and_gives_it_back_without_a_loss() -> None:
    lease = held(attended=True)
    lease.take("page", 10.2)
    assert not lease.is_attended(10.2)
    lease.release("page", 10.3)
    assert lease.standing(99.0) is Standing.FREE
    lease.take("shell", 99.0)


def test_who_attends_is_there() -> None:
    lease = held(attended=True)
    assert lease.is_attended(10.5)
    lease.attend("page", 10.5, False)
    assert not lease.is_attended(10.5)
    lease.attend("page", 10.6)
    assert lease.is_attended(11.1)
    assert not lease.is_attended(11.11)
    lease.reset(12.0)
    lease.take("page", 12.0)
    assert not lease.is_attended(12.0)


@pytest.mark.parametrize("lasts", [0.0, -1.0, nan, inf, True, "x", [1.0]])
def test_a_lease_that_never_ends_or_never_was_is_none(lasts: Any) -> None:
    with pytest.raises(RequestError, match="cannot last"):
        Lease(lasts)


def test_one_without_a_time_lasts_until_it_is_given_back() -> None:
    lease = Lease(None)
    lease.take("program", 0.0, attended=True)
    assert lease.is_attended(1e9)
    assert lease.until == inf
    with pytest.raises(Refused, match="held until its holder gives it back"):
        lease.take("page", 1e9)
    lease.release("program", 1e9)
    with pytest.raises(Refused, match="nobody holds the lease"):
        lease.check(1e9)


def test_one_that_is_not_needed_keeps_nobody_from_moving_but_once_it_is_lost() -> None:
    lease = Lease(needed=False)
    lease.check(0.0)
    assert not lease.is_attended(0.0)
    lease.take("program", 0.0)
    assert lease.until == LASTS
    with pytest.raises(Refused, match="program was silent"):
        lease.check(1.0)
    lease.reset(1.0)
    lease.check(1.0)


def test_a_loss_says_that_something_may_have_moved() -> None:
    lease = held()
    assert lease.loss(10.1) is None
    error = lease.loss(11.0)
    assert error is not None
    assert (error.reason, error.unmoved) == ("lease", False)
    assert "nothing was sent" not in str(error)


def test_it_counts_its_losses_each_once() -> None:
    lease = held()
    for now in (10.4, 11.0, 12.0):
        lease.standing(now)
    assert lease.losses == 1
    lease.reset(12.0)
    lease.take("page", 12.0)
    lease.reset(99.0)
    assert lease.losses == 2, "also when nobody looked before the reset"


def test_its_watchers_hear_what_its_holder_says_but_that_he_is_there() -> None:
    lease, heard = Lease(), []
    lease.watchers.append(lambda: heard.append(lease.is_attended(0.0)))
    lease.take("page", 0.0, attended=True)
    lease.beat("page", 0.0)
    lease.attend("page", 0.0, False)
    lease.release("page", 0.0)
    lease.reset(0.0)
    assert heard == [True, False, False, False]


def test_a_holder_has_a_name() -> None:
    with pytest.raises(RequestError, match="name of its holder"):
        Lease().take("", 0.0)


@given(st.lists(st.floats(0, 0.5), max_size=20), st.floats(0.01, 5))
def test_it_never_outlives_the_last_heartbeat(pauses: list[float], lasts: float) -> None:
    lease, now = Lease(lasts), 0.0
    lease.take("page", now)
    for pause in pauses:
        if lease.standing(now + pause) is Standing.HELD:
            now += pause
            lease.beat("page", now)
    assert lease.standing(now + lasts * 1.001 + 1e-9) is Standing.LOST


class Leases(RuleBasedStateMachine):
    """Any order of calls by two holders: who may move has said so lately, and nobody after a loss without a reset."""

    def __init__(self) -> None:
        super().__init__()
        self.lease = Lease()
        self.now = 0.0
        self.beats: dict[str, float] = {}
        self.lost = False

    def _does(self, act: str, holder: str) -> None:
        try:
            getattr(self.lease, act)(holder, self.now)
        except MotorbusError:
            return
        if act == "release":
            self.beats.clear()
        else:
            self.beats = {holder: self.now}

    @rule(seconds=st.floats(0, 0.4))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        if any(self.now - at > LASTS for at in self.beats.values()):
            self.lost, self.beats = True, {}

    @rule(act=st.sampled_from(["take", "beat", "attend", "release"]), holder=st.sampled_from("ab"))
    def does(self, act: str, holder: str) -> None:
        self._does(act, holder)

    @rule()
    def reset(self) -> None:
        self.lease.reset(self.now)
        self.lost = False

    @invariant()
    def who_may_move_has_said_so_lately(self) -> None:
        standing = self.lease.standing(self.now)
        assert (standing is Standing.LOST) == self.lost
        assert (standing is Standing.HELD) == bool(self.beats)


TestLeases = Leases.TestCase


@pytest.mark.parametrize("needed", [True, False])
def test_whether_it_lets_anything_move_is_what_its_check_says(needed: bool) -> None:
    lease = Lease(0.5, needed=needed)
    assert lease.lets_move(0.0) is not needed
    lease.take("me", 0.0)
    for now in (0.5, 0.6, 0.7):
        passed = True
        try:
            lease.check(now)
        except Refused:
            passed = False
        assert lease.lets_move(now) is passed is (now == 0.5)
