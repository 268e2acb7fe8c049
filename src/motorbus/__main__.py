"""`python -m motorbus` is the program `motorbus`."""

from __future__ import annotations

import sys

from motorbus.cli import main

if __name__ == "__main__":
    sys.exit(main())
