"""`python -m tests.golden --write [FAMILY …]`: record the golden traces again."""

from __future__ import annotations

import argparse
import os
import tempfile

from tests.golden.catalogue import CASES, VARIANTS
from tests.golden.recording import write


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.golden", description="Record the golden traces again."
    )
    parser.add_argument("--write", action="store_true", required=True, help="replace the recorded traces")
    parser.add_argument("family", nargs="*", default=list(VARIANTS), help="families to record; default: all")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ.update({f"XDG_{name}_HOME": folder for name in ("STATE", "CONFIG", "CACHE")})
        for family in asked.family:
            print(f"{family}: {write(family, CASES)} traces")


main()
