"""Every session: which library says what to which servos. The tests run them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

from tests.interop.feetech import controllers, sdk, sdk_classes, sdk_rest
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, RUSTYPOT, Library, Peer
from tests.interop.feetech.sdk import Sdk
from tests.interop.feetech.steps import Step
from tests.interop.feetech.twin import KINDS, Kind


class Session(NamedTuple):
    """One process with one library at one bus.

    `kinds` are the servos as `twin.Twin` takes them;
    """

    peer: Library
    subject: str
    kinds: tuple[Kind, ...]
    prepare: Callable[[Peer, str], None]
    steps: Callable[[], Iterator[Step]]

    @property
    def id(self) -> str:
        """Its name for tests."""
        servos = self.kinds[0].model if len(self.kinds) == 1 else "three kinds"
        return f"{self.peer.name} {self.subject} {servos}".replace("  ", " ")


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


def _sdk_steps(one: Sdk) -> Iterator[Step]:
    yield from sdk.handler(one)
    yield from sdk_rest.groups(one)
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
            )


def _prepare_controller(name: str, peer: Peer, port: str) -> None:
    controllers.prepare(peer, name, port)


def _controller_steps(name: str, kind: Kind) -> Iterator[Step]:
    yield from controllers.talks(name, kind)
    yield from controllers.closing()


def _bus() -> Session:
    return Session(RUSTYPOT, "Bus", controllers.BUS, controllers.prepare_bus, controllers.bus)
