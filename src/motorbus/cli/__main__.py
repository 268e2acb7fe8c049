"""`python -m motorbus.cli` is the same program as `motorbus`, for when the script is not on the PATH."""

from __future__ import annotations

import sys

from motorbus.cli import main

if __name__ == "__main__":
    sys.exit(main())
