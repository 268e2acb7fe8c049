"""The rate a terminal is set to, standard or not."""

from __future__ import annotations

import os
import termios

import pytest
import serialx

from motorbus.link import serial
from motorbus.link.serial import line_speed
from motorbus.simulation.pty import PtyMaster

FEETECH_RATES = (
    1_000_000,
    500_000,
    250_000,
    128_000,
    115_200,
    76_800,
    57_600,
    38_400,
    19_200,
    14_400,
    9_600,
    4_800,
)


@pytest.mark.parametrize("rate", FEETECH_RATES)
def test_every_rate_of_the_servos_is_told_at_both_ends(rate: int, master: PtyMaster) -> None:
    port = serialx.serial_for_url(master.slave_name, baudrate=rate)
    port.open()
    assert (line_speed(port.fileno()), line_speed(master.fileno())) == (rate, rate)
    port.close()


def test_without_the_exact_way_the_usual_rates_are_told(
    master: PtyMaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial, "_termios2_speed", lambda _: 0)
    settings = termios.tcgetattr(master.fileno())
    settings[4] = settings[5] = termios.B57600
    termios.tcsetattr(master.fileno(), termios.TCSANOW, settings)
    assert line_speed(master.fileno()) == 57_600


def test_what_is_no_terminal_has_none() -> None:
    with open(os.devnull) as nothing:
        assert line_speed(nothing.fileno()) is None
