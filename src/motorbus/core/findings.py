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

    `because` is the code of an earlier finding that may be the cause of this one.
    """

    code: str
    severity: Severity
    where: str
    evidence: str
    cause: str
    action: str
    because: str = ""


@dataclass(slots=True)
class Subject:
    """A device that answers: an object of its family on a read-only bus, its identity, its name for the user."""

    device: Any
    identity: Identity
    where: str
    found: list[Finding] = field(default_factory=list)

    def error(self, code: str, evidence: str, cause: str, action: str) -> None:
        """Add an error: it does not work before this is fixed."""
        self.found.append(Finding(code, "error", self.where, evidence, cause, action))

    def warn(self, code: str, evidence: str, cause: str, action: str) -> None:
        """Add a warning: it works now, or in this program only."""
        self.found.append(Finding(code, "warning", self.where, evidence, cause, action))

    def inform(self, code: str, evidence: str, cause: str, action: str) -> None:
        """Add a fact that is right in most machines."""
        self.found.append(Finding(code, "info", self.where, evidence, cause, action))


Check: TypeAlias = "Callable[[Subject], Runnable[None]]"
"""A procedure that only reads, and adds what it finds to the subject."""
