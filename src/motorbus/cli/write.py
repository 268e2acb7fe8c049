"""`motorbus write`: registers by name. Everything is checked before anything is sent."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from cyclopts import App, Parameter

from motorbus.cli import dry, faces, quantity, registers
from motorbus.cli.consent import consent_to, consent_to_ways, goals_among, refused_anyway
from motorbus.cli.exits import Exit, NeedsConsent
from motorbus.cli.output import Output
from motorbus.cli.parameters import DryRun, Flag
from motorbus.cli.target import check_names, device, face, offers, opened, table_of
from motorbus.core.register import Storage
from motorbus.core.request import Effect
from motorbus.errors import LimitExceeded, RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from motorbus.bus.blocking import Bus
    from motorbus.cli.quantity import Typed
    from motorbus.core.family import Family
    from motorbus.core.register import Register, Value

app = App(
    name="write",
    usage="Usage: motorbus write BUS#ID NAME=VALUE... [OPTIONS]",
    help_epilogue="""Values are in the unit of the register, or with one of their own: 90deg, 500ms,
2048raw. What survives power-off needs --yes (torque is off while it is
written), and so does a goal more than 180 degrees away. With --raw every
number is what stands on the wire; raw numbers for a register that moves the
device need --expert too. --dry-run reads, shows each frame that would change
something, and sends none of those.

A FEETECH servo has no torque while its EEPROM is written, so an arm sags. It
gets its torque back where it is then, unless what a goal means has changed,
it stands outside its limits, or it was stopped or does not answer.

Examples:

    motorbus write feetech:/dev/ttyACM0#3 goal_position=90deg
    motorbus write feetech:/dev/ttyACM0#3 max_temperature=65 --yes
    motorbus write feetech:/dev/ttyACM0#3 acceleration=20 --raw
    motorbus write feetech:/dev/ttyACM0#3 torque_limit=50% --dry-run
    motorbus write stepper:/dev/ttyUSB0 step_1_delay=500ms --yes""",
)


class Order(NamedTuple):
    """One register, the value it shall have in the row's unit, and whether it was given as a raw number."""

    entry: Register
    value: Value
    raw: bool


@app.default
def write(
    device_: Annotated[str, Parameter(name="BUS#ID")],
    /,
    *assignments: Annotated[str, Parameter(name="NAME=VALUE")],
    raw: Flag = False,
    expert: Flag = False,
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Write registers of a device.

    Parameters
    ----------
    device_
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3
    assignments
        Registers by name, and what they shall hold.
    raw
        The values are raw.
    expert
        Allow raw values in registers that move the device.
    yes
        Do not ask before writing what survives power-off, or before a way of more than 180 degrees.
    options
        Any option of the bus string, as a flag.
    """
    bus, family, (node,) = device(device_)
    offers(family, "write")
    wanted = _wanted(assignments, family, raw)
    with opened(bus, options, output) as opening:
        rehearsal = dry.DryBus(opening)
        one = face(rehearsal if dry_run else opening, node)
        orders = _orders(one, wanted, raw)
        values = {order.entry.name: order.value for order in orders}
        tell = _Plan(opening, output)
        rehearse = partial(_write, face(rehearsal, node), values, tell.plan)
        memory = faces.offer(family.name, "KEPT") or Storage.EEPROM.value
        kept = [order.entry.name for order in orders if order.entry.storage is Storage.EEPROM]
        what = f"write {', '.join(kept)} to {memory}, where it survives power-off"
        with quantity.as_typed({node: assignments[0]} if len(assignments) == 1 else {}):
            _permit(orders, output, rehearse, what=what if kept else "", expert=expert, yes=yes or dry_run)
            ways = goals_among(one, [order.entry for order in orders], values)
            consent_to_ways(ways, output, yes=yes or dry_run, rehearse=rehearse)
            told = _write(one, values, tell.plan if dry_run else tell)
    if dry_run:
        dry.show(rehearsal, output)
    else:
        _show(one, orders, told, output)
    return Exit.OK


class _Plan:
    """Prints once what is about to be written and what that takes, where the family says it; other events go on."""

    def __init__(self, bus: Bus, output: Output) -> None:
        self._planned = faces.offer(bus.family.name, "planned")
        self._report = bus.report
        self._output = output
        self._said = False

    def __call__(self, event: object) -> None:
        if not self.plan(event) and self._report is not None:
            self._report(event)

    def plan(self, event: object) -> bool:
        """Print what is about to be written, once; whether the event says that."""
        text = self._planned(event) if self._planned is not None else ""
        if text and not self._said:
            self._said = True
            self._output.text(text)
        return bool(text)


def _write(one: Any, values: Mapping[str, Value], tell: Callable[[object], object]) -> Any:
    """What the verb returns, None of most families."""
    return one.bus.run(type(one).write.function(one, **values), report=tell)


def _wanted(assignments: Sequence[str], family: Family, raw: bool) -> dict[str, str]:
    """Names and texts, refused as far as that needs no device: unknown names, texts that are no values."""
    pairs = [assignment.partition("=")[::2] for assignment in assignments]
    if not pairs or not all(name and text for name, text in pairs):
        raise RequestError("what shall be written?", expected="NAME=VALUE, as goal_position=90deg")
    if len(dict(pairs)) < len(pairs):
        raise RequestError("a register is named twice", sent=" ".join(assignments), advice="nothing was sent")
    wanted = dict(pairs)
    check_names(family, wanted)
    for name, text in wanted.items():
        _typed_by_some([table[name] for table in family.registers.values() if name in table], text, raw)
    return wanted


def _orders(one: Any, wanted: Mapping[str, str], raw: bool) -> list[Order]:
    table = table_of(one)
    return [
        _order(one, table[name], quantity.typed(table[name], text, raw=raw), text)
        for name, text in wanted.items()
    ]


def _typed_by_some(entries: Sequence[Register], text: str, raw: bool) -> None:
    """Raise RequestError for a text that is a value of this register in none of the maps that have it."""
    refusals = []
    for entry in entries:
        try:
            quantity.typed(entry, text, raw=raw)
        except RequestError as error:
            refusals.append(error)
    if entries and len(refusals) == len(entries):
        raise refusals[0]


def _order(one: Any, entry: Register, typed: Typed, text: str) -> Order:
    value = quantity.to_value(one, entry, int(typed.number)) if typed.raw else typed.number
    plain = text[-1:].isdigit() or text.endswith(".")
    given = text if not plain else f"raw value {text}" if typed.raw else f"{text} {entry.unit}".rstrip()
    try:
        entry.encode(quantity.to_raw(one, entry, value), given)  # raises when it is out of range
    except RequestError as refusal:
        refusal.summary = entry.out_of_range(given).summary
        if entry.effect is Effect.MOTION:
            raise _beyond(refusal, one.node) from None
        raise
    return Order(entry, value, typed.raw and not typed.named)


def _beyond(refusal: RequestError, node: int) -> LimitExceeded:
    """A goal out of range is unsafe by whatever command it was given, so `move` and `write` end alike."""
    return LimitExceeded(
        f"node {node}: {refusal.summary}", expected=refusal.expected, advice=refusal.advice, node=node
    )


def _permit(
    orders: Sequence[Order],
    output: Output,
    rehearse: Callable[[], object],
    *,
    what: str,
    expert: bool,
    yes: bool,
) -> None:
    """`what` survives power-off, and needs consent; "" where nothing does."""
    moving = [order.entry.name for order in orders if order.raw and order.entry.effect is Effect.MOTION]
    if moving and not expert:
        refused_anyway(rehearse)
        raise NeedsConsent(
            f"{', '.join(moving)}: a raw value that moves the device",
            advice="give the value in its unit, or say --expert; nothing was sent",
        )
    if what:
        consent_to(what, output, yes=yes, rehearse=rehearse)


def _show(one: Any, orders: Sequence[Order], told: Any, output: Output) -> None:
    rows = registers.facts(
        one, [order.entry for order in orders], {order.entry.name: order.value for order in orders}
    )
    written = faces.offer(one.bus.family.name, "written")
    facts = {} if written is None else {"result": written(told)}
    output.document("motorbus.write/1", {"id": one.node, "registers": rows, **facts})
    registers.show(f"Written to #{one.node}", rows, output)
    if written is not None:
        output.text(str(told))
