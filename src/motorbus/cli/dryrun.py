"""--dry-run: the frames that an action would send, up to the first reply that only a real run gets."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import TYPE_CHECKING, Any, Final

from msgspec import Struct

from motorbus.bus.engine import is_poll
from motorbus.cli import output
from motorbus.cli.output import confirm, note
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import ANY, Effect, Request, Step
from motorbus.core.steps import Exclusive, Gather, SetBitrate, Shielded, Sleep, discard
from motorbus.errors import MotorbusError

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.cli.common import Target, Writing
    from motorbus.core.family import Explanation

FRAMING: Final = ("header", "length", "checksum", "identifier", "reserved")


class Unforeseeable(MotorbusError):
    """What would be sent next depends on a reply that only a real run gets."""


class Withheld(Struct, frozen=True, tag="dry_run"):
    """A frame that would be sent, and its meaning."""

    would_send: str
    meaning: str


class Overlay:
    """Stands in place of a bus: reads go through, writes are kept in `withheld`."""

    def __init__(self, bus: Bus) -> None:
        self.family, self.rate = bus.family, bus.rate
        self.driver = copy(bus.driver)
        self.withheld: list[bytes] = []
        self._bus = bus
        self._written: set[int] = set()  # nodes; -1: all
        self._waited = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def run(self, runnable: Any, report: Any = None) -> Any:
        """Run a procedure without its writes. Raises what the procedure or the interlock raises."""
        if isinstance(runnable, Step):
            return self._step(runnable)
        value, error = None, None
        while True:
            try:
                step = runnable.throw(error) if error is not None else runnable.send(value)
            except StopIteration as end:
                return end.value
            value, error = None, None
            try:
                value = self._step(step)
            except Unforeseeable:
                runnable.close()
                raise
            except MotorbusError as failure:
                error = failure
            finally:
                discard(step)

    def _step(self, step: Any) -> Any:
        if isinstance(step, Request):
            return self._request(step)
        if isinstance(step, Exclusive | Shielded):
            return self.run(step.runnable)
        if isinstance(step, Gather):
            return tuple([self.run(one) for one in step.runnables])
        if isinstance(step, SetBitrate):  # on CAN, a host at another rate disturbs the bus
            return self._bus.run(step if self.family.link.kind == "bytes" else SetBitrate(0))
        if isinstance(step, Sleep):
            self._waited += step.seconds
            return self._bus.now() + self._waited
        return None  # `Emit`: no journal entry, nothing changes

    def _request(self, request: Request[Any]) -> Any:
        nodes = set() if request.expected is ANY else {one.node for one in request.expected}
        if is_poll(request):
            if {-1, *nodes} & self._written:
                raise Unforeseeable("later frames depend on replies to these: they are not shown")
            return self._bus.run(request)
        if self._bus.interlock is not None:
            self._bus.interlock.check(request, self._bus.now())
        self._written |= nodes or {-1}
        if request.effect is Effect.IDENTITY:
            self._written.add(-1)
        self.withheld.append(request.wire.flat() if isinstance(request.wire, CanFrame) else request.wire)
        return None


def carry_out(
    writing: Writing, target: Target | Bus, action: Callable[[Any], Any], question: str = ""
) -> Any:
    """Run `action(device or bus)`, after the question if there is one; gives its result.

    --dry-run prints the frames and gives None. Before a question, the action runs without its writes, so that what
    would be refused is refused first; an action that writes nothing needs no question.
    """
    real = getattr(target, "device", target)
    if writing.dry_run or (question and not writing.yes):
        bus: Any = getattr(target, "bus", target)
        overlay: Any = Overlay(bus)
        stand_in = overlay
        if real is not target:
            stand_in = overlay.family.devices.blocking(overlay, target.node)  # type: ignore[union-attr]
        try:
            action(stand_in)
        except Unforeseeable as error:
            if writing.dry_run:
                note(f"note: {error.summary}")
        finally:
            if bus.rate != overlay.rate:
                bus.run(SetBitrate(overlay.rate))
        if writing.dry_run:
            _print_frames(overlay)
            return None
        if overlay.withheld:
            confirm(question, writing)
    return action(real)


def _print_frames(overlay: Overlay) -> None:
    found = [one for frame in overlay.withheld for one in overlay.driver.decode(frame)]
    frames = [Withheld(one.data.hex(" ").upper(), _meaning(one)) for one in found]
    if output.as_json:
        output.print_json(frames)
    elif not frames:
        print("nothing would be written")
    else:
        print("\n".join(f"would send {one.would_send}\n    {one.meaning}" for one in frames))


def _meaning(one: Explanation) -> str:
    """What a frame of the host says, without its framing and without what it could be from a device."""
    names = [part.name for part in one.parts]
    start = names.index("instruction") + 1 if "instruction" in names else 0
    parts = [
        f"{part.name} {part.meaning}"
        for part in one.parts[start:]
        if part.name not in FRAMING and not part.name.startswith("as an")
    ]
    return "; ".join([one.title.partition(" (or ")[0], *parts])
