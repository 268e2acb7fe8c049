"""The codes of findings in the order of the chain, and the report of an examination."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Final

from msgspec import Meta, Struct, structs

from motorbus.core.findings import Finding

CHAIN: Final[Mapping[str, tuple[str, ...]]] = {
    "host": (
        *("port-missing", "port-permission", "port-busy", "brltty", "rate-refused", "port-refused"),
        "port-lost",
    ),
    "adapter": ("adapter-menu", "adapter-echo", "adapter-no-ack", "latency-timer"),
    "power": ("supply-out-of-range", "supply-sag"),
    "chain": (
        *("bus-silent", "can-silent", "wrong-rate", "can-wrong-bitrate", "can-mute-node"),
        *("stepper-foreign", "device-missing", "line-noise", "replies-lost"),
    ),
    "ids": ("duplicate-id", "factory-id", "can-id-pending", "device-unnamed"),
    "model": ("model-unknown", "firmware-mixed"),
    "settings": (
        *("change-unfinished", "overload-latched", "too-hot", "alarm", "load-high", "mode-differs"),
        *("calibration-other", "calibration-wrap", "motion-blocked", "settings-left"),
        *("no-acknowledgement", "return-delay", "eeprom-open", "project-error", "homing-not-seen"),
    ),
    "machine": (
        *("machine-file", "axis-mismatch", "calibration-differs", "outside-limits"),
        *("exit-falls", "estop-falls", "loop-too-fast", "loop-rate", "check-failed"),
    ),
}
"""All codes, by the part of the chain: what stands first may be the cause of what stands later."""
ORDER: Final = {code: number for number, code in enumerate(sum(CHAIN.values(), ()))}
SEVERITIES: Final = ("error", "warning", "info")


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


def arrange(found: Iterable[Finding], bus: str) -> list[Finding]:
    """The findings of one bus in order: errors, warnings, facts; in each by the chain. Equal ones become one.

    An error of the bus explains its later findings, one of a device those of that device.
    """
    explained: list[Finding] = []
    for one in sort(_merge(found)):
        causes = [first.code for first in explained if _explains(first, one, bus)]
        explained.append(structs.replace(one, because=causes[0]) if causes else one)
    return explained


def sort(found: Iterable[Finding]) -> list[Finding]:
    """By severity, then by the chain."""
    return sorted(found, key=lambda one: (SEVERITIES.index(one.severity), ORDER[one.code], one.where))


def _merge(found: Iterable[Finding]) -> list[Finding]:
    groups: dict[tuple[str, ...], list[Finding]] = {}
    for one in found:
        groups.setdefault((one.code, one.severity, one.cause), []).append(one)
    return [
        structs.replace(
            group[0],
            where=", ".join(dict.fromkeys(one.where for one in group)),
            evidence="; ".join(dict.fromkeys(one.evidence for one in group)),
        )
        for group in groups.values()
    ]


def _explains(first: Finding, later: Finding, bus: str) -> bool:
    is_earlier = ORDER[first.code] < ORDER[later.code] and not first.because
    if first.severity != "error" or later.severity == "info" or not is_earlier:
        return False
    same = set(first.where.split(", ")) & set(later.where.split(", "))
    return first.where == bus or bool(same)
