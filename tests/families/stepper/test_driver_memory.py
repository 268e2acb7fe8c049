"""What was said on a line is kept, and what nobody can know is not made up."""

from __future__ import annotations

from math import inf

from motorbus.families.stepper.driver.memory import Memory, ports_of


def test_in_the_beginning_nothing_is_known() -> None:
    memory = Memory()
    assert (memory.stops, memory.wanted, memory.owed, memory.turning) == (0, 0, False, -inf)
    assert memory.outputs == {1: None, 2: None, 3: None, 5: None}


def test_an_output_is_what_was_last_said_of_it() -> None:
    memory = Memory()
    memory.commanded(ports_of(4), True)
    memory.commanded(ports_of(2), False)
    assert memory.outputs == {1: True, 2: False, 3: True, 5: None}
    memory.commanded(ports_of(5), True)
    memory.commanded(ports_of(4), None)
    assert memory.outputs == {1: None, 2: None, 3: None, 5: True}
