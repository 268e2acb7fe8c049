"""A command of one family for one device BUS#ID: open its bus, read or write, show the result."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Exit
from motorbus.cli.target import device, id_shown, opened, target
from motorbus.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from motorbus.cli.output import Output

D = TypeVar("D")
T = TypeVar("T")


class DeviceCommand(Generic[D]):
    """One run of the command `name` on the device BUS#ID of a family; `kind(bus, node)` makes the device.

    Raises RequestError unless BUS#ID is one device of that family.
    """

    def __init__(
        self,
        family: str,
        kind: Callable[[Any, int], D],
        name: str,
        address: str,
        output: Output,
        options: Mapping[str, str],
        *,
        dry_run: bool = False,
        yes: bool = False,
    ) -> None:
        bus = target(address.partition("#")[0])
        if bus.family.name != family:
            raise RequestError(f"{bus.bus} is no {family} bus", advice="nothing was sent")
        self.bus, _, (self.node,) = device(address)
        self.label = f"#{id_shown(self.node, bus.family)}"
        self.schema = f"motorbus.{family}.{name}/1"
        self.kind, self.output, self.options = kind, output, options
        self.dry_run, self.yes = dry_run, yes

    def read(self, action: Callable[[D], T]) -> T:
        """The result of an action that only reads. Raises RequestError with --dry-run."""
        if self.dry_run:
            raise RequestError(
                "without a new value this command only reads, so --dry-run has no effect",
                expected="a new value, or no --dry-run",
                advice="nothing was sent",
            )
        with opened(self.bus, self.options, self.output) as bus:
            return action(self.kind(bus, self.node))

    def write(self, action: Callable[[D], T], question: str = "") -> T:
        """The result of an action that writes; with --dry-run its frames are shown, and the result has no meaning.

        Without --yes the user is asked `question`. The action is run dry before, so that what is refused anyway raises
        its own error. Raises NeedsConsent if the user does not agree.
        """
        with opened(self.bus, self.options, self.output) as bus:
            rehearsal = dry.DryBus(bus)
            rehearse = partial(action, self.kind(rehearsal, self.node))
            if not self.dry_run:
                agreed = self.yes or not question
                consent_to(f"{self.label}: {question}", self.output, yes=agreed, rehearse=rehearse)
                return action(self.kind(bus, self.node))
            result = rehearse()
        dry.show(rehearsal, self.output)
        return result

    def show(self, facts: Mapping[str, object], text: str = "", **columns: str) -> Exit:
        """Show the result: as JSON, or as text or a table. A dry run has none."""
        if self.dry_run:
            return Exit.OK
        self.output.document(self.schema, {"id": self.node, **facts})
        if columns:
            self.output.table(f"#{self.node}", list(columns), [list(columns.values())])
        else:
            self.output.text(text)
        return Exit.OK
