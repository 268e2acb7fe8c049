"""Makes docs/reference/differential.md: where other people's codecs and ours differ on the same bytes, and why.

What each decoder makes of an example is measured while the page is made, by the libraries of `.peers`, each in a
process of its own. `--check` sees that the page is the one that would be made.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from scripts.pages import kept, listed
from tests.interop.canopen_peer import LIBRARY
from tests.interop.differential import ours, outside, sdo_streams, streams
from tests.interop.differential.cases import Case, Outcome, SdoCase
from tests.interop.differential.notes import NOTES, REQUEST_NOTES, SDO_NOTES, Note, SdoNote
from tests.interop.differential.outside import CANOPEN, FEETECH
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, RUSTYPOT

PAGE: Final = Path(__file__).resolve().parent.parent / "docs" / "reference" / "differential.md"
VERSIONS: Final = {one.name: one.version for one in (OLD_SDK, NEW_SDK, RUSTYPOT)}
NO_ANSWER: Final = {"timeout", "silence", "Operation timed out"}

HEAD: Final = """# The same bytes through other codecs

The same requests and the same streams go through the codecs of motorbus and through those of others, unmodified, each
in a process of its own:

{names}

The streams are what our simulators answer, of all six FEETECH register maps and of KST servos ({recorded} and {sdo}
recorded exchanges), as they are and with changes: at every place of an answer, and by lot. Changes of FEETECH streams:

{changes}

Changes of SDO frames:

{sdo_changes}

The tests fail on a difference that has no name below, and on a name that no longer comes up. Values are compared, the
error byte of the servo, who of a group has answered, and, for SDO, refusals; how a failure is worded is not. One try is
judged: what motorbus does afterwards (wait for quiet, ask again) is left out. This page is made by
`python -m scripts.differential`, which runs the examples. The stepper controller has no other codec to compare with.

Where nobody is named below, all agree: what all take is what the packet says, and what nobody takes is no packet.
"""


def page() -> str:
    """The whole page."""
    head = HEAD.format(
        names=_items(
            f"{name} {version}" for name, version in [*VERSIONS.items(), (CANOPEN.name, _canopen())]
        ),
        recorded=len(streams.recorded()),
        sdo=len(sdo_streams.recorded()),
        changes=_items(streams.CHANGES),
        sdo_changes=_items(sdo_streams.CHANGES),
    )
    return "\n".join([head, *_feetech(), *_sdo(), *_requests()])


def _items(words: Iterable[str]) -> str:
    return "\n".join(f"- {one}" for one in words)


def _canopen() -> str:
    """The version that is installed."""
    (found,) = LIBRARY.glob("canopen-*.dist-info")
    return found.name.removeprefix("canopen-").removesuffix(".dist-info")


def _feetech() -> Iterator[str]:
    yield "## FEETECH streams\n"
    examples = [note.example for note in NOTES.values()]
    mine = [ours.decoded(case) for case in examples]
    theirs = {
        decoder: [one.outcome for one in outside.heard(decoder, examples, patience=outside.AT_EASE)]
        for decoder in FEETECH
    }
    for place, (name, note) in enumerate(NOTES.items()):
        yield from _note(name, note)
        outcomes = [("motorbus", mine[place]), *((one.name, theirs[one][place]) for one in FEETECH)]
        yield from _example(note.example, outcomes, {one.name for one in note.decoders})


def _sdo() -> Iterator[str]:
    yield "## SDO streams\n"
    heard = [one.outcome for one in outside.heard(CANOPEN, [note.example for note in SDO_NOTES.values()])]
    for (name, note), theirs in zip(SDO_NOTES.items(), heard, strict=True):
        yield from _note(name, note)
        outcomes = [("motorbus", ours.sdo_decoded(note.example)), (CANOPEN.name, theirs)]
        yield from _example(note.example, outcomes, {CANOPEN.name})


def _note(name: str, note: Note | SdoNote) -> Iterator[str]:
    yield f"### {name}\n"
    yield f"{', '.join(one.name for one in note.decoders)}: {note.they}\n"
    yield f"motorbus: {note.we}\n"


def _example(case: Case | SdoCase, outcomes: list[tuple[str, Outcome]], named: set[str]) -> Iterator[str]:
    yield f"Asked: `{_asked(case)}`. Came: `{_came(case)}`.\n"
    rows = [(f"**{name}**" if name in named else name, _made(outcome)) for name, outcome in outcomes]
    yield from listed(("decoder", "makes of it"), rows)


def _asked(case: Case | SdoCase) -> str:
    if isinstance(case, Case):
        return case.request.packet().hex(" ").upper()
    request = case.request
    return f"{request.kind} 0x{request.index:04X}:{request.subindex} of node 0x{request.node:02X}"


def _came(case: Case | SdoCase) -> str:
    if isinstance(case, Case):
        return case.stream.hex(" ").upper()
    frames = [f"{identifier:03X}#{data.hex().upper()}" for step in case.steps for identifier, data in step]
    return ", ".join(frames)


def _made(outcome: Outcome) -> str:
    """In words: data are hexadecimal."""
    if not outcome.taken:
        return "no answer" if outcome.why in NO_ANSWER else f"an error: {outcome.why}"
    value: Any = outcome.value
    if isinstance(value, dict):
        return ", ".join(f"{node}: `{_bytes(data)}`" for node, data in sorted(value.items()))
    if isinstance(value, list):
        return f"`{_bytes(value[0])}`, error byte {value[1]}"
    return f"data `{value}`" if value else "done"


def _bytes(data: list[int]) -> str:
    return bytes(data).hex(" ").upper()


def _requests() -> Iterator[str]:
    yield "## What is sent\n"
    yield "The same request is the same bytes, by all of them, but for this:\n"
    rows = [
        (name, ", ".join(one.name for one in note.decoders), note.they, note.we)
        for name, note in REQUEST_NOTES.items()
    ]
    yield from listed(("name", "seen with", "they", "motorbus"), rows)


def main() -> int:
    """Write the page, or with --check see that the one there is the one that would be written."""
    return kept({PAGE: page()})


if __name__ == "__main__":
    sys.exit(main())
