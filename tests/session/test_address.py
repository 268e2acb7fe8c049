"""Addresses of buses and devices, as people write them."""

from __future__ import annotations

import pytest

from motorbus.errors import RequestError
from motorbus.session.address import Address, parse_address, parse_ids


@pytest.mark.parametrize(
    ("text", "parsed"),
    [
        ("feetech:/dev/ttyACM0", Address("feetech", "/dev/ttyACM0", {})),
        (
            "feetech:/dev/ttyACM0,baud=500000#3",
            Address("feetech", "/dev/ttyACM0", {"baud": "500000"}, (3,)),
        ),
        ("feetech:COM7#1-3+7", Address("feetech", "COM7", {}, (1, 2, 3, 7))),
        ("feetech:socket://10.0.0.7:4000", Address("feetech", "socket://10.0.0.7:4000", {})),
        ("feetech:sim,ids=1-6,model=sts3215", Address("feetech", "sim", {"ids": "1-6", "model": "sts3215"})),
        (
            "kst:can://socketcan/can0,bitrate=500000",
            Address("kst", "can://socketcan/can0", {"bitrate": "500000"}),
        ),
        ("feetech:sim:arm", Address("feetech", "sim:arm", {})),
    ],
)
def test_an_address_has_family_port_options_and_nodes(text: str, parsed: Address) -> None:
    assert parse_address(text) == parsed
    assert parse_address(parsed.bus) == parsed._replace(nodes=())


@pytest.mark.parametrize(
    "text",
    [
        "",
        "feetech",
        "feetech:",
        ":port",
        "/dev/ttyACM0",
        "feetech:x#",
        "feetech:x#a",
        "feetech:x,baud",
        "feetech:x,=3",
    ],
)
def test_what_is_no_address_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(RequestError) as caught:
        parse_address(text)
    assert "feetech:" in str(caught.value) or "for example" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "ids"),
    [
        ("3", (3,)),
        ("1-3", (1, 2, 3)),
        ("1-3+7", (1, 2, 3, 7)),
        ("1,2,2", (1, 2)),
        ("0x25+0x26", (0x25, 0x26)),
    ],
)
def test_ids_are_lists_and_ranges(text: str, ids: tuple[int, ...]) -> None:
    assert parse_ids(text) == ids


@pytest.mark.parametrize(
    "text", ["", "a", "3-1", "1-", "-1", "1++2", "1-99999999", "1.5", "1_0", "1-1_0", "٣"]
)
def test_impossible_ids_are_refused(text: str) -> None:
    with pytest.raises(RequestError, match="ids"):
        parse_ids(text)
