"""`python -m bench`: motorbus beside other libraries on simulated servos; one table of ratios."""

from __future__ import annotations

import argparse
import json
import sys

from bench import report, runner


def main() -> int:
    """Exit code 1 when a library is not installed, or motorbus took a wrong value."""
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("--rounds", type=int, default=40, help="shuffled rounds (default %(default)s)")
    parser.add_argument(
        "--late", type=int, default=2000, help="reads with late replies (default %(default)s)"
    )
    parser.add_argument("--json", action="store_true", help="print the records as JSON")
    given = parser.parse_args()
    if absent := runner.missing():
        print(f"NOT AVAILABLE: {', '.join(absent)}; `make bench` installs them", file=sys.stderr)
        return 1
    samples = runner.measure(given.rounds, given.late, lambda text: print(text, file=sys.stderr))
    records = list(report.rows(samples, given.late))
    print(json.dumps(records, indent=1, ensure_ascii=False) if given.json else report.as_text(records))
    return int(any(record["wrong"] for record in records if record["library"] == "motorbus"))


if __name__ == "__main__":
    sys.exit(main())
