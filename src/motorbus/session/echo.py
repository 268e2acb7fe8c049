"""The echo test of a bus that is opened, and the warnings for its user."""

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


def warn_of_echo(bus: BaseBus) -> None:
    """Log that the adapter echoes, if the test has shown it."""
    if bus.echoes:
        LOG.warning("%s: the adapter echoes what is sent; the echo is taken off", bus.link.name)
