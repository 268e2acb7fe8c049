"""One servo by its address: of this family, one, and nothing of it is sent in a rehearsal."""

from __future__ import annotations

import pytest

from motorbus.cli.kst.servo import named, on_servo, one_of_ours
from motorbus.cli.output import Output
from motorbus.errors import RequestError
from motorbus.simulation.named import Simulation


def test_it_is_one_servo_of_this_family() -> None:
    found = one_of_ours("kst:sim,ids=0x25#0x25")
    assert (found.bus, found.nodes) == ("kst:sim,ids=0x25", (0x25,))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("feetech:sim#1", "no kst bus"),
        ("feetech:sim", "no kst bus"),
        ("kst:sim", "exactly one device"),
        ("kst:sim#1+2", "exactly one device"),
        ("kst:sim#0", "0 addresses all servos"),
        ("kst:sim#128", "not the id of a servo"),
    ],
)
def test_what_is_none_is_refused_without_a_port(text: str, says: str) -> None:
    with pytest.raises(RequestError, match=says):
        one_of_ours(text)


def test_a_rehearsal_sends_nothing(servos: Simulation, capsys: pytest.CaptureFixture[str]) -> None:
    device = f"{servos.url}#37"
    on_servo(device, {}, Output(), lambda servo: servo.move(0.5, wait=False), dry_run=True)
    assert servos[37].memory["goal_position"] == 0
    assert "would send 625#" in capsys.readouterr().out
    assert on_servo(device, {}, Output(), lambda servo: servo.node_id()) == (37, 37)


def test_a_node_is_named_in_both_ways() -> None:
    assert named(37) == "#37 (0x25)"
