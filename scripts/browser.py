"""Install Chromium for the tests of the page: by apt, else by playwright. build/no-browser says that neither can."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

MISSING = Path(__file__).parents[1] / "build/no-browser"
APT = [["apt-get", "update"], ["apt-get", "install", "--yes", "chromium"]]
PLAYWRIGHT = [sys.executable, "-m", "playwright", "install", "chromium"]


def main() -> int:
    """Install it, unless it is here."""
    MISSING.unlink(missing_ok=True)
    if shutil.which("chromium"):
        return 0
    if shutil.which("apt-get") and os.geteuid() == 0:
        for command in APT:
            subprocess.run(command, check=False, capture_output=True)
        if shutil.which("chromium"):
            return 0
    if subprocess.run(PLAYWRIGHT, check=False, capture_output=True).returncode == 0:
        return 0
    MISSING.parent.mkdir(exist_ok=True)
    MISSING.touch()
    print("Chromium cannot be installed here: the tests of the page are skipped", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
