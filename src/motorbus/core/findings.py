"""What a check finds on a device: the contract between `doctor` and `families/*/checks.py`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from motorbus.core.family import Identity
from motorbus.core.steps import Runnable

Severity: TypeAlias = Literal["error", "warning", "info"]


class Finding(Struct, frozen=True, omit_defaults=True):
    """One finding: a stable `code`, what was measured against which limit, why, and one fix.

    What a check leaves out comes from the table of codes in `doctor`. `because` is the code of an earlier finding that
    may be the cause of this one.
    """

    code: str
    where: str
    evidence: str
    cause: str = ""
    action: str = ""
    severity: Severity | None = None
    because: str = ""


@dataclass(slots=True)
class Subject:
    """A device that answers: an object of its family on a read-only bus, its identity, its name for the user."""

    device: Any
    identity: Identity
    where: str
    found: list[Finding] = field(default_factory=list)

    def add(
        self, code: str, evidence: str, cause: str = "", action: str = "", severity: Severity | None = None
    ) -> None:
        """Add a finding about this device."""
        self.found.append(Finding(code, self.where, evidence, cause, action, severity))


Check: TypeAlias = "Callable[[Subject], Runnable[None]]"
"""A procedure that only reads, and adds what it finds to the subject."""
