"""An adapter is known by what stays when it is plugged in anew, and no other is taken for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from motorbus.errors import LinkLost, PortNotFound
from motorbus.link.reconnect import Identity, find_adapter, identify, usb_socket
from tests.links.usb import usb_port

NUMBERED = {"device": "/dev/ttyACM0", "resolved_device": "/dev/ttyACM0"}


def lister(*ports: dict[str, Any]) -> Callable[[], list[Any]]:
    return lambda: [usb_port(**{"device": port["resolved_device"], **port}) for port in ports]


def plugged(root: Path, name: str, where: str) -> Path:
    """The kernel's tree, with this device at this place of the USB."""
    interface = root / "devices" / "usb1" / where.partition(":")[0] / where
    interface.mkdir(parents=True, exist_ok=True)
    terminal = root / "class" / "tty" / name
    terminal.mkdir(parents=True, exist_ok=True)
    (terminal / "device").unlink(missing_ok=True)
    (terminal / "device").symlink_to(interface)
    return root


def known(**about: Any) -> Identity:
    return identify("/dev/ttyACM0", lister({**NUMBERED, **about}))


def test_l12_the_same_serial_number_is_found_under_another_name() -> None:
    there = lister(
        {"resolved_device": "/dev/ttyACM1"}, {"resolved_device": "/dev/ttyACM0", "serial_number": "B"}
    )
    assert find_adapter("bus", known(), there) == "/dev/ttyACM1"


def test_l12_another_adapter_at_its_place_is_refused() -> None:
    with pytest.raises(
        LinkLost, match="another in its place: the adapter 1a86:55d3 with the serial number B"
    ) as told:
        find_adapter("bus", known(), lister({**NUMBERED, "serial_number": "B"}))
    assert told.value.expected == "the adapter 1a86:55d3 with the serial number 585A0076891"


@pytest.mark.parametrize(
    "about",
    [{"vid": 0x0403}, {"pid": 0x55D2}, {"serial_number": None}, {"interface_num": 2}, {"port_number": 1}],
)
def test_one_that_differs_in_anything_is_another(about: dict[str, Any]) -> None:
    with pytest.raises(LinkLost, match="another in its place"):
        find_adapter("bus", known(), lister({**NUMBERED, **about}))
    with pytest.raises(PortNotFound):
        find_adapter("bus", known(), lister({"resolved_device": "/dev/ttyACM1", **about}))


def test_while_it_is_away_there_is_no_such_port() -> None:
    with pytest.raises(PortNotFound, match="with the serial number 585A0076891 is not there"):
        find_adapter("bus", known(), lister())


def test_l12_without_a_serial_number_its_place_on_the_usb_counts(tmp_path: Path) -> None:
    plugged(tmp_path, "ttyUSB0", "1-1.2:1.0")
    nameless = {"vid": 0x1A86, "pid": 0x7523, "serial_number": None}
    mine = identify("/dev/ttyUSB0", lister({"resolved_device": "/dev/ttyUSB0", **nameless}), tmp_path)
    assert mine.place == "1-1.2:1.0"
    plugged(tmp_path, "ttyUSB0", "1-1.3:1.0")
    plugged(tmp_path, "ttyUSB1", "1-1.2:1.0")
    both = lister(
        {"resolved_device": "/dev/ttyUSB0", **nameless}, {"resolved_device": "/dev/ttyUSB1", **nameless}
    )
    assert find_adapter("bus", mine, both, tmp_path) == "/dev/ttyUSB1"
    with pytest.raises(LinkLost, match="at the USB place 1-1.3:1.0"):
        find_adapter("bus", mine, lister({"resolved_device": "/dev/ttyUSB0", **nameless}), tmp_path)


def test_of_several_with_one_serial_number_that_at_its_place_is_it(tmp_path: Path) -> None:
    plugged(tmp_path, "ttyACM0", "1-1:1.0")
    mine = identify("/dev/ttyACM0", lister(NUMBERED), tmp_path)
    plugged(tmp_path, "ttyACM1", "1-1:1.0")
    plugged(tmp_path, "ttyACM0", "1-2:1.0")
    both = lister(NUMBERED, {"resolved_device": "/dev/ttyACM1"})
    assert find_adapter("bus", mine, both, tmp_path) == "/dev/ttyACM1"
    plugged(tmp_path, "ttyACM1", "1-3:1.0")
    with pytest.raises(LinkLost, match="several adapters could be it"):
        find_adapter("bus", mine, both, tmp_path)


def test_a_port_on_no_usb_is_known_by_its_name(tmp_path: Path) -> None:
    plain = {"vid": None, "pid": None, "serial_number": None}
    mine = identify("/dev/ttyS0", lister({"resolved_device": "/dev/ttyS0", **plain}))
    assert mine.text == "the port /dev/ttyS0"
    assert find_adapter("bus", mine, lister({"resolved_device": "/dev/ttyS0", **plain})) == "/dev/ttyS0"
    untold = tmp_path / "tty"
    untold.touch()
    assert find_adapter("bus", identify(str(untold), lister()), lister()) == str(untold)


def test_without_a_place_the_name_must_be_the_same(tmp_path: Path) -> None:
    nameless = {"vid": 0x1A86, "pid": 0x7523, "serial_number": None}
    here = lister({"resolved_device": "/dev/ttyUSB0", **nameless})
    mine = identify("/dev/ttyUSB0", here, tmp_path)
    assert mine.text == "the adapter 1a86:7523 at /dev/ttyUSB0"
    assert find_adapter("bus", mine, here, tmp_path) == "/dev/ttyUSB0"
    with pytest.raises(PortNotFound):
        find_adapter("bus", mine, lister({"resolved_device": "/dev/ttyUSB1", **nameless}), tmp_path)


def test_where_the_system_says_nothing_there_is_no_place(tmp_path: Path) -> None:
    assert usb_socket("/dev/ttyACM0", tmp_path) == ""
