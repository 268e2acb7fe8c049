"""What a movement was ended by: the loss of its lease, where it is that."""

from __future__ import annotations

import pytest

from motorbus.errors import Interrupted, NoReply, Refused
from motorbus.motion.safety.blame import blamed, raise_blamed
from motorbus.motion.safety.gate import Gate
from motorbus.motion.safety.lease import Lease


def test_who_was_ended_by_the_loss_of_the_lease_is_told_so() -> None:
    class Bus:
        admit = Gate()

    error, other = Interrupted("ended by another order", node=3), NoReply("silent")
    error.add_note("also: this")
    assert blamed(error, [Bus]) is error
    raise_blamed(error, [Bus])
    Bus.admit.lease = lease = Lease()
    lease.take("page", 0.0)  # of a gate that was told of no clock, whose time is over
    assert blamed(other, [Bus]) is other
    why = blamed(error, [Bus])
    assert isinstance(why, Refused)
    assert (why.reason, why.node, why.__notes__) == ("lease", 3, ["also: this"])
    with pytest.raises(Refused) as told:
        raise_blamed(error, [Bus])
    assert told.value.__cause__ is error
