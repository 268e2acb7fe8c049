"""Every session: which library says what to which servos. The tests run them, and the page is written from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Final, NamedTuple

from tests.interop.feetech import controllers, registers, sdk, sdk_classes, sdk_rest
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, RUSTYPOT, Library, Peer
from tests.interop.feetech.sdk import Sdk
from tests.interop.feetech.steps import Step
from tests.interop.feetech.twin import KINDS, Kind

OWNERS: Final[Mapping[str, str]] = {
    "": "functions of the module",
    "port": "PortHandler",
    "handler": "protocol_packet_handler",
    "reader": "GroupSyncRead",
    "writer": "GroupSyncWrite",
    "sms_sts": "sms_sts",
    "scscl": "scscl",
    "sms_sts.groupSyncWrite": "GroupSyncWrite",
    "scscl.groupSyncWrite": "GroupSyncWrite",
    "bus": "Bus",
}
"""What a session keeps -> the class that it is of. `controller` depends on the session."""


class Session(NamedTuple):
    """One process with one library at one bus.

    `kinds` are the servos as `twin.Twin` takes them; `steps` wants the name of the terminal; `registers` are those
    of the steps that belong to generated calls, which the page sums up by register.
    """

    peer: Library
    subject: str
    kinds: tuple[Kind, ...]
    prepare: Callable[[Peer, str], None]
    steps: Callable[[str], Iterator[Step]]
    generated: Callable[[], Iterator[Step]] = lambda: iter(())

    @property
    def id(self) -> str:
        """Its name for tests."""
        servos = self.kinds[0].model if len(self.kinds) == 1 else "three kinds"
        return f"{self.peer.name} {self.subject} {servos}".replace("  ", " ")

    def owner(self, handle: str) -> str:
        """The class of what is kept under this handle."""
        return (
            f"{self.subject}PyController" if handle == "controller" else OWNERS.get(handle, "ServoDefinition")
        )


def sessions() -> list[Session]:
    """All of them."""
    return [*_sdks(), *_controllers(), _bus()]


def _sdks() -> Iterator[Session]:
    for library in (OLD_SDK, NEW_SDK):
        for kind in KINDS:
            one = Sdk(library, kind)
            yield Session(library, "", (kind,), partial(_prepare_sdk, one), partial(_sdk_steps, one))


def _prepare_sdk(one: Sdk, peer: Peer, port: str) -> None:
    sdk.prepare(peer, one, port)


def _sdk_steps(one: Sdk, port: str) -> Iterator[Step]:
    yield from sdk.handler(one)
    yield from sdk_rest.groups(one)
    yield from sdk_rest.port(one, port)
    yield from sdk_rest.numbers(one)
    if not one.old:
        yield from sdk_classes.classes(one)


def _controllers() -> Iterator[Session]:
    for name in controllers.CONTROLLERS:
        for kind in KINDS:
            yield Session(
                RUSTYPOT,
                name,
                (kind,),
                partial(_prepare_controller, name),
                partial(_controller_steps, name, kind),
                partial(_generated, name, kind),
            )


def _prepare_controller(name: str, peer: Peer, port: str) -> None:
    controllers.prepare(peer, name, port)


def _controller_steps(name: str, kind: Kind, port: str) -> Iterator[Step]:
    yield from controllers.known(name, kind)
    yield from controllers.talks(name, kind)
    yield from controllers.closing()


def _generated(name: str, kind: Kind) -> Iterator[Step]:
    for register in registers.registers(name):
        yield from registers.steps(register, kind)


def _bus() -> Session:
    def steps(port: str) -> Iterator[Step]:
        yield from controllers.bus()
        yield from controllers.definitions()

    return Session(RUSTYPOT, "Bus", controllers.BUS, controllers.prepare_bus, steps)
