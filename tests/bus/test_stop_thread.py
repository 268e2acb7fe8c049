"""Where the system gives no thread, the stop goes through all the same, and the next one has its thread again."""

from __future__ import annotations

from pathlib import Path
from threading import Thread

import pytest

import motorbus
from motorbus.bus.blocking import Bus
from motorbus.bus.stop_socket import request_estop
from motorbus.errors import LinkError, PortNotFound
from motorbus.families.feetech import FAMILY, Servo
from motorbus.link.memory import MemoryLink
from tests.bus.responder import Responder, position
from tests.bus.script import ADMIT_ALL


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
            assert bus.latched
            assert [sim[node].memory["torque_enable"] for node in (1, 2)] == [0, 0]
            bus.reset()
            with pytest.raises(LinkError, match="no more threads"):  # nobody could stop what begins now
                Servo(bus, 1).enable_torque()
            assert sim[1].memory["torque_enable"] == 0
        Servo(bus, 1).enable_torque()
        assert bus.estop().acknowledged == (1, 2)
        assert sim[1].memory["torque_enable"] == 0


def test_a_port_that_is_called_otherwise_by_now_is_stopped_under_that_name(tmp_path: Path) -> None:
    old, new = tmp_path / "old.sock", tmp_path / "new.sock"
    bus = Bus(MemoryLink(Responder(), virtual=False), FAMILY.open(), interlock=ADMIT_ALL, stop_socket=old)
    bus.run(position(1))
    bus.stopper.move(new)
    assert request_estop(new).acknowledged == (1,)
    with pytest.raises(PortNotFound):
        request_estop(old)
    bus.stopper.move(None)  # something else is called so
    new.touch()
    with pytest.raises(PortNotFound):
        request_estop(new)
    bus.stopper.move(old)
    assert request_estop(old).acknowledged == (1,)
    bus.close()
    assert list(tmp_path.iterdir()) == [new], "what is somebody else's is left there"


def test_a_bus_that_no_other_program_reaches_has_nothing_to_move() -> None:
    bus = Bus(MemoryLink(Responder(), virtual=False), FAMILY.open(), interlock=ADMIT_ALL)
    bus.stopper.move(Path("/nowhere"))
    assert bus.stopper.socket_path is None
    bus.close()
