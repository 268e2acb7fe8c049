"""`motorbus web`: the page of a machine."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from importlib.resources import as_file, files
from pathlib import Path
from threading import Event
from typing import Annotated, Final

from cyclopts import Parameter
from msgspec import Struct

from motorbus.cli.common import Common
from motorbus.cli.output import emit, note
from motorbus.errors import RequestError

LOOPBACK: Final = ("", "127.0.0.1", "localhost")


class Page(Struct, frozen=True, tag="web"):
    """The address of the page; who has it can move the machine."""

    url: str


def web(
    machine: str = "",
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
            config = MachineConfig.load(stack.enter_context(as_file(files("motorbus.cli") / "demo.toml")))
            config, faults = stack.enter_context(simulated(config))
        else:
            config = MachineConfig.load(machine or common.machine)
        robot = stack.enter_context(Robot(config))
        if demo:
            robot.set_position("slide", 0.0)
        if any(bus.simulated for bus in robot.buses.values()) and not common.json:
            note("simulated", once=True)
        for text in robot.warnings:
            note(f"note: {text}")
        stack.callback(robot.shutdown)
        service = stack.enter_context(Service(robot, Path("recordings"), faults))
        server = stack.enter_context(Server(service, host=host, port=port, token=token))
        with suppress(KeyboardInterrupt):
            emit(Page(server.url), common)
            Event().wait()
