"""Install Chromium for the tests of the page: of the system if there is one, else by apt, else by playwright."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys


def main() -> int:
    """Install it, unless it is here."""
    if shutil.which("chromium"):
        return 0
    commands = [[sys.executable, "-m", "playwright", "install", "chromium"]]
    if shutil.which("apt-get") and os.geteuid() == 0:
        commands = [["apt-get", "update"], ["apt-get", "install", "--yes", "chromium"], *commands]
    for command in commands:
        done = subprocess.run(command, check=False, capture_output=True)
        if (
            done.returncode == 0
            and command[1] != "update"
            and (shutil.which("chromium") or command is commands[-1])
        ):
            return 0
    print("Chromium cannot be installed here; the tests of the page in a browser will fail", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
