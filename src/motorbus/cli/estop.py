"""`motorbus estop`: emergency stop, also of a bus that another process has open, also if that process hangs."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter
from msgspec import Struct

from motorbus.cli.common import Common, Partial
from motorbus.cli.motion import with_others
from motorbus.cli.output import emit, note
from motorbus.cli.target import bus_address, is_address, load_machine, open_bus
from motorbus.core.steps import catch, gather
from motorbus.errors import LinkError, MotorbusError, NoReply, PortNotFound, RequestError
from motorbus.session import lock_name, parse_address

if TYPE_CHECKING:
    from motorbus.bus.stop_socket import StopOutcome
    from motorbus.link.errors import Owner
    from motorbus.motion.machine import MachineConfig

OPENING: Final = 1.0  # s in which a process that opens a port offers its stop
BY_HAND: Final = "cut the power by hand"


class StoppedBus(Struct, frozen=True, tag="estop"):
    """An emergency stop of one bus: the devices that acknowledged it, those that did not, and who sent it."""

    bus: str
    by: str
    acknowledged: tuple[int, ...] = ()
    silent: tuple[int, ...] = ()
    promise: str = ""
    error: str = ""


def estop(
    *buses: Annotated[str, Parameter(name="BUS")],
    all_: Annotated[bool, Parameter(name="--all", help="Also simulated buses of other programs.")] = False,
    common: Common = Common(),
) -> None:
    """Emergency stop. FEETECH servos lose their torque: AN ARM SAGS.

    Without BUS: every open bus on a real port, and every bus of the machine file.
    The program that has the port open stops it, even if it hangs; else the port is
    opened. Exit code 6: a device did not acknowledge; 5: none did.

    Examples:

      motorbus estop
      motorbus estop feetech:/dev/ttyACM0#1-6
      motorbus estop arm --all
    """
    from motorbus.link.lock import holders, is_simulated, real_name

    machine, broken = None, None
    try:
        machine = load_machine(common)
    except RequestError as error:  # open buses are stopped in any case
        broken = error
    words = buses or tuple(machine.buses if machine is not None else ())
    wanted: dict[str, set[int]] = {}
    errors: list[MotorbusError] = [broken] if broken is not None else []
    for word in words:
        try:
            address, nodes = _bus_of(common, machine, word)
        except RequestError as error:
            errors.append(error)
        else:
            wanted.setdefault(address, set()).update(nodes)
    stops, ports = [], set()
    for address, nodes in wanted.items():
        try:
            port = lock_name(address, {})
            ports.add(real_name(port) if port else "")
            stops.append(_stop(common, address, port, nodes))
        except MotorbusError as error:
            errors.append(error)
            stops.append(StoppedBus(address, "this process", error=error.summary))
    for owner in holders() if all_ or not buses else ():
        if real_name(owner.port) in ports:
            continue
        if is_simulated(owner.port) and not all_:
            note(f"note: {owner.port} is simulated, process {owner.pid} has it: not stopped; --all stops it")
            continue
        try:
            stops.append(_result(owner.port, owner, _request(owner.port, owner), set()))
        except MotorbusError as error:
            errors.append(error)
            stops.append(StoppedBus(owner.port, f"process {owner.pid}", error=error.summary))
    if stops:
        emit(stops, common)
    _judge(stops, errors)


def _bus_of(common: Common, machine: MachineConfig | None, word: str) -> tuple[str, set[int]]:
    """The address of the bus of a word, and the devices that are asked: those named, else those of the machine file."""
    names = machine.axes_of(word) if machine is not None and not is_address(word) else ()
    if machine is not None and names and word not in machine.buses:
        found = {machine.axes[name].bus for name in names}
        if len(found) > 1:
            raise RequestError(f"{word} is on several buses", expected=f"one of {', '.join(found)}")
        word = found.pop()
    spot = parse_address(bus_address(word, common))
    return spot.bus, {*spot.nodes, *(machine.axes[name].node for name in names if machine is not None)}


def _stop(common: Common, address: str, port: str, nodes: set[int]) -> StoppedBus:
    from motorbus.link.lock import PortLock

    owner = PortLock(port).owner() if port else None
    if port:
        with suppress(PortNotFound):
            return _result(address, owner, _request(port, owner), nodes)
    with open_bus(common, address) as bus:
        outcome = bus.estop()
        if not nodes:
            only = bus.family.link.only
            nodes = {only} if only is not None else {one.node for one in bus.run(bus.driver.scan())}
        requests = [one for node in sorted(nodes) for one in bus.driver.stop({node: None}).requests]
        bus.run(gather(*[catch(request) for request in requests]))  # who answers is stopped in rounds
        outcome = bus.estop()
    return _result(address, None, outcome, nodes)


def _request(port: str, owner: Owner | None) -> StopOutcome:
    """Let the process that has the port open stop it. Raises PortNotFound without one, NoReply if it is silent."""
    from motorbus.bus.stop_socket import request_estop
    from motorbus.link.lock import PortLock, socket_path

    limit = time.monotonic() + OPENING
    while True:
        try:
            return request_estop(socket_path(port))
        except PortNotFound:  # a process takes the lock first, and offers its stop when the port is open
            if PortLock(port).owner() is None or time.monotonic() > limit:
                raise
        except LinkError as error:
            who = "a process" if owner is None else f"process {owner.pid} ({owner.program})"
            kill = "" if owner is None else f"; `kill -KILL {owner.pid}` frees the port, then estop again"
            raise NoReply(
                f"{port}: {who} has it open and does not answer: it is not known whether it stopped the bus",
                cause=error.summary,
                advice=f"{BY_HAND}{kill}",
            ) from None
        time.sleep(0.01)


def _result(bus: str, owner: Owner | None, outcome: StopOutcome, nodes: set[int]) -> StoppedBus:
    by = "this process" if owner is None else f"process {owner.pid} ({owner.program})"
    silent = tuple(sorted({*outcome.silent, *nodes} - {*outcome.acknowledged}))
    error = "" if outcome.rounds else outcome.promise
    promise = outcome.promise if outcome.acknowledged else ""
    return StoppedBus(bus, by, tuple(sorted(outcome.acknowledged)), silent, promise, error)


def _judge(stops: list[StoppedBus], errors: list[MotorbusError]) -> None:
    """Raise the error of what was not stopped or not acknowledged."""
    if not stops:
        nothing = RequestError(
            "no bus is open on a real port, and none was named", expected="BUS, as feetech:/dev/ttyACM0"
        )
        raise with_others([*errors] or [nothing])
    acknowledged = [one for one in stops if one.acknowledged]
    silent = [
        f"{one.bus}: no acknowledgement from {_list(one)}"
        for one in stops
        if not one.error and (one.silent or not one.acknowledged)
    ]
    if errors and not silent and not acknowledged:
        raise with_others(errors)
    text = "; ".join([*(error.summary for error in errors), *silent])
    if not acknowledged:
        raise NoReply(text, advice=BY_HAND)
    if text:
        raise Partial(text, advice=BY_HAND)


def _list(one: StoppedBus) -> str:
    return ", ".join(f"#{node}" for node in one.silent) or "any device"
