"""`motorbus set-baud`: devices get another rate, one after the other, guarded, journalled and verified."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit, Partial
from motorbus.cli.identity import address, agreed, carried_out, parse_timeout, rehearsed
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.target import everyone, face, offers, opened, takes, target
from motorbus.cli.wording import in_words_of_the_shell
from motorbus.core import units
from motorbus.errors import LinkError, MotorbusError

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.cli.output import Output

app = App(
    name="set-baud",
    usage="Usage: motorbus set-baud BUS[#IDS] RATE [OPTIONS]",
    help_epilogue="""Without ids every device that answers at the present rate is changed, one after
the other; the last line says how to address them then. Refused for a rate that
the device or the adapter does not have. What is cut off in the middle is ended
by `motorbus recover`; a KST servo asks for a power cycle.

Examples:

    motorbus set-baud feetech:/dev/ttyACM0#3 500000
    motorbus set-baud feetech:/dev/ttyACM0 115200 --yes
    motorbus set-baud feetech:/dev/ttyACM0,baud=115200#1-6 1M --yes
    motorbus set-baud feetech:/dev/ttyACM0#3 500k --dry-run""",
)


@app.default
def set_baud(
    devices: Annotated[str, Parameter(name="BUS[#IDS]")],
    rate: Annotated[str, Parameter(name="RATE")],
    /,
    *,
    timeout: str = "",
    yes: Flag = False,
    dry_run: DryRun = False,
    output: Silent,
    **options: str,
) -> Exit:
    """Let devices speak at another rate, for good.

    Parameters
    ----------
    devices
        FAMILY:PORT for every device that answers, or FAMILY:PORT#IDS for some.
    rate
        In bit/s, as 500000, 500k or 1M.
    timeout
        How long to wait for a power cycle, where one is needed; 120s when left out.
    yes
        Do not ask before their memory is written.
    options
        Any option of the bus string, as a flag.
    """
    bus, family, named = target(devices)
    offers(family, "set_baud")
    wanted = units.rate(rate)
    extra = parse_timeout(timeout)
    with opened(bus, options, output) as opening:
        nodes = everyone(bus, opening, named, output)
        takes(face(opening, nodes[0]), "set_baud", extra)
        if dry_run:
            rehearsed(opening, nodes, "set_baud", wanted, extra, output)
            return Exit.OK
        if not yes:
            who = ", ".join(f"#{node}" for node in nodes)
            what = f"let {who} speak at {wanted} bit/s for good"
            agreed(opening, nodes[0], "set_baud", wanted, extra, what, output)
        done, errors = _each(opening, nodes, wanted, extra, output, bus)
    return _told(bus, opening, done, errors, wanted, output)


def _each(
    bus: Bus, nodes: tuple[int, ...], rate: int, extra: dict[str, object], output: Output, name: str
) -> tuple[list[Any], list[MotorbusError]]:
    done: list[Any] = []
    errors: list[MotorbusError] = []
    for node in nodes:
        try:
            done.append(carried_out(bus, node, "set_baud", rate, output=output, **extra))
        except MotorbusError as error:
            if isinstance(error, LinkError):
                _cut_off(name, bus, done, rate, output)
                raise
            in_words_of_the_shell(error, bus.family, name)
            errors.append(error)
        except BaseException:
            _cut_off(name, bus, done, rate, output)
            raise
    return done, errors


def _cut_off(name: str, bus: Bus, done: list[Any], rate: int, output: Output) -> None:
    """Say who has the new rate already: nobody who asks at the old one finds them."""
    if done:
        ids = "+".join(str(one.node) for one in done)
        output.note(f"note: done before that: {address(name, bus.family, rate=rate)}#{ids}")


def _told(
    name: str, bus: Bus, done: list[Any], errors: list[MotorbusError], rate: int, output: Output
) -> Exit:
    there = address(name, bus.family, rate=rate)
    if done:
        ids = [one.node for one in done]
        facts = {"ids": ids, "rate": rate, "address": there, "errors": [one.summary for one in errors]}
        output.document("motorbus.set-baud/1", facts)
        who = ", ".join(f"#{node}" for node in ids)
        verb = "speaks" if len(ids) == 1 else "speak"
        output.text(f"{who} {verb} at {rate} bit/s now: {there}#{'+'.join(map(str, ids))}")
    if not errors:
        return Exit.OK
    if not done:
        raise errors[0]
    raise Partial("; ".join(error.summary for error in errors))
