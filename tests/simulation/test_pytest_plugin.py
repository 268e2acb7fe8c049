"""The fixture that ships with the package, used as its users will."""

from __future__ import annotations

from importlib.metadata import entry_points

import pytest

pytest_plugins = ["pytester"]


def test_a_simulated_bus_from_the_fixture(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import motorbus

        def test_arm_survives_a_dead_servo(motorbus_simulate):
            sim = motorbus_simulate("feetech", ids="1-6", name="arm")
            assert sim.url == "feetech:sim:arm"
            assert sorted(sim.simulator.nodes) == [1, 2, 3, 4, 5, 6]

        def test_it_is_gone_with_its_test(motorbus_simulate):
            motorbus_simulate("feetech", name="arm")
        """
    )
    plugins = (point.value for point in entry_points(group="pytest11"))
    by_hand = () if "motorbus.pytest_plugin" in plugins else ("-p", "motorbus.pytest_plugin")
    pytester.runpytest_inprocess(*by_hand).assert_outcomes(passed=2)
