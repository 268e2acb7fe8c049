"""Commands of one family for one device BUS#ID: open its bus, read or write, show the result."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import partial, wraps
from typing import Annotated, Any, Final, Generic, TypeVar

from cyclopts import App, Parameter

from motorbus.cli import dry
from motorbus.cli.consent import consent_to
from motorbus.cli.exits import Exit
from motorbus.cli.output import Output
from motorbus.cli.parameters import DryRun, Flag, Silent
from motorbus.cli.target import device, id_shown, opened, target
from motorbus.errors import RequestError

OptionOfBus: Final = Annotated[str, Parameter(help="Any option of the bus, as a flag.")]
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
        self.address, self.kind, self.output, self.options = address, kind, output, options
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
            return dry.rehearse(rehearsal, rehearse, self.output)  # type: ignore[return-value]

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


def family_command(
    app: App, usage: str, text: str, *examples: str
) -> Callable[[Callable[..., Exit]], Callable[..., Exit]]:
    """Register a function as a command of a family; `usage` and `examples` stand without `motorbus FAMILY`."""
    family, name = app.name[0], usage.split()[0]
    lines = [f"    motorbus {family} {example}" for example in examples]
    epilogue = "\n".join([text, "", "Examples:", "", *lines]).lstrip()
    usage = f"Usage: motorbus {family} {usage} [OPTIONS]"
    return partial(app.command, name=name, usage=usage, help_epilogue=epilogue)


def device_command(
    app: App,
    kind: Callable[[Any, int], Any],
    address: object,
    usage: str,
    text: str,
    *examples: str,
    consent: str = "a permanent change",
    dry_run: bool = True,
) -> Callable[[Callable[..., Exit]], Callable[..., Exit]]:
    """Register a function with a parameter `run`, a `DeviceCommand`, as a command of a family, see `family_command`.

    On the command line BUS#ID (annotated by `address`) has the place of `run`. Every command takes the options of the
    bus; those that write take --dry-run and, unless `consent` is empty, --yes: do not ask before `consent`.
    """
    family, name = app.name[0], usage.split()[0]

    def register(function: Callable[..., Exit]) -> Callable[..., Exit]:
        inner = inspect.signature(function, eval_str=True)
        parameters = [
            one.replace(name="address", annotation=address) if one.name == "run" else one
            for one in inner.parameters.values()
        ]
        option = partial(inspect.Parameter, kind=inspect.Parameter.KEYWORD_ONLY)
        if consent:
            yes = Annotated[Flag, Parameter(help=f"Do not ask before {consent}.")]
            parameters.append(option("yes", default=False, annotation=yes))
        if dry_run:
            parameters.append(option("dry_run", default=False, annotation=DryRun))
        parameters.append(option("output", annotation=Silent))
        parameters.append(inspect.Parameter("options", inspect.Parameter.VAR_KEYWORD, annotation=OptionOfBus))
        outer = inner.replace(parameters=parameters)

        @wraps(function)
        def command(*args: Any, **kwargs: Any) -> Exit:
            bound = outer.bind(*args, **kwargs)
            bound.apply_defaults()
            arguments = bound.arguments
            common = {one: arguments[one] for one in ("address", "output", "options")}
            flags = {one: arguments[one] for one in ("yes", "dry_run") if one in arguments}
            arguments["run"] = DeviceCommand(family, kind, name, **common, **flags)
            call = inspect.BoundArguments(inner, arguments)
            return function(*call.args, **call.kwargs)

        command.__signature__ = outer  # type: ignore[attr-defined]
        command.__annotations__ = {one.name: one.annotation for one in parameters}
        return family_command(app, usage, text, *examples)(command)

    return register
