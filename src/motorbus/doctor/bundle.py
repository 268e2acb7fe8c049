"""A zip for an issue: the report, versions, what went over the wire. No machine file, no names of users."""

from __future__ import annotations

import platform
import zipfile
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

import msgspec

from motorbus.bus.trace import TraceRecord
from motorbus.doctor.findings import Report

PACKAGES: Final = ("motorbus", "serialx", "python-can", "msgspec", "lerobot")


def write(path: Path, report: Report, trace: Mapping[str, Sequence[TraceRecord]]) -> None:
    """Write the zip. Raises OSError; an existing file is replaced."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        data = msgspec.json.format(msgspec.json.encode(report), indent=2).decode()
        file.writestr("findings.json", _without_home(data))
        file.writestr("versions.json", msgspec.json.format(msgspec.json.encode(versions()), indent=2))
        for bus, records in trace.items():
            name = "".join(one if one.isalnum() else "_" for one in bus)
            file.writestr(f"trace-{name}.txt", "".join(f"{_line(one)}\n" for one in records))


def versions() -> dict[str, str]:
    """Versions of Python, the system, and the packages that are installed."""
    found = {"python": platform.python_version(), "system": f"{platform.system()} {platform.release()}"}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _line(record: TraceRecord) -> str:
    data = record.data.hex(" ").upper() if isinstance(record.data, bytes) else str(record.data)
    return f"{record.at:.6f} {record.direction} {data}"


def _without_home(text: str) -> str:
    return text.replace(str(Path.home()), "~")
