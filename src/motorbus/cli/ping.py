"""`motorbus ping`: are they there, and how long do they take."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import App, Parameter

from motorbus.cli import faces
from motorbus.cli.exits import Exit, Partial
from motorbus.cli.output import Output
from motorbus.cli.target import face, gathered, nobody, opened, rate_word, targets
from motorbus.errors import NoReply, RequestError

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus

_COLLIDED: Final = "several devices answered at once, as they do to a broadcast, or the line is noisy"

app = App(
    name="ping",
    usage="Usage: motorbus ping BUS#ID... [OPTIONS]",
    help_epilogue="""Ends with exit code 0 when all answer, 6 when some do, 5 when none does.
--broadcast asks everyone on BUS at once, where the family can; the answers may
collide, so who does not answer may be there all the same. When some did, that
is told, and it ends with 6, or with 5 when no answer was left whole.

Examples:

    motorbus ping feetech:/dev/ttyACM0#1
    motorbus ping feetech:/dev/ttyACM0#1-6
    motorbus ping feetech:/dev/ttyACM0 --broadcast
    motorbus ping feetech:sim,ids=1-6#1+3 --json""",
)


@app.default
def ping(
    *devices: Annotated[str, Parameter(name="BUS#ID")],
    broadcast: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Output, Parameter(parse=False)],
    **options: str,
) -> Exit:
    """Ask devices whether they are there.

    Parameters
    ----------
    devices
        FAMILY:PORT#ID, as feetech:/dev/ttyACM0#3 or feetech:/dev/ttyACM0#1-6
    broadcast
        Ask everyone at once.
    options
        Any option of the bus string, as a flag.
    """
    answers: list[dict[str, object]] = []
    garbled: list[str] = []
    for bus, nodes in _wanted(devices, broadcast).items():
        with opened(bus, options, output) as opening:
            if broadcast:
                answers += _shout(opening, bus, garbled)
            else:
                answers += [_ask(opening, bus, node) for node in nodes]
    output.document("motorbus.ping/1", {"devices": answers})
    rows = [(a["id"], "yes" if a["answers"] else "NO", a["milliseconds"]) for a in answers]
    output.table("", [">id", "answers", ">ms"], rows)
    if garbled:
        raise Partial(
            f"{', '.join(garbled)}: several answered at once, and part of what came was garbled",
            cause=_COLLIDED,
            advice=_scanned(garbled[0]),
        )
    return _verdict(answers, devices)


def _wanted(devices: tuple[str, ...], broadcast: bool) -> dict[str, tuple[int, ...]]:
    found = gathered(devices)
    if broadcast and any("#" in text for text in devices):
        raise RequestError("a broadcast asks everyone", expected="BUS without ids", advice="nothing was sent")
    if not broadcast and not all(found.values()):
        raise RequestError("which device?", expected="BUS#ID, as feetech:/dev/ttyACM0#3")
    return found


def _shout(opening: Bus, bus: str, garbled: list[str]) -> list[dict[str, object]]:
    """Who answers a question to everyone; `garbled` gets this bus where more came than whole answers."""
    ping_everyone = faces.offer(opening.family.name, "ping_everyone")
    if ping_everyone is None:
        raise RequestError(f"{opening.family.name} buses have no broadcast ping", advice="nothing was sent")
    before = _wrong(opening)
    found = ping_everyone(opening)
    harmed = _wrong(opening) > before
    if not found:
        raise _nothing_whole(bus) if harmed else nobody(bus)
    garbled += [bus] * harmed
    return [{"bus": bus, "id": node, "answers": True, "milliseconds": None} for node in found]


def _wrong(opening: Bus) -> int:
    """How often bytes came that are no frame, or one with a wrong checksum."""
    counts = opening.statistics.other
    return counts["checksum"] + counts["framing"]


def _nothing_whole(bus: str) -> NoReply:
    return NoReply(
        f"{bus}: something answers, and not one answer came whole", cause=_COLLIDED, advice=_scanned(bus)
    )


def _scanned(bus: str) -> str:
    return f"`motorbus scan {bus}` asks one id after the other, where nothing collides"


def _ask(opening: Bus, bus: str, node: int) -> dict[str, object]:
    began = opening.link.now()
    try:
        answers = face(opening, node).ping()
    except NoReply:
        answers = False
    took = round(1000 * (opening.link.now() - began), 3)
    return {"bus": bus, "id": node, "answers": answers, "milliseconds": took if answers else None}


def _verdict(answers: list[dict[str, object]], devices: tuple[str, ...]) -> Exit:
    silent = [answer["id"] for answer in answers if not answer["answers"]]
    if not silent:
        return Exit.OK
    names = ", ".join(f"#{node}" for node in silent)
    if len(silent) == len(answers):
        rate = rate_word(targets(devices[0])[0].family)
        raise NoReply(
            f"no answer from {names}",
            cause="no power, a loose cable, another id or another rate",
            advice=f"`motorbus scan BUS --{rate} all` looks for every id at every rate",
        )
    raise Partial(f"no answer from {names}")
