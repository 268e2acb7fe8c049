"""What all modules of the shell share: exit codes, options of commands, a device of an open bus."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

from cyclopts import Parameter

from motorbus import errors

if TYPE_CHECKING:
    from motorbus.bus.blocking import Bus
    from motorbus.core.family import Family

FILE: Final = "motorbus.toml"


class Exit(IntEnum):
    """Exit codes of the program."""

    OK = 0
    FAILURE = 1
    USAGE = 2
    PORT_NOT_FOUND = 3
    PORT_BUSY = 4
    NO_REPLY = 5
    PARTIAL = 6
    DEVICE_REFUSED = 7
    UNSAFE = 8
    VERIFICATION_FAILED = 9
    CANCELLED = 10


class NeedsConsent(errors.MotorbusError):
    """The action needs --yes. Nothing was changed."""


class Partial(errors.MotorbusError):
    """Some devices did it, others did not."""


@Parameter(name="*")
@dataclass
class Common:
    """Options of every command."""

    json: Annotated[bool, Parameter(help="Print JSON.")] = False
    machine: Annotated[
        str, Parameter(env_var="MOTORBUS_MACHINE", show_env_var=False, help="Machine file.")
    ] = FILE
    bus: Annotated[str, Parameter(env_var="MOTORBUS_BUS", show_env_var=False, help="Default bus.")] = ""
    option: Annotated[
        list[str], Parameter(name="-o", metavar="KEY=VALUE", help="Option of the bus; repeatable.")
    ] = field(default_factory=list)
    verbose: Annotated[int, Parameter(name="-v", count=True, help="Log; -vv logs each frame.")] = 0


@Parameter(name="*")
@dataclass
class Writing:
    """Options of commands that write."""

    yes: Annotated[bool, Parameter(name=["--yes", "-y"], help="Do not ask.")] = False
    dry_run: Annotated[bool, Parameter(help="Show what would be sent; write nothing.")] = False


class Target(NamedTuple):
    """A device of an open bus. `name` is an axis, or `#ID`; `device` has the methods of its family."""

    name: str
    bus: Bus
    node: int
    family: Family
    device: Any
