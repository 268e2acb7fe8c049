"""Row 14: what `import motorbus` costs against the vendor's SDK, and which heavy modules it loads.

The import loads little, and the rest on demand; so what a program needs that opens a bus and has a servo is told as a
row of its own, which has no goal.

Processor time of the import statement alone, in an interpreter that has loaded nothing else, with compiled modules at
hand; of three processes in each round the quickest.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from statistics import median
from typing import Any, Final

from bench import apart
from bench.places import ROOT, surroundings
from bench.responder import build, responder
from bench.rounds import Failed
from bench.row import PROCESS, SAMPLES, Row, Say, pairs

NUMBERS = ("14",)
SDK: Final = "feetech-servo-sdk"
OURS: Final = "motorbus"
USED: Final = "motorbus, used"
HEAVY: Final = ("argparse", "asyncio", "numpy", "serial")
"""What no import of ours may load."""
TAKES: Final = 3

IMPORTS: Final = {
    OURS: "import motorbus",
    USED: "import motorbus; motorbus.feetech.Servo; motorbus.open",
    SDK: "import scservo_sdk",
}
JOBS: Final = (
    apart.Job(OURS, "", (IMPORTS[OURS],)),
    apart.Job(USED, "", (IMPORTS[USED],)),
    apart.Job(SDK, "", (IMPORTS[SDK],), (SDK, "pyserial")),
)

_TIMED = """
import sys, time
before = time.process_time()
{statement}
after = time.process_time()
print('{{"seconds":', after - before, ', "modules":', len(sys.modules), end=', ')
print('"heavy": [', ', '.join('"%s"' % name for name in {heavy!r} if name in sys.modules), ']}}')
"""
_OPENED = """
with motorbus.open("feetech:{port},baud=1000000") as bus:
    motorbus.feetech.Servo(bus, 1).position()
"""


def rows(rounds: int, say: Say) -> list[Row]:
    """All rows 14: the time, that of an import that is used, and the modules. Raises Failed or NoCompiler."""
    jobs = [job for job in JOBS if job.there]
    found = apart.rounds(jobs, max(rounds, SAMPLES), say, quickest)
    modules = found[OURS][0]["heavy"]
    opened = ", ".join(once_opened()) or "none of them"
    note = (
        f"{found[OURS][0]['modules']} modules in all; what opens a bus brings "
        f"{', '.join(found[USED][0]['heavy']) or 'none of them'}, a serial port that is opened {opened}, by serialx"
    )
    measure, figure = "numpy, asyncio, serial, argparse loaded by import motorbus", float(len(modules))
    count = Row("14", measure, "-", "", figure, figure, figure, "<= 0", note=note, samples=1, margin=0.0)
    if len(jobs) < len(JOBS):
        say(f"{SDK} is not installed: the first rows 14 are not measured\n")
        return [count]
    return [
        _row(found, OURS, "import of the package", "<= 2", "<= 1"),
        _row(found, USED, "import of the package, and of what opens a bus and has a servo"),
        count,
    ]


def _row(found: Any, name: str, measure: str, goal: str = "", stretch: str = "") -> Row:
    ours, theirs = ([one["seconds"] for one in found[who]] for who in (name, SDK))
    return Row(
        "14",
        measure,
        SDK,
        "x",
        *pairs(ours, theirs),
        goal,
        stretch,
        median(ours),
        median(theirs),
        len(ours),
        f"{found[name][0]['modules']} modules, theirs {found[SDK][0]['modules']}",
        PROCESS,
    )


def quickest(job: apart.Job) -> dict[str, Any]:
    """The import of this job in a few fresh processes, the quickest of them."""
    return min(
        (imported(job.arguments[0], job.peers) for _ in range(TAKES)), key=lambda said: said["seconds"]
    )


def imported(statement: str, peers: Sequence[str] = ()) -> dict[str, Any]:
    """Seconds of processor time, modules loaded, and the heavy ones among them. Raises Failed."""
    program = _TIMED.format(statement=statement, heavy=HEAVY)
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=dict(surroundings(*peers)),
    )
    if done.returncode:
        raise Failed(f"{statement}: {done.stderr.strip()}")
    said: dict[str, Any] = json.loads(done.stdout)
    return said


def once_opened() -> list[str]:
    """The heavy modules that are there once a port was opened and a servo read."""
    with responder(build()) as wire:
        statement = IMPORTS[OURS] + _OPENED.format(port=wire.port)
        return list(imported(statement)["heavy"])
