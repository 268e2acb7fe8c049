"""Run the commands of unmodified LeRobot releases against the plugin, each release on the Python it needs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from scripts.interpreters import ROOT, candidates, runs

RELEASES = {
    # lerobot-setup-motors of 0.4 knows no plugins; its recorder needs packages that these tests do not install
    "0.4.4": ((3, 11), "peers.txt", "not setup_motors and not record"),
    "0.6.1": ((3, 12), "lerobot-0.6.txt", ""),
}


def environment(release: str, path: str, locked: str) -> Path:
    """The folder of an environment with this release, what it imports, this project and the plugin."""
    folder = ROOT / ".venvs" / f"lerobot-{release}"
    stamp = folder / ".ready"
    state = path + (ROOT / "lerobot.txt").read_text() + (ROOT / "requirements.lock").read_text()
    if not (stamp.exists() and stamp.read_text() == state):
        print(f"installing LeRobot {release} for {path} (once)", flush=True)
        subprocess.run([path, "-m", "venv", "--clear", str(folder)], check=True)
        pip = [str(folder / "bin/python"), "-m", "pip", "install", "-qq", "--no-deps"]
        for file in ("lerobot.txt", "requirements.lock"):
            subprocess.run([*pip, "--require-hashes", "--requirement", file], cwd=ROOT, check=True)
        lines = _lines_of("lerobot", (ROOT / locked).read_text())
        (folder / "lerobot.txt").write_text(lines)
        subprocess.run([*pip, "--require-hashes", "--requirement", str(folder / "lerobot.txt")], check=True)
        own = [*pip, "--no-build-isolation"]
        subprocess.run([*own, "--editable", ".", "--editable", "integrations/lerobot"], cwd=ROOT, check=True)
        stamp.write_text(state)
    return folder


def _lines_of(name: str, text: str) -> str:
    """The line of a package in a locked file, and its hashes."""
    found, inside = [], False
    for line in text.splitlines():
        if line and not line[0].isspace():
            inside = line.startswith(f"{name}==")
        if inside:
            found.append(line)
    return "\n".join(found) + "\n"


def main() -> int:
    """Exit code 1 when a release fails; a release whose Python is missing is reported as NOT RUN."""
    failed = False
    for release, (version, locked, chosen) in RELEASES.items():
        path = next((path for path in candidates(version) if runs(path, version)), None)
        if path is None:
            print(f"LeRobot {release}: NOT RUN (no Python {version[0]}.{version[1]} here)")
            continue
        folder = environment(release, path, locked)
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "-k",
            chosen,
            "tests/interop/lerobot",
        ]
        print(f"LeRobot {release} on {path}", flush=True)
        ended = subprocess.run(command, cwd=ROOT, env={**os.environ, "MOTORBUS_LEROBOT": str(folder)})
        failed |= ended.returncode != 0
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
