"""`motorbus simulate`: devices that any program can open, on a pseudo-terminal or a socket, until Ctrl-C."""

from __future__ import annotations

import signal
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus import families
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Iterator

app = App(
    name="simulate",
    help_epilogue="""Prints one line when it is ready, then serves until Ctrl-C or SIGTERM, and removes
its link and its control socket. Without --link and --tcp it names the
pseudo-terminal it has made. --tcp without a host binds 127.0.0.1; there is no
login. `motorbus simulate FAMILY --help-switches` lists the switches.

Examples:

    motorbus simulate feetech --ids 1-6 --model sts3215 --link /tmp/arm
    motorbus simulate feetech --ids 1-6 --tcp 4000 --pace
    motorbus simulate feetech --link /tmp/arm --control /tmp/arm.control""",
)
