"""A simulated KST bus as others meet it: by options in text, on a memory link, in virtual time."""

from __future__ import annotations

import json
from typing import Any

import pytest

from motorbus.core.can_frame import CanFrame
from motorbus.core.switches import options as options_of
from motorbus.errors import RequestError
from motorbus.families.kst.simulator import OPTIONS, KstBus, simulate
from motorbus.families.kst.simulator.quirks import Quirks
from motorbus.link.memory import MemoryLink
from motorbus.simulation.control import obey

READ = CanFrame(0x625, bytes.fromhex("4002600000000000"))
MOVE = CanFrame(0x625, bytes.fromhex("2203600084030000"))


def test_the_usual_bus_speaks_as_the_manual_says() -> None:
    bus = simulate([0x25])
    assert {servo.profile.name for servo in bus.servos} == {"kst"}
    assert bus.nodes[0x25].bit_rate == 500_000


@pytest.mark.parametrize("profile", ["kst", "kst-ext", "kingmax", "xqpower"])
def test_a_profile_may_be_said_as_option_or_as_model(profile: str) -> None:
    buses = [
        simulate([1], profile),
        simulate([1], profile=profile),
        simulate([1], "", profile=profile),
        simulate([1], profile, profile=profile),
    ]
    assert {bus.nodes[1].profile.name for bus in buses} == {profile}


def test_every_option_has_a_default_of_its_kind_and_can_be_said_in_text() -> None:
    assert [option.name for option in OPTIONS] == ["profile", *(one.name for one in options_of(Quirks))]
    assert [one.name for one in OPTIONS if not one.help or not isinstance(one.default, one.kind)] == []
    said = {one.name: str(one.default) for one in OPTIONS}
    assert simulate([1], **said).quirks == simulate([1]).quirks


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"profile": "futaba"}, "kst, kst-ext, kingmax, xqpower"),
        ({"firmware": ""}, "one or more ASCII"),
        ({"firmware": "1.ü"}, "one or more ASCII"),
        ({"duplicate": "twice"}, "0x25+0x26"),
        ({"duplicate": "0x80"}, "1 to 127"),
        ({"reports_ms": "0.01"}, "0, or 0.1"),
    ],
)
def test_nonsense_is_refused_with_what_would_do(options: dict[str, Any], says: str) -> None:
    with pytest.raises(RequestError) as caught:
        simulate([1], **options)
    assert says in caught.value.expected


def test_a_model_and_another_profile_contradict_each_other() -> None:
    with pytest.raises(RequestError):
        simulate([1], "kst", profile="xqpower")


# --- on a link, in virtual time -----------------------------------------------------------------------------


def linked(*ids: int, pace: bool = False, **options: object) -> tuple[KstBus, MemoryLink]:
    """A simulated bus and a host's link to it."""
    bus = simulate(ids or (0x25,), **options)
    return bus, MemoryLink(bus, rate=500_000, pace=pace)


def test_a_host_asks_and_is_answered() -> None:
    _, link = linked()
    link.write(READ)
    assert link.read(link.now() + 0.01) == [CanFrame(0x5A5, bytes.fromhex("4B02600000000000"))]
    assert link.now() == pytest.approx(0.0001)


def test_with_pace_frames_take_their_time() -> None:
    _, link = linked(pace=True)
    link.write(READ)
    assert link.read(link.now() + 0.01)
    assert 2 * 111 / 500_000 < link.now() - 0.0001 < 2 * 135 / 500_000


def test_it_moves_while_nobody_looks() -> None:
    bus, link = linked()
    link.write(MOVE)
    link.advance(0.05)
    under_way = bus.nodes[0x25].raw_position
    link.advance(2.0)
    assert 0 < under_way < 900 == bus.nodes[0x25].raw_position


def test_reports_come_between_answers() -> None:
    _, link = linked(reports_ms=2)
    heard: list[object] = []
    for _ in range(100):
        link.write(READ)
        heard += link.read(link.now() + 0.001)
        link.advance(0.001)
    heard += link.read(link.now())
    lengths = [len(frame.data) for frame in heard if isinstance(frame, CanFrame)]
    assert lengths.count(8) == 100
    assert 40 <= lengths.count(4) <= 60


def test_a_broken_frame_reaches_the_host() -> None:
    _, link = linked()
    link.tune(20_000)
    link.write(READ)
    (frame,) = link.read(link.now() + 0.01)
    assert frame == CanFrame(0x20000088, bytes(8))


def test_a_link_that_only_listens_breaks_nothing() -> None:
    bus, link = linked(reports_ms=10)
    link.tune(20_000, listen_only=True)
    assert link.read(link.now() + 0.015) == [CanFrame(0x20000088, bytes(8))]
    link.tune(500_000, listen_only=True)
    assert link.read(link.now() + 0.02) == [CanFrame(0x5A5, bytes(4))]
    assert bus.nodes[0x25].errors == 0


# --- by the control socket ----------------------------------------------------------------------------------


def test_a_new_id_is_active_only_after_save_and_power_cycle() -> None:
    bus, link = linked()
    link.write(CanFrame(0x625, bytes.fromhex("2200300026000000")))
    link.advance(0.01)
    assert obey(bus, "power-cycle 0x25") == "ok"
    assert list(bus.nodes) == [0x25]
    for request in ("2200300026000000", "2210100173617665"):
        link.write(CanFrame(0x625, bytes.fromhex(request)))
    link.advance(0.2)
    assert list(bus.nodes) == [0x25]
    assert obey(bus, "power-cycle") == "ok"
    assert list(bus.nodes) == [0x26]


def test_status_is_plain_data_of_everyone_twins_too() -> None:
    bus, _ = linked(1, 1, 2)
    told = json.loads(obey(bus, "status"))["nodes"]
    assert [(one["unit"], one["node"]) for one in told] == [(1, 1), (3, 2), (2, 1)]
    assert obey(bus, "unplug 1002") == "ok"
    assert bus.nodes[1002].plugged is False
