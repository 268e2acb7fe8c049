"""The decoders of others: each in a process of its own, all cases handed over at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from tests.interop.differential.cases import Case, Outcome
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, PEERS, RUSTYPOT, PeerError

AT_EASE: Final = 1.0
"""s that it gets where a few streams must be heard whatever else the machine does."""
HERE: Final = Path(__file__).resolve().parent
PATIENCE: Final = 0.05
"""s that rustypot gets where it found nothing within its usual 4 ms: a busy machine may be later than that."""


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
FEETECH: Final = (OLD, NEW, RUST)


class Heard(NamedTuple):
    """What a library made of a case, and what it sent."""

    outcome: Outcome
    sent: Any


def heard(decoder: Decoder, cases: Sequence[Case], **more: Any) -> list[Heard]:
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
    return [Heard(Outcome(line.get("ok"), line.get("no", "")), line["sent"]) for line in answers]


def heard_patiently(decoder: Decoder, cases: Sequence[Case], wanted: Sequence[bool]) -> list[Heard]:
    """As `heard`; who is on a real terminal and timed out where something is wanted gets more time, once.

    A busy machine may say a stream later than after 4 ms.
    """
    found = heard(decoder, cases)
    places = [place for place, want in enumerate(wanted) if want and "timed out" in found[place].outcome.why]
    if decoder is RUST and places:
        again = heard(RUST, [cases[place] for place in places], patience=PATIENCE)
        for place, one in zip(places, again, strict=True):
            found[place] = one
    return found


def _environment(decoder: Decoder) -> Mapping[str, str]:
    missing = [name for name in decoder.folders if not (PEERS / name).is_dir()]
    if missing:
        raise PeerError(
            f".peers/{missing[0]} is missing; `make test` installs it, or: python scripts/peers.py"
        )
    path = os.pathsep.join(str(PEERS / name) for name in decoder.folders)
    return {**os.environ, "PYTHONPATH": path}
