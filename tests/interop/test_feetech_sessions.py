"""Calls of three libraries for FEETECH servos, on simulated ones of three kinds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.interop.feetech import controllers, sdk, sdk_classes
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, RUSTYPOT, Library, Peer
from tests.interop.feetech.steps import Step, carry_out
from tests.interop.feetech.twin import KINDS, Kind, Twin


class Session(NamedTuple):
    """One process with one library at one bus."""

    id: str
    library: Library
    kinds: tuple[Kind, ...]
    prepare: Callable[[Peer, str], None]
    steps: Iterable[Step]


def sessions() -> Iterator[Session]:
    for kind in KINDS:
        for library in (OLD_SDK, NEW_SDK):
            one = sdk.Sdk(library, kind)
            steps = [*sdk.steps(one), *([] if one.old else sdk_classes.steps(kind))]
            prepare = partial(_prepare_sdk, one)
            yield Session(f"{library.name} {kind.model}", library, (kind,), prepare, steps)
        for name in controllers.CONTROLLERS:
            prepare = partial(_prepare_controller, name)
            steps = list(controllers.steps(name, kind))
            yield Session(f"{name} {kind.model}", RUSTYPOT, (kind,), prepare, steps)
    bus_steps = list(controllers.bus_steps())
    yield Session("rustypot bus", RUSTYPOT, controllers.BUS, controllers.prepare_bus, bus_steps)


def _prepare_sdk(one: sdk.Sdk, peer: Peer, port: str) -> None:
    sdk.prepare(peer, one, port)


def _prepare_controller(name: str, peer: Peer, port: str) -> None:
    controllers.prepare(peer, name, port)


@pytest.mark.parametrize("session", list(sessions()), ids=lambda session: session.id)
def test_calls_return_and_leave_what_the_servo_holds(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Twin(tmp_path, *session.kinds) as twin, Peer(session.library) as peer:
        session.prepare(peer, twin.port)
        for step in session.steps:
            carry_out(step, peer, twin)
