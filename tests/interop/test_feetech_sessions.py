"""Every call that three strangers' libraries have for FEETECH servos, on simulated ones of three kinds.

The steps are in `tests/interop/feetech`; here they are run, and it is seen that no call is missing: the libraries are
asked which they have.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.interop.feetech import registers
from tests.interop.feetech.controllers import CONTROLLERS, MODELS
from tests.interop.feetech.notes import NOT_RUN
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, RUSTYPOT, Library, Peer
from tests.interop.feetech.session import Session, sessions
from tests.interop.feetech.steps import carry_out
from tests.interop.feetech.twin import Twin

ALL = sessions()
PORT = "/dev/ttyUSB0"
SDK_CLASSES = ["PortHandler", "protocol_packet_handler", "GroupSyncRead", "GroupSyncWrite"]
CLASSES = [
    *((OLD_SDK, name) for name in SDK_CLASSES),
    *((NEW_SDK, name) for name in (*SDK_CLASSES, "sms_sts", "scscl")),
    *(
        (RUSTYPOT, name)
        for name in (*(f"{one}PyController" for one in CONTROLLERS), "Bus", "ServoDefinition")
    ),
]
VALUES = {"RegisterAccess", "RegisterInfo", "ServoDefinition"}
"""Classes of rustypot that nobody makes: calls of others give them."""


@pytest.mark.parametrize("session", ALL, ids=lambda session: session.id)
def test_gives_and_leaves_what_is_due(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Twin(tmp_path, *session.kinds) as twin, Peer(session.peer) as peer:
        session.prepare(peer, twin.port)
        for step in [*session.generated(), *session.steps(twin.port)]:
            carry_out(step, peer, twin)


def called(library: Library, owner: str) -> set[str]:
    """The names that sessions with this library call of this class."""
    mine = [session for session in ALL if session.peer is library]
    return {
        call.name
        for session in mine
        for step in [*session.steps(PORT), *session.generated()]
        for call in step.calls
        if session.owner(call.owner) == owner
    }


@pytest.mark.parametrize(("library", "owner"), CLASSES, ids=lambda one: getattr(one, "name", one))
def test_no_call_of_a_class_is_forgotten(library: Library, owner: str) -> None:
    with Peer(library) as peer:
        there = set(peer.ask("calls", owner))
    assert there - called(library, owner) == set()


@pytest.mark.parametrize("library", [OLD_SDK, NEW_SDK, RUSTYPOT], ids=lambda library: library.name)
def test_no_function_or_class_of_a_module_is_forgotten(library: Library) -> None:
    with Peer(library) as peer:
        there = set(peer.ask("calls", ""))
    run = called(library, "functions of the module") | {owner for whose, owner in CLASSES if whose is library}
    left_out = {name for name in there if any(f"`{name}`" in line for line in NOT_RUN)}
    assert there - run - left_out - VALUES == set()


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_table_of_registers_is_the_librarys_own(controller: str) -> None:
    with Peer(RUSTYPOT) as peer:
        peer.new("definition", f"{controller}PyController.definition")
        theirs = [_told(peer, controller, name) for name in _names(peer)]
    ours = [one._replace(typed=False) for one in registers.registers(controller)]
    assert theirs == ours


def _names(peer: Peer) -> list[str]:
    shown = [one["shown"] for one in peer.call("definition", "registers")]
    return [text.split("'")[1] if "'" in text else text.split('"')[1] for text in shown]


def _told(peer: Peer, controller: str, name: str) -> registers.Register:
    peer.new("register", "definition.register", name)
    size, address, encoding, sign = (
        peer.ask("look", "register", what) for what in ("size", "addr", "encoding", "sign_bit")
    )
    writable = "ReadWrite" in peer.ask("look", "register", "access")["shown"]
    return registers.Register(controller, name, address, size, writable, encoding, sign, False)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_what_a_definition_states_is_told_apart_from_ours(controller: str) -> None:
    """Its attributes, each of them; what it does not state is None or empty."""
    with Peer(RUSTYPOT) as peer:
        peer.new("definition", f"{controller}PyController.definition")
        names = set(peer.ask("names", "definition")) - set(peer.ask("calls", "ServoDefinition"))
        told = {name: peer.ask("look", "definition", name) for name in names}
    modes = [["position", 0], ["pwm", 2], ["step", 3], ["velocity", 1]] if controller == "Sts3215" else []
    assert sorted(told.pop("operating_modes")) == modes
    assert told.pop("baudrates") or controller == "Scs0043"
    assert told == {
        "name": controller.upper(),
        "protocol": 1,
        "models": MODELS[controller],
        "resolution": {"Sts3215": 4096, "Scs0009": 1024, "Scs0043": None}[controller],
        "word_order": "big" if controller == "Scs0009" else "little",
        "supports_sync_read": controller != "Scs0009",
        "supports_broadcast_ping": controller == "Sts3215",
        "factory_baudrate": None if controller == "Scs0043" else 1_000_000,
        "homing_offset_sign": -1 if controller == "Sts3215" else None,
        "eeprom_lock": controller != "Scs0043",
        "status_alarms_only": True,
    }
