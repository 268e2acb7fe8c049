"""Every way in which a back end fails to open has our words, and something to do about it."""

from __future__ import annotations

import errno
import os

import can
import pytest

from motorbus.errors import LinkError, PortBusy, PortNotFound, RequestError
from motorbus.link.can import open_error
from motorbus.link.can_options import CanOptions, read_options


def config(port: str) -> CanOptions:
    return read_options(can, port, 0, {})


def caused(error: Exception, cause: Exception) -> Exception:
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("port", "error", "kind", "words"),
    [
        (
            "can://socketcan/can0",
            OSError(errno.ENODEV, "No such device"),
            PortNotFound,
            "no socketcan channel can0",
        ),
        ("can://socketcan/can0", OSError(errno.EAFNOSUPPORT, "x"), LinkError, "has no CAN"),
        ("can://vector/0", OSError(errno.EBUSY, "x"), PortBusy, "held by another program"),
        ("can://pcan/1", OSError("pcanbasic library not found."), LinkError, "PCAN-Basic"),
        ("can://kvaser/0", NameError("name 'canOpenChannel' is not defined"), LinkError, "CANlib"),
        ("can://neovi/0", ImportError("Please install python-ics"), LinkError, r"python-can\[neovi\]"),
        (
            "can://systec/0",
            can.CanInterfaceNotImplementedError("no"),
            LinkError,
            "that comes with the adapter",
        ),
        (
            "can://slcan/dev/x",
            can.CanInterfaceNotImplementedError("no serial"),
            LinkError,
            r"motorbus\[can\]",
        ),
        ("can://kvaser/0", ValueError("channel must be an integer"), RequestError, "refuses this"),
        ("can://slcan/dev/x", ValueError("Invalid bitrate"), RequestError, "refuses this"),
        ("can://pcan/1", can.CanInitializationError("in use"), LinkError, "cannot be opened: in use"),
    ],
)
def test_what_it_is_told_as(port: str, error: Exception, kind: type[Exception], words: str) -> None:
    told = open_error(config(port), error)
    assert type(told) is kind
    with pytest.raises(kind, match=words):
        raise told


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (errno.ENOENT, PortNotFound),
        (errno.EACCES, LinkError),
        (errno.EBUSY, PortBusy),
        (errno.EIO, LinkError),
    ],
)
def test_the_serial_port_of_an_adapter(code: int, kind: type[Exception]) -> None:
    error = caused(can.CanInitializationError("could not open port"), OSError(code, os.strerror(code)))
    assert type(open_error(config("can://slcan/dev/ttyACM0"), error)) is kind


def test_the_device_of_an_adapter() -> None:
    assert config("can://slcan/dev/ttyACM0@1000000").device == "/dev/ttyACM0"
    assert config("can://slcan/socket://127.0.0.1:4000").device == ""
    assert config("can://socketcan/can0").device == ""
