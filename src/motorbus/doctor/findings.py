"""The report of an examination, and the order of its findings."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Final

from msgspec import Meta, Struct, structs

from motorbus.core.findings import Finding
from motorbus.doctor.codes import CODES

SEVERITIES: Final = ("error", "warning", "info")
ORDER: Final = list(CODES)


class DeviceHealth(Struct, frozen=True):
    """What was measured at one device; latencies are those of a read."""

    model: str
    firmware: str
    voltage: Annotated[float | None, Meta(extra={"unit": "V"})] = None
    current: Annotated[float | None, Meta(extra={"unit": "A"})] = None
    temperature: Annotated[float | None, Meta(extra={"unit": "°C"})] = None
    lost: Annotated[float, Meta(extra={"unit": "%"})] = 0.0
    p50: Annotated[float | None, Meta(extra={"unit": "ms"})] = None
    p99: Annotated[float | None, Meta(extra={"unit": "ms"})] = None


class Report(Struct, frozen=True, tag="doctor"):
    """The findings, the first cause first, and the health of the devices that answer, by their names."""

    target: str
    findings: tuple[Finding, ...] = ()
    devices: dict[str, DeviceHealth] = {}
    simulated: bool = False

    def count(self, severity: str) -> int:
        """The number of findings of this severity."""
        return sum(one.severity == severity for one in self.findings)


def complete(one: Finding, bus: str) -> Finding:
    """The finding with what the table of codes says where it says nothing itself."""
    code = CODES[one.code]
    cause, action = one.cause or code.cause, one.action or code.action
    action = action.replace("{where}", one.where).replace("{bus}", bus)
    return structs.replace(one, cause=cause, action=action, severity=one.severity or code.severity)


def arrange(found: Iterable[Finding], bus: str) -> list[Finding]:
    """The findings of one bus in order, complete; equal ones at several places become one.

    An error of the bus explains its later findings, one of a device those of that device.
    """
    explained: list[Finding] = []
    for one in sort(_merge(complete(one, bus) for one in found)):
        causes = [first.code for first in explained if _explains(first, one, bus)]
        explained.append(structs.replace(one, because=causes[0]) if causes else one)
    return explained


def sort(found: Iterable[Finding]) -> list[Finding]:
    """Errors, warnings, facts; in each by the chain."""
    return sorted(
        found, key=lambda one: (SEVERITIES.index(one.severity or "error"), ORDER.index(one.code), one.where)
    )


def _merge(found: Iterable[Finding]) -> list[Finding]:
    groups: dict[tuple[str, ...], list[Finding]] = {}
    for one in found:
        groups.setdefault((one.code, one.severity or "", one.cause), []).append(one)
    return [
        structs.replace(
            group[0],
            where=", ".join(dict.fromkeys(one.where for one in group)),
            evidence="; ".join(dict.fromkeys(one.evidence for one in group)),
        )
        for group in groups.values()
    ]


def _explains(first: Finding, later: Finding, bus: str) -> bool:
    is_earlier = ORDER.index(first.code) < ORDER.index(later.code)
    if first.severity != "error" or first.because or later.severity == "info" or not is_earlier:
        return False
    return first.where == bus or bool(set(first.where.split(", ")) & set(later.where.split(", ")))
