"""`motorbus monitor`: telemetry again and again, as a table that redraws itself or as JSON Lines."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import App, Parameter

from motorbus.cli import alarms, faces, traffic
from motorbus.cli.exits import Exit, Partial
from motorbus.cli.machine import axes_called, machine
from motorbus.cli.output import Output
from motorbus.cli.rates import check_rate
from motorbus.cli.read import Told, own_position, sampled, state_facts
from motorbus.cli.target import able, everyone, face, gathered, opened, target
from motorbus.core.steps import Sleep
from motorbus.errors import DeviceError, LinkError, LinkLost, MotorbusError, NoReply, RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.core.family import State
    from motorbus.motion.machine import AxisSpec

app = App(
    name="monitor",
    usage="Usage: motorbus monitor BUS[#ID]|AXIS... [OPTIONS]",
    help_epilogue="""Of an axis of the machine file, `axis at` is its own position, in its own unit;
everything else is what its device tells, in the angles of the device.

A bus of the machine file means its axes; an address, all devices.

Reads only. Runs until Ctrl-C unless --count or --duration ends it. A device
that does not answer keeps its row and is asked again, and so does one whose
port is gone: a note says so, and another when it is there again (with
--reconnect no it ends there, with exit code 3). What no device tells has
no column; of a stepper controller there are its inputs to watch, each asked
for by itself. Where the line allows less than --rate, the rate that was
reached is told at the end. --listen asks nobody: it prints what others say,
such as position reports, and works where listen_only=yes lets nothing out;
--count is of frames then.

Examples:

    motorbus monitor shoulder elbow
    motorbus monitor feetech:/dev/ttyACM0
    motorbus monitor feetech:/dev/ttyACM0#1-6 --rate 20
    motorbus monitor kst:can://slcan/dev/ttyACM0,listen_only=yes --listen
    motorbus monitor stepper:/dev/ttyUSB0 --rate 4
    motorbus monitor feetech:sim,ids=1-2#1+2 --count 3 --json""",
)

Sample = dict[tuple[str, int], "State | Told | MotorbusError"]


@app.default
def monitor(
    *devices: Annotated[str, Parameter(name="BUS#ID")],
    rate: float = 5.0,
    count: int = 0,
    duration: float = 0.0,
    listen: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Watch devices: position, velocity, load, current, voltage, temperature, alarms.

    Parameters
    ----------
    devices
        FAMILY:PORT, or FAMILY:PORT#ID for some of its devices; or axes.
    rate
        Samples of every device per second.
    count
        End after so many samples; 0 goes on.
    duration
        End after so many seconds; 0 goes on.
    listen
        Send nothing, and print every frame that is heard on a CAN bus instead.
    options
        Any option of the bus string, as a flag.
    """
    check_rate(rate)
    if count < 0 or not duration >= 0:
        raise RequestError("--count and --duration must not be below 0")
    if listen:
        return traffic.listen(devices, count, duration, options, output)
    called = axes_called(devices)
    wanted = {
        bus: nodes or tuple(node for there, node in called if there == bus)
        for bus, nodes in gathered(devices).items()
    }
    specs = {key: (name, machine().axes[name]) for key, name in called.items()}
    with ExitStack() as stack, _shown(output, _Columns(_usual(wanted), specs)) as show:
        watched = _watched(wanted, stack, options, output)
        told, away = alarms.Told(output), _Away(output)

        def tell(sample: Sample) -> None:
            away.look(sample)
            show(sample)
            for (name, node), state in sample.items():
                if not isinstance(state, MotorbusError | dict):
                    told.look(name, watched[name, node], state)

        return _watch(watched, 1 / rate, count, duration, tell, output)


def _usual(wanted: Iterable[str]) -> tuple[str, ...]:
    """The columns while nothing has been told: of devices with telemetry those, of others none."""
    families = {target(bus).family.name for bus in wanted}
    return tuple(COLUMNS) if any(faces.offer(name, "sample") is None for name in families) else ()


def _watched(
    wanted: Mapping[str, tuple[int, ...]], stack: ExitStack, options: Mapping[str, str], output: Output
) -> dict[tuple[str, int], Any]:
    found = {}
    for name, nodes in wanted.items():
        bus = stack.enter_context(opened(name, options, output))
        for node in everyone(name, bus, nodes, output):
            one = face(bus, node)
            if faces.offer(bus.family.name, "sample") is None:
                able(one, "telemetry")
            found[name, node] = one
    return found


def _watch(
    watched: Mapping[tuple[str, int], Any],
    period: float,
    count: int,
    duration: float,
    show: Callable[[Sample], None],
    output: Output,
) -> Exit:
    bus: Bus = next(iter(watched.values())).bus
    began = bus.link.now()
    heard: set[tuple[str, int]] = set()
    done = 0
    try:
        while True:
            sample = {key: _sample(one) for key, one in watched.items()}
            heard |= {key for key, state in sample.items() if _has_answered(state)}
            show(sample)
            done += 1
            passed = bus.link.now() - began
            if done == count or (duration and passed + period >= duration):
                break
            with suppress(*_later(bus)):
                bus.run(_pause(max(0.0, done * period - passed)))
    except KeyboardInterrupt:
        pass  # the usual way to end it
    _say_rate(done, bus.link.now() - began, 1 / period, output)
    return _verdict(set(watched), heard)


def _has_answered(state: State | Told | MotorbusError) -> bool:
    """A refusal is an answer too."""
    return isinstance(state, DeviceError) or not isinstance(state, MotorbusError)


def _say_rate(samples: int, seconds: float, wanted: float, output: Output) -> None:
    """Where the line or the devices were slower than was asked for; the first sample comes at once."""
    if samples > 1 and (reached := samples / seconds) < wanted * _SLOW:
        output.note(
            f"note: {reached:.3g} samples per second, which is all that the line and the devices allow"
        )


def _sample(one: Any) -> State | Told | MotorbusError:
    try:
        state = sampled(one)
    except LinkError as error:
        if not isinstance(error, _later(one.bus)):
            raise
        return error
    except MotorbusError as error:
        return error
    return state


def _later(bus: Bus) -> tuple[type[LinkLost], ...]:
    """What need not be raised at once: a port that is looked for, and may be there again at the next sample."""
    return (LinkLost,) if bus.reconnects else ()


class _Away:
    """Says once that a port is gone, and once that it is there again."""

    def __init__(self, output: Output) -> None:
        self._output = output
        self._gone: set[str] = set()

    def look(self, sample: Sample) -> None:
        """Take in a sample of every device."""
        gone = {bus: state for (bus, _), state in sample.items() if isinstance(state, LinkLost)}
        for bus in self._gone - gone.keys():
            self._output.note(f"note: {bus} is there again")
        for bus in gone.keys() - self._gone:
            self._output.note(f"note: {gone[bus].summary}; it is looked for until it is there again")
        self._gone = set(gone)


async def _pause(seconds: float) -> None:
    await Sleep(seconds)


def _verdict(watched: set[tuple[str, int]], heard: set[tuple[str, int]]) -> Exit:
    silent = ", ".join(f"{bus}#{node}" for bus, node in sorted(watched - heard))
    if silent and not heard:
        raise NoReply(f"no answer from {silent}")
    if silent:
        raise Partial(f"no answer from {silent}")
    return Exit.OK


@contextmanager
def _shown(output: Output, columns: _Columns) -> Iterator[Callable[[Sample], None]]:
    if not output.live:
        yield lambda sample: _lines(sample, output, columns)
        return
    from rich.live import Live

    with Live(console=output.console(), auto_refresh=False) as screen:

        def redraw(sample: Sample) -> None:
            output.mark()  # the bus is open by now
            screen.update(_grid(sample, output, columns), refresh=True)

        yield redraw


def _lines(sample: Sample, output: Output, columns: _Columns) -> None:
    for (bus, node), state in sample.items():
        named: dict[str, object] = {"bus": bus, "id": node, **columns.axis_facts(bus, node, state)}
        if isinstance(state, MotorbusError):
            output.document("motorbus.monitor/1", {**named, "error": state.summary})
        else:
            facts = state if isinstance(state, dict) else state_facts(state)
            output.document("motorbus.monitor/1", {**named, **facts})
    if not output.json:
        output.draw(_grid(sample, output, columns))


COLUMNS: Final = {
    "position": ">position (rad)",
    "velocity": ">velocity (rad/s)",
    "load": ">load (%)",
    "current": ">current (A)",
    "voltage": ">voltage (V)",
    "temperature": ">temperature (°C)",
    "moving": "moving",
}
_SLOW: Final = 0.9
"""Of the rate that was asked for: what is below is told."""
_DIGITS: Final = {"position": 4, "velocity": 3, "load": 1, "current": 3, "voltage": 1, "temperature": 0}


class _Columns:
    """A column for each thing that a device has told so far; `usual` while none has told anything.

    `axes` are those by whose names devices were called: they have their own position, in their own unit.
    """

    def __init__(self, usual: Sequence[str], axes: Mapping[tuple[str, int], tuple[str, AxisSpec]]) -> None:
        self._usual = usual
        self._told: dict[str, None] = {}
        self.axes = axes

    def axis_facts(self, bus: str, node: int, state: State | Told | MotorbusError) -> dict[str, object]:
        """The name of the axis, and its own position in rad or m; nothing for what was not called by one."""
        if (bus, node) not in self.axes:
            return {}
        name, spec = self.axes[bus, node]
        return {"axis": name, "axis_position": own_position(spec, state)}

    def axis_cells(self, bus: str, node: int, state: State | Told | MotorbusError) -> tuple[str, ...]:
        """The same for eyes; no cells where no device was called by an axis."""
        if not self.axes:
            return ()
        if (bus, node) not in self.axes:
            return ("", "")
        name, spec = self.axes[bus, node]
        at = own_position(spec, state)
        return (name, "" if at is None else spec.show(at))

    def of(self, sample: Sample) -> tuple[list[str], list[str]]:
        """The names of telemetry, and what else is told, this sample included."""
        for state in sample.values():
            if isinstance(state, dict):
                self._told |= dict.fromkeys(state)
            elif not isinstance(state, MotorbusError):
                self._told |= {name: None for name in COLUMNS if getattr(state, name) is not None}
        shown = self._told or self._usual
        return [name for name in COLUMNS if name in shown], [
            name for name in self._told if name not in COLUMNS
        ]


def _grid(sample: Sample, output: Output, columns: _Columns) -> Any:
    names, others = columns.of(sample)
    titles = [
        *(("axis", ">axis at") if columns.axes else ()),
        ">id",
        *(COLUMNS[name] for name in names),
        *(name.replace("_", " ") for name in others),
        "alarm",
    ]
    rows = (
        (*columns.axis_cells(bus, node, state), *_row(node, state, names, others))
        for (bus, node), state in sample.items()
    )
    return output.grid(titles, rows)


def _row(
    node: int, state: State | Told | MotorbusError, names: Sequence[str], others: Sequence[str]
) -> tuple[object, ...]:
    if isinstance(state, MotorbusError):
        return (node, *("" for _ in (*names, *others)), state.summary)
    if isinstance(state, dict):
        return (node, *("" for _ in names), *(_word(state.get(name)) for name in others), "")
    return (
        node,
        *(_told(state, name) for name in names),
        *("" for _ in others),
        ", ".join((*state.alarm, *state.refused)),
    )


def _word(value: object) -> object:
    """yes or no for what is so or not so; else the value."""
    return ("yes" if value else "no") if isinstance(value, bool) else value


def _told(state: State, name: str) -> str:
    if name == "moving":
        return "yes" if state.moving else ""
    return _value(getattr(state, name), name)


def _value(value: float | None, name: str) -> str:
    return "" if value is None else f"{100 * value if name == 'load' else value:.{_DIGITS[name]}f}"
