"""A picture of a controller shows what it was, whatever becomes of it later."""

from __future__ import annotations

import pytest

from motorbus.errors import RequestError
from motorbus.families.stepper.execution import Phase
from motorbus.families.stepper.simulator import simulate


def test_it_shows_what_was_even_when_all_is_different_by_now() -> None:
    bus = simulate((1,))
    there = bus.nodes[1]
    ((node, before),) = bus.sight(0.0)
    rows, images = dict(there.memory), [there.store.image(number) for number in (1, 2, 3, 4)]
    there.store.edit("set_step_delay", {"step": 1, "delay": 4321})
    there.store.clear(1)
    there.set_input(2, True)
    ((_, after),) = bus.sight(1.0)
    assert node == 1
    assert {name: bus.shown(before, name) for name in rows} == rows
    assert [bus.shown(before, f"image_{number}") for number in (1, 2, 3, 4)] == images
    assert {name: bus.shown(after, name) for name in rows} == dict(there.memory) != rows
    assert (bus.shown(before, "input_2"), bus.shown(after, "input_2")) == (0, 1)
    assert before != after


@pytest.mark.parametrize("flags_scope", ["project", "device"])
def test_pins_selection_flags_and_phase(flags_scope: str) -> None:
    bus = simulate((1,), flags_scope=flags_scope)
    there = bus.nodes[1]
    there.store.edit("set_mode4", {"mode4": 1})
    there.store.edit("select_project", {"project": 3})
    ((_, seen),) = bus.sight(0.0)
    assert bus.shown(seen, "selected") == 3
    assert bus.shown(seen, "mode4") == dict(there.memory)["mode4"]
    assert [bus.shown(seen, name) for name in ("output_1", "output_3", "leds")] == [0, 0, 0]
    assert bus.shown(seen, "phase") == list(Phase).index(there.state.phase)
    with pytest.raises(RequestError):
        bus.shown(seen, "input_9")
