"""Install each library of peers.txt into a folder of its own, `.peers/NAME`.

Two of them have a module of the same name, so no two share a folder.
What cannot be installed is reported; the tests that need it then fail, they do not pass in silence.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / ".peers"


def requirements(text: str) -> dict[str, str]:
    """Name -> its lines of the locked file: one `name==version` and the hashes that belong to it."""
    found: dict[str, list[str]] = {}
    for line in text.splitlines():
        if line and not line[0].isspace():
            found[line.split("==")[0]] = []
        if found:
            found[list(found)[-1]].append(line)
    return {name: "\n".join(lines) + "\n" for name, lines in found.items()}


def install(name: str, lines: str) -> bool:
    """Fill `.peers/NAME`, without what it depends on. False when it cannot be had."""
    target = FOLDER / name
    shutil.rmtree(target, ignore_errors=True)
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        file.write(lines)
        file.flush()
        pip = [sys.executable, "-m", "pip", "install", "-qq", "--no-deps", "--require-hashes"]
        return not subprocess.run([*pip, "--target", str(target), "--requirement", file.name]).returncode


def main() -> int:
    """Exit code 0 when every library is there."""
    wanted = requirements((ROOT / "peers.txt").read_text(encoding="utf-8"))
    missing = [name for name, lines in wanted.items() if not install(name, lines)]
    for name in missing:
        print(f"NOT AVAILABLE: {name}; the tests against it cannot run", file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
