"""Whose error is blamed on the loss of a lease, and whose is not."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from motorbus.errors import Interrupted, MotorbusError, NoReply, Refused
from motorbus.motion.safety.blame import blamed, raise_blamed
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.lease import Lease


def bus(*, lost: bool) -> SimpleNamespace:
    """A bus whose gate has a lease that was lost, or is held for ever."""
    gate = Gate()
    gate.lease = Lease() if lost else Lease(None)
    gate.lease.take("page", 0.0)  # of a gate that was told of no clock, whose time is over
    return SimpleNamespace(admit=gate)


@pytest.mark.parametrize(
    ("error", "ended"),
    [
        (Interrupted("ended by another order"), True),
        (Refused("it is lost", reason="lease"), True),
        (Refused("it is at fault", reason="fault"), False),
        (Refused("no"), False),
        (NoReply("silent"), False),
    ],
)
def test_what_a_lost_lease_ends_or_refuses_is_blamed_on_it_and_nothing_else(
    error: MotorbusError, ended: bool
) -> None:
    error.node = 4
    why = blamed(error, [bus(lost=True)])
    assert (why is not error) is ended
    assert why.node == 4
    assert getattr(why, "reason", "lease") == getattr(error, "reason", "lease")


def test_the_first_bus_whose_lease_is_lost_says_it_and_one_that_has_no_gate_says_nothing() -> None:
    error = Interrupted("ended by another order")
    bare, held = SimpleNamespace(admit=None), bus(lost=False)
    assert blamed(error, [bare, held]) is error
    raise_blamed(error, [bare, held])
    with pytest.raises(Refused) as told:
        raise_blamed(error, [bare, held, bus(lost=True)])
    assert told.value.reason == "lease"
    assert told.value.__cause__ is error
    assert getattr(told.value, "__notes__", []) == []
