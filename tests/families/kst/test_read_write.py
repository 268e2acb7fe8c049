"""Read and write objects: identity, version, bit rate, node id, values of another size."""

from __future__ import annotations

from math import pi
from typing import Any

import pytest

from motorbus.errors import DeviceError, NoReply, RequestError, UnexpectedReply, VerificationFailed
from tests.families.kst.bench import Answers, Bench, abort

ID, POSITION = "605#4000300000000000", "605#4002600000000000"
FIRMWARE, SOFTWARE = "605#400A100000000000", "605#400B100000000000"
SET_ID_9 = "605#2200300009000000"
ABSENT, HARDWARE = 0x0602_0000, 0x0606_0000
HALF_PI = round(pi / 2, 6)


def test_identify_takes_profile_version_and_id() -> None:
    with Bench() as bench:
        identity = bench.servo().identify()
        assert (identity.node, identity.table, identity.firmware) == (5, "kst", "V1.2")
        assert identity.details == {"profile": "kst", "id_format": "std", "reads_back_id": 5}
    refused = {ID: abort(0x3000, ABSENT), FIRMWARE: abort(0x100A, 0x0800_0000)}
    with Bench(line=Answers(refused)) as bench:
        identity = bench.servo().identify()
        assert (identity.firmware, identity.details["reads_back_id"]) == ("unknown", None)
        with pytest.raises(NoReply):
            bench.servo(6).identify()


@pytest.mark.parametrize(
    ("method", "answers", "expected"),
    [
        ("ping", {ID: abort(0x3000, ABSENT)}, True),
        ("ping", {ID: ""}, False),
        ("version", {FIRMWARE: "585#430A100001020380"}, "01 02 03 80"),
        ("version", {FIRMWARE: abort(0x100A, ABSENT), SOFTWARE: "585#430B100056310000"}, "V1"),
        ("version", {FIRMWARE: abort(0x100A, ABSENT), SOFTWARE: abort(0x100B, ABSENT)}, DeviceError),
        ("version", {FIRMWARE: abort(0x100A, HARDWARE)}, DeviceError),
        ("position", {POSITION: "585#4B02600084030000"}, HALF_PI),
        ("position", {POSITION: "585#4202600084030000"}, HALF_PI),
        ("position", {POSITION: "585#4302600084030000"}, HALF_PI),
        ("position", {POSITION: "585#430260007CFCFFFF"}, -HALF_PI),
        ("position", {POSITION: "585#4302600084030100"}, UnexpectedReply),
        ("position", {POSITION: "585#4F02600084000000"}, UnexpectedReply),
        ("position", {POSITION: "585#4102600009000000"}, UnexpectedReply),
    ],
)
def test_reply_is_a_value_or_an_error(method: str, answers: dict[str, str], expected: Any) -> None:
    """Silence, aborts, other objects of newer firmware; zeros or the sign may extend a value."""
    with Bench(profile="kst-ext", line=Answers(answers)) as bench:
        read = getattr(bench.servo(), method)
        if isinstance(expected, type):
            with pytest.raises(expected):
                read()
        else:
            value = read()
            assert (round(value, 6) if isinstance(value, float) else value) == expected


def test_a_version_in_segments_is_not_read() -> None:
    with Bench(line=Answers({FIRMWARE: "585#410A10000E000000"})) as bench:
        with pytest.raises(UnexpectedReply, match="sends firmware_version in segments"):
            bench.servo().version()
        assert bench.servo().identify().firmware == "unknown"


def test_servo_that_needs_lengths_is_written_with_sized() -> None:
    with Bench(sized="yes") as bench:
        with pytest.raises(DeviceError, match="refused goal_position") as raised:
            bench.servo().move(0.1)
        assert "sized=yes" in raised.value.advice
    with Bench(sized="yes", settings={"sized": "yes"}) as bench:
        bench.servo().move(0.1)
        assert "605#2B03600039000000" in bench.sent()


def test_node_id_in_use_or_without_a_servo_is_not_written() -> None:
    with Bench(5, 9) as bench:
        with pytest.raises(RequestError, match=r"0x09 \(9\) is taken"):
            bench.servo().set_node_id(9)
        with pytest.raises(NoReply):
            bench.servo(6).set_node_id(7)
        assert bench.written() == []
        bench.servo().set_node_id(5)
        assert bench.written() == ["2200300005000000"]


def test_node_id_that_reads_back_as_another_is_an_error() -> None:
    written = {SET_ID_9: "585#6000300000000000"}
    reads = ["585#4F00300005000000"] * 3
    line = Answers({**written, ID: [*reads, "585#4F00300007000000"]})
    with Bench(line=line) as bench, pytest.raises(VerificationFailed, match="reads back 7"):
        bench.servo().set_node_id(9)
    with Bench(line=Answers({**written, ID: [*reads, abort(0x3000, ABSENT)]})) as bench:
        bench.servo().set_node_id(9)
