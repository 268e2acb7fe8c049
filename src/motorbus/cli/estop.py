"""`motorbus estop`: stop a bus now, also one that another motorbus process holds, also one whose program hangs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from motorbus.cli.exits import Exit, Partial
from motorbus.cli.output import Output
from motorbus.cli.target import Target, face, opened, target
from motorbus.errors import MotorbusError, PortNotFound, RequestError

if TYPE_CHECKING:
    from motorbus.bus.stop import StopOutcome

app = App(
    name="estop",
    help_epilogue="""THE ARM WILL SAG: an emergency stop cuts the torque of FEETECH servos, and
nothing holds them up then. `motorbus stop` decelerates and holds instead.

A bus that another motorbus process holds is stopped by that process, even if
its event loop hangs, and stays stopped until that process says reset(). A bus
that nobody holds is opened and stopped from here; with ids (BUS#1-6) each
device is asked to acknowledge. A port that a foreign program holds cannot be
reached: the error names that program. Without BUS, every bus that a motorbus
process of yours holds is stopped.

Examples:

    motorbus estop
    motorbus estop feetech:/dev/ttyACM0
    motorbus estop feetech:/dev/ttyACM0#1-6""",
)


@app.default
def estop(
    bus: Annotated[str, Parameter(name="BUS[#ID]")] = "",
    /,
    *,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Emergency stop: cut the torque of a bus at once, from any shell. The arm will sag.

    Parameters
    ----------
    bus
        FAMILY:PORT; every bus that a motorbus process holds when left out.
    options
        Any option of the bus string, as a flag.
    """
    stops = [_stop(bus, options, output)] if bus else _stop_all()
    output.document("motorbus.estop/1", {"buses": stops})
    for one in stops:
        output.text(f"{one['bus']}: {one['error'] or one['promise']}")
        output.text(
            f"  by {one['by']}; acknowledged: {_list(one['acknowledged'])}; silent: {_list(one['silent'])}"
        )
    return _verdict(stops)


def _stop(bus: str, options: dict[str, str], output: Output) -> dict[str, Any]:
    from motorbus import session
    from motorbus.link.lock import PortLock

    wanted = target(bus)
    port = session.parse_address(bus).port
    owner = PortLock(port).owner()
    try:
        outcome = _ask(port)
    except PortNotFound:
        return _stop_ourselves(wanted, options, output)
    return _facts(wanted.bus, f"process {owner.pid} ({owner.program})" if owner else "its owner", outcome)


def _ask(port: str) -> StopOutcome:
    from motorbus.bus.stop import request_estop
    from motorbus.link.lock import socket_path

    return request_estop(socket_path(port))


def _stop_ourselves(wanted: Target, options: dict[str, str], output: Output) -> dict[str, Any]:
    """Nobody offers the stop: send it from here, then have each device that was named confirm it."""
    with opened(wanted.bus, options, output) as opening:
        outcome = opening.estop()
        confirmed, silent = set(outcome.acknowledged), set(outcome.silent)
        for node in wanted.nodes:
            try:
                face(opening, node).disable_torque()
                confirmed.add(node)
            except MotorbusError:
                silent.add(node)
    outcome = outcome._replace(
        acknowledged=tuple(sorted(confirmed)), silent=tuple(sorted(silent - confirmed))
    )
    return _facts(wanted.bus, "this process", outcome)


def _stop_all() -> list[dict[str, Any]]:
    from motorbus.link.lock import holders

    owners = holders()
    if not owners:
        raise RequestError(
            "no motorbus process holds a bus",
            expected="BUS, as feetech:/dev/ttyACM0",
            advice="name the bus, and it is opened and stopped from here",
        )
    stops = []
    for owner in owners:
        by = f"process {owner.pid} ({owner.program})"
        try:
            stops.append(_facts(owner.port, by, _ask(owner.port)))
        except MotorbusError as error:
            stops.append(
                {"bus": owner.port, "by": by, "acknowledged": [], "silent": [], "error": error.summary}
            )
    return stops


def _facts(bus: str, by: str, outcome: StopOutcome) -> dict[str, Any]:
    return {
        "bus": bus,
        "by": by,
        "acknowledged": list(outcome.acknowledged),
        "silent": list(outcome.silent),
        "promise": outcome.promise,
        "error": "" if outcome.rounds else "no stop was sent",
    }


def _list(nodes: list[int]) -> str:
    return ", ".join(f"#{node}" for node in nodes) or "none"


def _verdict(stops: list[dict[str, Any]]) -> Exit:
    failed = [f"{one['bus']}: {one['error']}" for one in stops if one["error"]]
    if failed and len(failed) == len(stops):
        raise MotorbusError("; ".join(failed))
    silent = [
        f"{one['bus']}: no acknowledgement from {_list(one['silent'])}" for one in stops if one["silent"]
    ]
    if failed or silent:
        raise Partial("; ".join([*failed, *silent]), advice="cut the power by hand")
    return Exit.OK
