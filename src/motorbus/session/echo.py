"""The echo test of a bus that was opened, and the warnings to its user."""

from __future__ import annotations

import logging
from typing import Any

from motorbus.bus.base import BaseBus
from motorbus.core.request import Request

LOG = logging.getLogger("motorbus.session")


def echo_test(bus: BaseBus) -> Request[Any] | None:
    """Log the warnings of the bus; return the request that shows an echo, None where the family needs none."""
    for warning in bus.warnings:
        LOG.warning("%s: %s", bus.link.name, warning)
    test = bus.driver.echo_test()
    if test is not None:
        bus.expect_echo(test)
    return test


def tell_echo(bus: BaseBus) -> None:
    """After the test: say that the adapter echoes, if it does."""
    if bus.echoes:
        LOG.warning("%s: the adapter echoes what is sent; the echo is taken off", bus.link.name)
