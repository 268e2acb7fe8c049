"""Makes docs/reference/feetech-peers.md from the sessions that the tests run with other people's FEETECH libraries.

What stands on the page is what the steps demand, so it is true as long as the tests pass. `--check` sees that the page
is current.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from tests.interop.feetech import controllers, registers
from tests.interop.feetech.notes import NOT_RUN, NOTES
from tests.interop.feetech.peer import NEW_SDK, OLD_SDK, RUSTYPOT, Library
from tests.interop.feetech.session import Session, sessions
from tests.interop.feetech.steps import Anything, Call, Held, Raised, Step, Through
from tests.interop.feetech.twin import KINDS, Kind

ROOT: Final = Path(__file__).resolve().parent.parent
PAGE: Final = ROOT / "docs" / "reference" / "feetech-peers.md"
PORT: Final = "PORT"
SERVOS: Final = tuple(kind.model.upper() for kind in KINDS)

HEAD: Final = """# FEETECH libraries of others

Programs that were written for these servos, and know nothing of motorbus, speak to the simulator over a real
pseudo-terminal: every call that feetech-servo-sdk 1.0.0, ftservo-python-sdk 2.0.1 and rustypot 1.13.1 have for FEETECH
servos, unmodified, on a simulated STS3215, SCS0009 and HLS3925. After each, the servo's memory is read by other means
and must hold what is due. This page is made by `python -m scripts.feetech_peers` from the steps that the tests run, and
the tests fail when a library has a call that is missing here.

In the tables, what follows the arrow is what the call gave; `held` stands for what the servo held at that moment. What
is before the call, as `14: 1E`, was put there for it, and a line of its own, as `42: 34 08`, is what the servo held
afterwards: an address in decimal, bytes in hexadecimal. The SDKs give data, the result of the transmission (0: success,
-6: no answer) and the error byte. A name in the last column is explained under [differences](#differences); where it is
empty, the library and motorbus agree.
"""


def page() -> str:
    """The whole page."""
    everything = sessions()
    parts = (
        _differences(everything),
        _left_out(),
        *(_library(one, everything) for one in (OLD_SDK, NEW_SDK, RUSTYPOT)),
    )
    return "\n".join([HEAD, *(line for part in parts for line in part)])


def calls_shown(text: str) -> set[str]:
    """Every name of a call in a table of the page."""
    cells = [line.split(" | ") for line in text.splitlines() if line.startswith("| `")]
    return {
        name.strip("` ")
        for row in cells
        for cell in row[:3]
        for name in cell.removeprefix("| ").split("<br>")
    }


def _differences(everything: list[Session]) -> Iterator[str]:
    seen: dict[str, dict[str, None]] = {}
    for session in everything:
        for step in [*session.steps(PORT), *session.generated()]:
            for name in step.why.split():
                seen.setdefault(name, {})[session.peer.name] = None
    yield "## Differences\n"
    rows = [
        [f'<a id="{name}"></a>{name}', ", ".join(seen.get(name, {})) or "all three", note.they, note.we]
        for name, note in NOTES.items()
    ]
    yield from _table(("name", "seen with", "they", "motorbus"), rows)


def _left_out() -> Iterator[str]:
    yield "## Not run\n"
    yield from _table(("what", "why"), NOT_RUN.items())


def _library(library: Library, everything: list[Session]) -> Iterator[str]:
    yield f"## {library.name} {library.version}\n"
    mine = [session for session in everything if session.peer is library]
    subjects = dict.fromkeys(session.subject for session in mine)
    for subject in subjects:
        group = [session for session in mine if session.subject == subject]
        owners = dict.fromkeys(session.owner(call.owner) for session in group for call in _calls(session))
        for owner in owners:
            yield f"### {library.name}: {owner}\n"
            yield from _owner(owner, group)
        if group[0].generated is not Session._field_defaults["generated"]:
            yield from _registers(subject)


def _calls(session: Session) -> Iterator[Call]:
    return (call for step in session.steps(PORT) for call in step.calls)


def _owner(owner: str, group: list[Session]) -> Iterator[str]:
    columns = SERVOS if len(group) > 1 else ("three kinds at once",)
    names = dict.fromkeys(
        call.name for one in group for call in _calls(one) if one.owner(call.owner) == owner
    )
    rows = []
    for name in names:
        cells, why = [], dict[str, None]()
        for session in group:
            steps = [step for step in session.steps(PORT) if _has(step, session, owner, name)]
            shown = dict.fromkeys(line for step in steps for line in _shown(step, session, owner, name))
            cells.append("<br>".join(shown))
            why |= dict.fromkeys(key for step in steps for key in step.why.split())
        if len(set(cells)) == 1:
            cells[1:] = ["the same"] * (len(cells) - 1)
        rows.append([f"`{name}`", *cells, _links(why)])
    yield from _table(("call", *columns, "differs"), rows)


def _has(step: Step, session: Session, owner: str, name: str) -> bool:
    return any(call.name == name and session.owner(call.owner) == owner for call in step.calls)


def _shown(step: Step, session: Session, owner: str, name: str) -> Iterator[str]:
    mine = [call for call in step.calls if call.name == name and session.owner(call.owner) == owner]
    given = [f"{address}: {_bytes(data)}" for (node, address), data in step.before.items() if node == 1]
    with_ = f"`{', '.join([*step.orders, *given])}` " if given or step.orders else ""
    for call in mine:
        told = f" → {_value(call.gives)}" if call.gives is not None else ""
        yield f"{with_}`({', '.join(_value(one) for one in call.arguments if not _kept(one))}){told}`"
    if step.calls[-1] in mine:
        for (node, address), data in step.after.items():
            where = f"{address}" if node == 1 else f"{address} of {node}"
            yield f"`{where}: {_bytes(data)}`"
        for fact, value in step.status.items():
            yield f"`{fact}: {value}`"


def _kept(argument: Any) -> bool:
    return isinstance(argument, dict)


def _bytes(data: list[int] | Held) -> str:
    return "as before" if isinstance(data, Held) else " ".join(f"{byte:02X}" for byte in data)


def _value(value: Any) -> str:
    if isinstance(value, Held):
        return "held"
    if isinstance(value, Through):
        return value.words
    if isinstance(value, Raised):
        return "raises" + (f" '{value.words}'" if value.words else "")
    if isinstance(value, Anything):
        return value.what
    if isinstance(value, list | tuple):
        text = [_value(one) for one in value]
        return f"[{', '.join(text)}]" if len(text) < 9 else f"[{', '.join(text[:4])}, … {len(text)} in all]"
    return repr(value)


def _registers(controller: str) -> Iterator[str]:
    yield f"### rustypot: {controller}PyController, by registers\n"
    yield "Every generated call, with a number that has a sign where there is one. `agrees`: what was read is what the"
    yield "servo held, and what was written is what it meant. An SCS0009 does not know SYNC READ: there the calls that"
    yield f"use it are run for `{registers.UNANSWERED}` alone, and for every register on the others.\n"
    rows = []
    for register in registers.registers(controller):
        unit, _, note = register.unit.words.rpartition(" ")
        speaks = f"{unit}, {_links([note])}" if note in NOTES else register.unit.words
        calls = "<br>".join(f"`{name}`" for name in registers.calls(register))
        cells = [_verdict(register, kind) for kind in KINDS]
        rows.append([f"`{register.name}`", register.address, calls, speaks or "a number", *cells])
    yield from _table(("register", "address", "calls", "its units", *SERVOS), rows)


def _verdict(register: registers.Register, kind: Kind) -> str:
    names = set(registers.calls(register))
    apart = controllers.talks(register.controller, kind)
    steps = [
        *registers.steps(register, kind),
        *(step for step in apart if names & {call.name for call in step.calls}),
    ]
    keys = dict.fromkeys(
        [*registers.differences(register, kind), *(key for step in steps for key in step.why.split())]
    )
    row, wanted = registers.row_at(register, kind), registers.ours(register)
    if not keys:
        return "agrees"
    if row is None or not {"other-register", "other-address"} & set(keys):
        return _links(keys)
    place = f", `{wanted}` at {kind.at(wanted)}" if "other-address" in keys else ""
    return f"`{row.name}` here{place}: {_links(keys)}"


def _links(keys: Iterable[str]) -> str:
    return ", ".join(f"[{key}](#{key})" for key in keys)


def _table(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> Iterator[str]:
    columns = list(columns)
    yield f"| {' | '.join(columns)} |"
    yield f"|{'---|' * len(columns)}"
    for row in rows:
        yield f"| {' | '.join(str(cell) for cell in row)} |"
    yield ""


def main() -> int:
    """Write the page, or with --check see that the one there is the one that would be written."""
    text = page()
    if "--check" in sys.argv[1:]:
        return int(not PAGE.exists() or PAGE.read_text(encoding="utf-8") != text)
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
