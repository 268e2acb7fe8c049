"""Calls that three libraries have for FEETECH servos, on simulated ones of three kinds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.interop.feetech.peer import Peer
from tests.interop.feetech.session import Session, sessions
from tests.interop.feetech.steps import carry_out
from tests.interop.feetech.twin import Twin

ALL = sessions()


@pytest.mark.parametrize("session", ALL, ids=lambda session: session.id)
def test_gives_and_leaves_what_is_due(
    session: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Twin(tmp_path, *session.kinds) as twin, Peer(session.peer) as peer:
        session.prepare(peer, twin.port)
        for step in session.steps():
            carry_out(step, peer, twin)
