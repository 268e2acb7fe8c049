"""`motorbus web`: the page of a machine."""

from __future__ import annotations

from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter
from msgspec import Struct, structs

from motorbus.cli.common import Common
from motorbus.cli.output import emit, note
from motorbus.cli.target import bus_address, is_address
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from motorbus.motion.machine import MachineConfig

LOOPBACK: Final = ("", "127.0.0.1", "localhost")


class Page(Struct, frozen=True, tag="web"):
    """The address of the page; who has it can move the machine."""

    url: str


def web(
    machine: Annotated[str, Parameter(name="MACHINE|BUS")] = "",
    /,
    *,
    demo: Annotated[bool, Parameter(help="Nine simulated axes; no hardware.")] = False,
    port: Annotated[int, Parameter(help="Port of the page; 0: a free one.")] = 8765,
    host: Annotated[str, Parameter(help="Serve on this address, not on this computer only.")] = "",
    token: Annotated[str, Parameter(help="Secret of the page; needed with --host.")] = "",
    common: Common = Common(),
) -> None:
    """Serve a page on which a machine is watched, moved and tuned, until Ctrl-C.

    Examples:

        motorbus web --demo
        motorbus web motorbus.toml
        motorbus web feetech:/dev/ttyACM0            # a new arm: set it up in the page
        motorbus web --host 0.0.0.0 --token "$(openssl rand -hex 16)"

    At the end the machine stops, goes to the pose `park` if there is one, and torque goes off.
    """
    host = "" if host in LOOPBACK else host
    if host and len(token) < 16:
        raise RequestError("--host needs --token", expected="16 characters or more")
    try:
        from motorbus.web.app import Server
    except ImportError as error:
        raise RequestError(
            f"the page needs {error.name}", advice='pip install "motorbus[web]" installs it'
        ) from None
    from motorbus.motion.machine import MachineConfig
    from motorbus.motion.robot import Robot
    from motorbus.web.demo import simulated
    from motorbus.web.service import Service

    with ExitStack() as stack:
        faults = None
        if demo:
            file = Path(stack.enter_context(TemporaryDirectory())) / "demo.toml"
            file.write_bytes((files("motorbus.cli") / "demo.toml").read_bytes())
            config, faults = stack.enter_context(simulated(MachineConfig.load(file)))
        else:
            config = _machine(machine, common)
        again = False
        while True:
            with ExitStack() as opened:
                robot = opened.enter_context(Robot(config, None if config.axes else ()))
                if demo:
                    robot.set_position("slide", 0.0)
                if any(bus.simulated for bus in robot.buses.values()) and not common.json:
                    note("simulated", once=True)
                for text in robot.warnings:
                    note(f"note: {text}")
                parking = opened.enter_context(ExitStack())
                parking.callback(robot.shutdown)
                service = opened.enter_context(Service(robot, Path("recordings"), faults))
                server = opened.enter_context(Server(service, host=host, port=port, token=token))
                port, token = server.port, server.token
                try:
                    if not again:
                        emit(Page(server.url), common)
                    service.changed.wait()
                except KeyboardInterrupt:
                    return
                parking.pop_all()
            again = True
            changed = MachineConfig.load(config.path)
            config = structs.replace(changed, buses=config.buses) if demo else changed


def _machine(word: str, common: Common) -> MachineConfig:
    """The machine of a file; of an address with ids; of an arm at an address that has no axes yet."""
    from motorbus.motion.machine import BusConfig, MachineConfig
    from motorbus.motion.opening import machine_at

    if not is_address(word):
        return MachineConfig.load(word or common.machine)
    address = bus_address(word, common)
    if "#" in address:
        return machine_at(address)
    return MachineConfig(buses={"arm": BusConfig(address)}, path=common.machine)
