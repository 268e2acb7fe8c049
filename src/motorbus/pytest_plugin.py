"""A fixture for everyone who tests code that drives motors: simulated buses that go away with the test.

pytest finds it by itself once motorbus is installed; nothing is imported until a test asks for it.

    def test_arm_survives_a_dead_servo(motorbus_simulate):
        sim = motorbus_simulate("feetech", ids="1-6")
        with motorbus.open(sim.url) as bus:
            sim[3].unplug()
            ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from motorbus.simulation.named import Simulation


@pytest.fixture
def motorbus_simulate() -> Iterator[Callable[..., Simulation]]:
    """Makes simulated buses as `motorbus.simulate` does, with the same arguments, and closes them after the test."""
    from motorbus.session import simulate

    with ExitStack() as stack:

        def make(family: str, **options: object) -> Simulation:
            return stack.enter_context(simulate(family, **options))  # type: ignore[arg-type]

        yield make
