"""Run a few tests on every other supported Python that this machine has, and say which ones it has not.

An interpreter counts as found when it has been run and can make a virtual environment: names and folders lie (a
version manager's shim exists for versions that are not selected). One that is missing is reported as NOT RUN,
never as passed; one that is found and fails makes the exit code non-zero.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
from collections.abc import Iterator
from glob import glob
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
WANTED = ((3, 11), (3, 12), (3, 13))
PROBE = "import sys, venv, ensurepip; print(sys.implementation.name, *sys.version_info[:2], sys.executable)"
FOLDERS = (
    "/usr/bin",
    "/usr/local/bin",
    "~/.local/bin",
    "~/.pyenv/versions/*/bin",
    "~/.local/share/uv/python/*/bin",
)


class Row(NamedTuple):
    """One line of the final table; `passed` is None for what did not run here."""

    version: str
    interpreter: str
    outcome: str
    passed: bool | None = None


def candidates(version: tuple[int, int]) -> Iterator[str]:
    """Paths that may be a Python of this version."""
    name = f"python{version[0]}.{version[1]}"
    if path := shutil.which(name):
        yield path
    for folder in FOLDERS:
        yield from sorted(glob(f"{Path(folder).expanduser()}/{name}"))


def runs(path: str, version: tuple[int, int]) -> bool:
    """Is it there, CPython, of this version, and able to make a virtual environment?"""
    try:
        found = subprocess.run([path, "-c", PROBE], capture_output=True, text=True, timeout=30, check=True)
    except (OSError, subprocess.SubprocessError):
        return False
    return found.stdout.split()[:3] == ["cpython", str(version[0]), str(version[1])]


def environment(path: str, version: tuple[int, int]) -> Path:
    """The Python of `.venvs/3.X`, made by `path` from the locked dependencies if it is not up to date."""
    folder = ROOT / ".venvs" / f"{version[0]}.{version[1]}"
    python, stamp = folder / "bin" / "python", folder / ".ready"
    state = hashlib.sha256((ROOT / "requirements.lock").read_bytes() + path.encode()).hexdigest()
    if not (stamp.exists() and stamp.read_text(encoding="utf-8") == state):
        print(f"installing the locked dependencies for {path} (once)", flush=True)
        subprocess.run([path, "-m", "venv", "--clear", str(folder)], check=True)
        pip = [str(python), "-m", "pip", "install", "-qq"]
        subprocess.run([*pip, "--require-hashes", "--requirement", "requirements.lock"], cwd=ROOT, check=True)
        subprocess.run([*pip, "--no-deps", "--no-build-isolation", "--editable", "."], cwd=ROOT, check=True)
        stamp.write_text(state, encoding="utf-8")
    return python


def check(version: tuple[int, int]) -> Row:
    """Run the quick subset on the first interpreter of this version that works."""
    label = f"{version[0]}.{version[1]}"
    if version == sys.version_info[:2]:
        return Row(label, sys.executable, "the whole of `make test` runs on this one")
    path = next((path for path in candidates(version) if runs(path, version)), None)
    if path is None:
        return Row(label, "none found", "NOT RUN")
    try:
        python = environment(path, version)
    except subprocess.CalledProcessError as error:
        return Row(label, path, f"FAILED: no environment ({error})", passed=False)
    print(f"the quick tests on {path}", flush=True)
    command = [str(python), "-m", "pytest", "--quick", "-q", "-n", "auto", "-p", "no:cacheprovider"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    lines = ended.stdout.strip().splitlines() or ["pytest printed nothing"]
    if ended.returncode:
        print(ended.stdout, ended.stderr, sep="\n")
        return Row(label, path, f"FAILED: {lines[-1]}", passed=False)
    return Row(label, path, lines[-1], passed=True)


def main() -> int:
    """Exit code 1 when an interpreter that was found failed."""
    rows = [check(version) for version in WANTED]
    width = max(len(row.interpreter) for row in rows)
    print()
    for row in rows:
        print(f"{row.version:5} {row.interpreter:{width}}  {row.outcome}")
    missing = [row.version for row in rows if row.outcome == "NOT RUN"]
    if missing:
        print(f"NOT RUN: {', '.join(missing)} (no such interpreter here)")
    return 1 if any(row.passed is False for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
