"""Recovering from an overload, from the shell."""

from __future__ import annotations

import motorbus
from tests.cli.conftest import Run


def test_nothing_to_recover_from(run: Run) -> None:
    with motorbus.simulate("feetech", ids="3") as servo:
        bus = f"{servo.url}#3"
        assert "nothing was done" in run("feetech", "recover-overload", bus).out
        document = run("feetech", "recover-overload", bus, "--json").document
        assert (document["tripped"], document["remaining"]) == ([], [])
        assert "nothing was done" in run("feetech", "recover-overload", bus, "--dry-run").out
        servo[3].voltage = 12.1
        ran = run("feetech", "recover-overload", bus)
        assert "warning: voltage: supply 12.1 V above limit 8.0 V" in ran.err


def test_an_overload_is_recovered_or_told_to_need_a_power_cycle(run: Run) -> None:
    for clears, code in (("torque_off", 0), ("power_cycle", 7)):
        with motorbus.simulate("feetech", ids="3", overload_clears=clears) as servo:
            bus, real = f"{servo.url}#3", servo[3]
            assert run("torque", "on", bus).code == 0
            real.blocked = (2040.0, 2056.0)
            ran = run("move", f"{bus}=200deg")
            assert ran.code == 1
            assert "off its goal" in ran.err
            assert run("monitor", bus, "--count", "20").code == 0  # four seconds more
            ran = run("feetech", "mode", bus)
            assert "the alarm overload has tripped" in ran.out
            assert "`motorbus feetech recover-overload`" in ran.out
            ran = run("feetech", "recover-overload", bus, "--dry-run")
            assert "as far as it can be foreseen" in ran.err
            assert "torque_enable 0 (off)" in ran.out
            ran = run("feetech", "recover-overload", bus)
            assert ran.code == code
            if code:
                assert "switch its supply off and on" in ran.err
            else:
                assert "the alarm overload is gone" in ran.out
            assert real.memory["torque_enable"] == (0 if code else 1)
