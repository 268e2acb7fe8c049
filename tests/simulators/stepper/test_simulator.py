"""A simulated line as others meet it: by options in text, on a memory link in virtual time, and over a real port."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import pytest

from motorbus.core.switches import options as options_of
from motorbus.errors import RequestError
from motorbus.families.stepper import wire
from motorbus.families.stepper.execution import Behaviour
from motorbus.families.stepper.simulator import OPTIONS, Switches, simulate
from motorbus.families.stepper.simulator.bus import StepperBus
from motorbus.link.memory import MemoryLink
from motorbus.simulation.control import carry_out
from motorbus.simulation.server import Server
from tests.protocol.stepper.vectors import DUMP_A
from tests.simulators.stepper.host import START, STOP, frame


def test_every_option_has_a_default_of_its_kind_and_can_be_said_in_text() -> None:
    assert [one.name for one in OPTIONS] == [one.name for one in options_of(Switches)]
    assert {one.name for one in options_of(Behaviour)} < {one.name for one in OPTIONS}
    assert [one for one in OPTIONS if not one.help or not isinstance(one.default, one.kind)] == []
    said = {one.name: str(one.default) for one in OPTIONS}
    assert simulate((1,), **said).switches == simulate((1,)).switches == Switches()


def test_every_switch_has_a_source() -> None:
    for name, field in Switches.__dataclass_fields__.items():
        assert field.metadata["source"], name


@pytest.mark.parametrize("option", OPTIONS, ids=lambda option: option.name)
def test_every_choice_of_every_switch_runs_a_project(option: Any) -> None:
    field = Switches.__dataclass_fields__[option.name]
    choices = field.metadata["choices"] or ((True, False) if option.kind is bool else (option.default,))
    for choice in choices:
        bus = simulate((1,), **{option.name: choice})
        assert getattr(bus.switches, option.name) == choice
        bus.receive(frame(START, 1), 0.0)
        bus.advance(30.0)
        bus.receive(STOP, 30.0)
        bus.advance(60.0)


@pytest.mark.parametrize(
    ("ids", "model", "options", "says"),
    [
        ((), "", {}, "the id 1"),
        ((1, 2), "", {}, "the id 1"),
        ((1,), "turbo", {}, "stepper"),
        ((1,), "", {"ramp": "jerk"}, "time, pulse"),
        ((1,), "", {"rmap": "time"}, "ramp"),
        ((1,), "", {"ramp_tick_ms": "0"}, "0.001"),
        ((1,), "", {"motor": "0x1E"}, "not ending in E"),
        ((1,), "", {"selected_at_boot": "5"}, "1, 2, 3, 4"),
    ],
)
def test_nonsense_is_refused_with_what_would_do(
    ids: tuple[int, ...], model: str, options: dict[str, Any], says: str
) -> None:
    with pytest.raises(RequestError) as caught:
        simulate(ids, model, **options)
    assert says in caught.value.expected


def linked(*, pace: bool = False, **options: object) -> MemoryLink:
    return MemoryLink(simulate((1,), "stepper", **options), rate=9600, pace=pace)


def received(link: MemoryLink, seconds: float) -> bytes:
    until = link.now() + seconds
    data = b""
    while link.now() < until:
        data += b"".join(piece for piece in link.read(until) if isinstance(piece, bytes))
    return data


def test_a_host_asks_and_is_answered() -> None:
    link = linked()
    link.write(frame(0x3E, 1))
    assert received(link, 1.0) == DUMP_A


def test_a_project_tells_its_end_in_virtual_time() -> None:
    link = linked(pace=True)
    link.write(frame(START, 1))
    receiver = wire.Receiver()
    events = receiver.feed(received(link, 5.0))
    assert [event.data.hex() for event in events] == ["ffaa4e010000", "eedd"]


def order(bus: StepperBus, line: str) -> dict[str, Any]:
    """The reply of the control socket."""
    with closing(Server(bus, rate=9600)) as server:
        return carry_out(server, line)


def test_a_control_socket_shows_it_and_cuts_its_supply() -> None:
    bus = simulate((1,))
    assert order(bus, "status")["nodes"][0]["phase"] == "idle"
    for line in ("power-cycle", "unplug 1", "plug 1"):
        assert order(bus, line) == {"ok": True}
    assert order(bus, "unplug 9")["error"] == "there is no device 9"


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("set-input 1 2 on", ""),
        ("set-input 1 2 off", ""),
        ("set-input 1 9 on", "there is no input 9"),
        ("set-input 4 2 on", "there is no device 4"),
        ("set-input 1 two on", "two is not a number"),
        ("set-input 1 2 up", "up is neither on nor off"),
        ("set-input 1 2", "set-input: wrong arguments"),
    ],
)
def test_a_control_socket_sets_its_inputs(line: str, error: str) -> None:
    bus = simulate((1,))
    assert order(bus, line).get("error", "") == error
    assert bus.controller.status()["inputs"] == ([2] if line == "set-input 1 2 on" else [])
