"""`motorbus scan`: who is on this bus, at which rate, and what each of them is."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from motorbus.cli import faces
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.cli.target import id_shown, nobody, opened, rate_word, target
from motorbus.core import units
from motorbus.core.family import Found
from motorbus.core.steps import Progress
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from motorbus.cli.output import Bar
    from motorbus.cli.target import Target
    from motorbus.core.family import Family

app = App(
    name="scan",
    help_epilogue="""Asks, and writes nothing. A CAN bus whose rate is not known is listened to
before anything is sent, where the adapter can. Ends with exit code 5 when
nobody answers.

Examples:

    motorbus scan feetech:/dev/ttyACM0
    motorbus scan feetech:/dev/ttyACM0 --ids 1-20 --baud 1000000,500000
    motorbus scan feetech:/dev/ttyACM0 --baud all
    motorbus scan kst:can://slcan/dev/ttyACM0 --bitrate all
    motorbus scan feetech:sim,ids=1-6 --ids 1-9 --json""",
)


@app.default
def scan(
    bus: str,
    /,
    *,
    ids: str = "",
    baud: str = "",
    bitrate: str = "",
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Find the devices on a bus.

    Parameters
    ----------
    bus
        FAMILY:PORT, as feetech:/dev/ttyACM0
    ids
        Which ids to ask, as 1-6 or 1,4,7; every id when left out.
    baud
        Which rates to try, as 1000000,500000, or `all`; the rate of the bus when left out.
    bitrate
        The same for a CAN bus, as 500k,1M, or `all`.
    options
        Any option of the bus string, as a flag.
    """
    from motorbus import session

    wanted = target(bus)
    asked = session.parse_ids(ids) if ids else wanted.nodes
    tried = _tried({"baud": baud, "bitrate": bitrate}, wanted.family)
    early: list[Found] = []
    found: list[Found] | None = None
    notes: list[str] = []
    with opened(wanted.bus, options, output) as opening:
        operation = opening.driver.scan(asked, tried or (opening.rate,))
        tell = output.note if len(tried) > 1 else None  # it takes a while: who answers is told at once
        try:
            with output.progress("scanning") as bar:
                told = partial(_heard, wanted.family.name, early, bar, notes, tell=tell)
                found = opening.run(operation, report=told)
        finally:
            _show(wanted, early if found is None else found, notes, output)
        if not found:
            raise nobody(bus)
    return Exit.OK


def _tried(texts: Mapping[str, str], family: Family) -> tuple[int, ...]:
    word = rate_word(family)
    for name, text in texts.items():
        if text and name != word:
            raise RequestError(
                f"--{name}: {family.name} buses have a {word}",
                expected=f"--{word} {text}",
                advice="nothing was sent",
            )
    return rates(texts[word], family)


def rates(text: str, family: Family) -> tuple[int, ...]:
    """The rates in a list, or all that the family knows. Raises RequestError when it is no list of rates."""
    if text == "all":
        return family.link.rates
    words = text.replace("+", ",").split(",") if text else []
    try:
        said = tuple(map(units.rate, words))
    except RequestError:
        raise RequestError(
            f"--{rate_word(family)} {text}: not a list of rates",
            expected="as 1000000,500k or all",
            advice="nothing was sent",
        ) from None
    for rate in said:
        if rate not in family.link.rates:
            raise RequestError(
                f"--{rate_word(family)} {text}: {rate} bit/s is no rate of {family.name} devices",
                expected=", ".join(map(str, family.link.rates)),
                advice="nothing was sent",
            )
    return said


def _heard(
    family: str,
    found: list[Found],
    bar: Bar,
    notes: list[str],
    event: object,
    *,
    tell: Callable[[str], None] | None = None,
) -> None:
    listen(event, found, bar)
    if isinstance(event, Found) and tell is not None and not bar.shown:
        tell(_early(event))
    say = faces.offer(family, "say")
    text = say(event) if say is not None else ""
    if text and text not in notes:
        notes.append(text)


def listen(event: object, found: list[Found], bar: Bar) -> None:
    """Take note of what a scan reports on its way: an early result, or how far it has come."""
    if isinstance(event, Found):
        found.append(event)
        bar.say(_early(event))
    elif isinstance(event, Progress):
        bar.advance(event.done, event.total, event.what)


def mixed_firmware(found: Iterable[Found], family: Family) -> list[str]:
    """A note for each model of which devices have several firmware versions: they may behave differently."""
    versions: dict[str, dict[str, list[str]]] = {}
    for one in found:
        if one.identity is not None:
            nodes = versions.setdefault(one.identity.model, {}).setdefault(one.identity.firmware, [])
            nodes.append(f"#{id_shown(one.node, family)}")
    return [
        f"{model} with several firmware versions, which may behave differently: "
        + ", ".join(f"{version} ({', '.join(nodes)})" for version, nodes in by_version.items())
        for model, by_version in versions.items()
        if len(by_version) > 1
    ]


def _early(one: Found) -> str:
    return f"#{one.node} answers at {one.rate} bit/s"


def _model(one: Found) -> str:
    return one.identity.model if one.identity else "?"


def _show(wanted: Target, found: list[Found], notes: list[str], output: Output) -> None:
    notes = [*notes, *mixed_firmware(found, wanted.family)]
    for text in notes:
        output.note(f"note: {text}")
    word = rate_word(wanted.family)
    devices = [facts(one, word) for one in found]
    output.document("motorbus.scan/1", {"bus": wanted.bus, "devices": devices, "notes": notes})
    if found:
        rows = [(id_shown(one.node, wanted.family), *row(one)[1:]) for one in found]
        output.table(f"Devices on {wanted.bus}", COLUMNS, rows)


COLUMNS = (">id", ">bit/s", "model", "firmware", "registers")


def row(one: Found) -> tuple[object, ...]:
    """One device as a row of `COLUMNS`."""
    known = one.identity
    map_ = (known.table or "unknown: read only") if known else ""
    return (one.node, one.rate, _model(one), known.firmware if known else "", map_)


def facts(one: Found, rate: str = "baud") -> dict[str, object]:
    """One device as plain data; `rate` is what its rate is called."""
    known = one.identity
    named = {"model": known.model, "firmware": known.firmware, "table": known.table} if known else {}
    return {"id": one.node, rate: one.rate, **named}
