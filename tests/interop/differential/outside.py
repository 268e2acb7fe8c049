"""The decoders of others: each in a process of its own, all cases handed over at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from tests.interop import canopen_peer
from tests.interop.differential.cases import Case, Outcome, SdoCase
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, PEERS, RUSTYPOT, PeerError

HERE: Final = Path(__file__).resolve().parent
PATIENCE: Final = 0.5
"""s that rustypot gets where it found nothing within its usual 4 ms: a busy machine may say a stream later than that."""


class Decoder(NamedTuple):
    """A library, its script with arguments, the folders it needs, and the kinds of request that it has a call for."""

    name: str
    command: tuple[str, ...]
    folders: tuple[str, ...]
    kinds: frozenset[str]


_SDK_KINDS = frozenset({"ping", "read", "write", "reg_write", "sync_read", "sync_write", "action"})
OLD: Final = Decoder(OLD_SDK.name, ("sdk_decoder.py", "old"), OLD_SDK.folders, _SDK_KINDS)
NEW: Final = Decoder(NEW_SDK.name, ("sdk_decoder.py", "new"), NEW_SDK.folders, _SDK_KINDS)
RUST: Final = Decoder(
    RUSTYPOT.name, ("rustypot_decoder.py",), RUSTYPOT.folders, _SDK_KINDS - {"reg_write", "action"}
)
CANOPEN: Final = Decoder("python-canopen", ("canopen_decoder.py",), (), frozenset({"upload", "download"}))
FEETECH: Final = (OLD, NEW, RUST)


class Heard(NamedTuple):
    """What a library made of a case: its outcome, what it sent, and the line itself."""

    outcome: Outcome
    sent: Any
    line: Mapping[str, Any]


def heard(decoder: Decoder, cases: Sequence[Case | SdoCase], **more: Any) -> list[Heard]:
    """What it makes of each. Raises PeerError when the library is missing or its process fails."""
    lines = "".join(json.dumps({**case.line(), **more}) + "\n" for case in cases)
    script, *arguments = decoder.command
    done = subprocess.run(
        [sys.executable, "-S", "-P", str(HERE / script), *arguments],
        input=lines,
        capture_output=True,
        text=True,
        env=_environment(decoder),
        check=False,
    )
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    if done.returncode or len(answers) != len(cases):
        raise PeerError(f"{decoder.name} ended with {done.returncode}: {done.stderr[-2000:]}")
    found = [Heard(Outcome(line.get("ok"), line.get("no", "")), line["sent"], line) for line in answers]
    if decoder is RUST and not more:
        _ask_again(cases, found)
    return found


def _ask_again(cases: Sequence[Case | SdoCase], found: list[Heard]) -> None:
    """Whom the machine may have kept from hearing in time gets more of it, where the stream holds a whole packet."""
    places = [
        place for place, one in enumerate(found) if not one.outcome.taken and len(_stream(cases[place])) > 5
    ]
    doubted = [place for place in places if "imed" in one_why(found[place])]
    for place, again in zip(
        doubted, heard(RUST, [cases[place] for place in doubted], patience=PATIENCE), strict=True
    ):
        found[place] = again


def one_why(one: Heard) -> str:
    """Why it took nothing."""
    return one.outcome.why


def _stream(case: Case | SdoCase) -> bytes:
    return case.stream if isinstance(case, Case) else b""


def _environment(decoder: Decoder) -> Mapping[str, str]:
    if decoder is CANOPEN:
        return canopen_peer.environment()
    missing = [name for name in decoder.folders if not (PEERS / name).is_dir()]
    if missing:
        raise PeerError(
            f".peers/{missing[0]} is missing; `make test` installs it, or: python scripts/peers.py"
        )
    path = os.pathsep.join(str(PEERS / name) for name in decoder.folders)
    return {**os.environ, "PYTHONPATH": path}
