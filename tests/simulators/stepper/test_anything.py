"""Whatever a host says and whatever happens to supply and inputs: no error, no noise, no lost sense of time."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from motorbus.core.request import Noise, Reply
from motorbus.core.switches import options as options_of
from motorbus.families.stepper import table, wire
from motorbus.families.stepper.execution import Phase
from motorbus.families.stepper.simulator import StepperBus, Switches, simulate
from tests.protocol.stepper.projects import projects

HARMLESS = {
    "echo",
    "reply_fault",
    "notice_fault",
    "dump_fault",
    "fault_every",
    "fault_time",
    "motor",
    "rx_gap_ms",
}


@st.composite
def requests(draw: st.DrawFn) -> bytes:
    """Any command with numbers that mostly make sense."""
    command = draw(st.sampled_from(list(wire.COMMANDS.values())))
    values = {}
    for place in command.places:
        row = table.PARAMETERS[place.name]
        usual = st.integers(row.low, min(row.high, 300))
        values[place.name] = draw(st.one_of(usual, st.integers(0, (1 << 8 * place.size) - 1)))
    return wire.encode(command.name, **values)


@st.composite
def switches(draw: st.DrawFn) -> dict[str, Any]:
    """Any choice of some switches."""
    found = {}
    for option in options_of(Switches):
        choices = Switches.__dataclass_fields__[option.name].metadata["choices"]
        if option.name not in HARMLESS and (choices or option.kind is bool) and draw(st.booleans()):
            found[option.name] = draw(st.sampled_from(choices or (True, False)))
    return found


ACTS = st.one_of(
    st.tuples(st.just("say"), requests()),
    st.tuples(st.just("say"), st.binary(max_size=12)),
    st.tuples(st.just("input"), st.tuples(st.integers(1, 5), st.booleans())),
    st.tuples(st.just("supply"), st.sampled_from(["unplug", "plug", "power_cycle"])),
)
SCRIPTS = st.lists(st.tuples(st.floats(0, 3), ACTS), max_size=25)


def play(
    bus: StepperBus, script: list[tuple[float, tuple[str, Any]]], looks: int
) -> list[tuple[float, bytes]]:
    """Do all of it, looking so often in between; gives what was said with its moments."""
    now, said = 0.0, list(bus.advance(0.0))
    for pause, (what, how) in script:
        for look in range(looks):
            said += bus.advance(now + pause * (look + 1) / looks)
        now += pause
        said += bus.advance(now)
        if what == "say":
            bus.receive(how, now)
        elif what == "input":
            bus.controller.set_input(*how)
        else:
            getattr(bus.controller, how)()
    said += bus.advance(now + 5.0)
    return [(round(at, 9), data) for at, data in said if isinstance(data, bytes)]


@given(switches(), projects(), SCRIPTS)
@settings(max_examples=150)
def test_whatever_is_said_it_answers_in_frames_or_not_at_all(
    options: dict[str, Any], project: table.Project, script: list[tuple[float, tuple[str, Any]]]
) -> None:
    bus = simulate((1,), **options)
    bus.controller.put(1, project)
    said = play(bus, script, 1)
    moments = [at for at, _ in said]
    assert moments == sorted(moments)
    receiver = wire.Receiver()
    events = [event for _, data in said for event in receiver.feed(data)] + receiver.flush()
    assert not [event for event in events if isinstance(event, Noise)]
    for event in events:
        if isinstance(event, Reply):
            assert wire.decode_reply(event.data) is not None
    state = bus.controller.state
    assert (state.run is not None) == (state.phase in (Phase.WAIT, Phase.MOVE, Phase.DWELL)) or (
        state.phase is Phase.RAMPDOWN
    )
    assert 0 <= state.outputs <= 7


@given(switches(), projects(), SCRIPTS)
@settings(max_examples=100)
def test_it_makes_no_difference_how_often_somebody_looks(
    options: dict[str, Any], project: table.Project, script: list[tuple[float, tuple[str, Any]]]
) -> None:
    runs = []
    for looks in (1, 5):
        bus = simulate((1,), **options)
        bus.controller.put(1, project)
        runs.append((play(bus, script, looks), bus.controller.position, bus.controller.store.stored))
    assert runs[0] == runs[1]
