"""Where the system gives no thread, the stop goes through all the same, and the next one has its thread again."""

from __future__ import annotations

from threading import Thread

import pytest

import motorbus
from motorbus.errors import LinkError
from motorbus.families.feetech import Servo


def test_without_a_thread_to_be_had_the_caller_stops_the_bus_himself(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(thread: Thread) -> None:
        raise RuntimeError("can't start new thread")

    with motorbus.simulate("feetech", ids="1-2", clock="real") as sim, motorbus.open(sim.url) as bus:
        for node in (1, 2):
            Servo(bus, node).ping()
            sim[node].memory["torque_enable"] = 1
        with monkeypatch.context() as patched:
            patched.setattr(Thread, "start", refused)
            assert bus.estop().acknowledged == (1, 2)
            assert bus.turns.latched
            assert [sim[node].memory["torque_enable"] for node in (1, 2)] == [0, 0]
            bus.reset()
            with pytest.raises(LinkError, match="no more threads"):  # nobody could stop what begins now
                Servo(bus, 1).enable_torque()
            assert sim[1].memory["torque_enable"] == 0
        Servo(bus, 1).enable_torque()
        assert bus.estop().acknowledged == (1, 2)
        assert sim[1].memory["torque_enable"] == 0
