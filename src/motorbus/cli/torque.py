"""`motorbus torque`: the power stage on or off. On never jumps; off visits everyone whatever happens."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, Parameter

from motorbus import families
from motorbus.cli.each import each
from motorbus.cli.exits import Exit
from motorbus.cli.machine import addresses, axes_named, is_name
from motorbus.cli.output import Output
from motorbus.cli.robot import able, rehearse, robot
from motorbus.cli.target import offers, target
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Mapping

app = App(
    name="torque",
    usage="Usage: motorbus torque on|off BUS[#ID]|AXIS... [OPTIONS]",
    help_epilogue="""`on` first makes the goal the present position, so nothing jumps. `off` visits
every device whatever happens to some, and lets an arm sag. `off` for a whole
FEETECH bus broadcasts first (after one read that tests the port for echo),
which no servo acknowledges; then it visits the axes that the machine file has
on that bus.

Axes of a machine file get their torque with the cap that the file gives them,
and keep it when this command ends, whatever `exit` says there. Those of a
group or a bus whose devices have no such switch are passed over.

Examples:

    motorbus torque on feetech:/dev/ttyACM0#3
    motorbus torque off feetech:/dev/ttyACM0
    motorbus torque on shoulder elbow
    motorbus torque off left""",
)


@app.default
def torque(
    switch: Literal["on", "off"],
    /,
    *devices: Annotated[str, Parameter(name="BUS#ID")],
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Switch the power stage on or off.

    Parameters
    ----------
    switch
        on or off
    devices
        FAMILY:PORT for every device on the bus, FAMILY:PORT#ID for some, or axes.
    dry_run
        Only read; show the frames that it would send.
    options
        Any option of the bus string, as a flag.
    """
    verb = "enable_torque" if switch == "on" else "disable_torque"
    names = [word for word in devices if is_name(word)]
    if switch == "off" or not names:
        return each(f"torque {switch}", verb, _with_switch(devices, verb), options, output, dry_run=dry_run)
    if len(names) < len(devices):
        raise RequestError(
            "some are axes of the machine file and some are addresses",
            expected="axes alone, or addresses alone",
            advice="say it in two commands; nothing was sent",
        )
    return _on(tuple(names), options, output, dry_run=dry_run)


def _with_switch(words: tuple[str, ...], verb: str) -> tuple[str, ...]:
    """The words, and of a name for several those with a switch; all of them where none has one, to be refused."""
    found: list[str] = []
    for word in words:
        axes = axes_named((word,), some=False) if is_name(word) else []
        able_ = [axis for axis in axes if _has(addresses(axis)[0], verb)]
        found += [word] if not able_ or len(able_) == len(axes) else able_
    return tuple(found)


def _has(address: str, verb: str) -> bool:
    return hasattr(families.load(address.partition(":")[0]).devices.blocking, verb)


def _on(names: tuple[str, ...], options: Mapping[str, str], output: Output, *, dry_run: bool) -> Exit:
    axes = axes_named(names)
    for name in (axis for axis in axes if axis in names):
        offers(target(name).family, "enable_torque")
    with robot(axes, options, output) as hand:
        wanted = [name for name in axes if name in names or "enable_torque" in hand.robot[name].able]
        for name in wanted or axes:
            able(hand, name, "enable_torque")
        if dry_run:
            rehearse(hand, wanted, lambda axis: axis.enable_torque())
            return Exit.OK
        hand.robot.enable_torque(wanted)
    output.document("motorbus.enable_torque.axes/1", {"axes": [{"name": name} for name in wanted]})
    output.table("", ["axis", "result"], [(name, "torque on") for name in wanted])
    return Exit.OK
