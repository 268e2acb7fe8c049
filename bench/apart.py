"""Measured code in processes of its own, in shuffled rounds; each prints one line of JSON.

A process has no memory of what was measured before it, meets no other library's modules, and what it costs to start is
not measured. A ratio is taken within its round, so a machine that gets slower meanwhile hurts both sides alike. What is
run once more, because an answer was late or a process was held up, is counted and told; what was wrong in ours is not
run again.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from bench.places import PEERS, ROOT, surroundings
from bench.rounds import Failed, Wrong

TIMEOUT = 120.0
WRONG = ("AssertionError", "Failed", "Wrong", "WrongValue")
"""Errors by which such a process says that something was wrong; by any other it says that it could not do its work."""
repeated: Counter[str] = Counter()
"""How often each job of this program was run once more, by its name."""


class Job(NamedTuple):
    """What a process is to do: a name, a module of this tree, its arguments, and the folders of `.peers` it needs."""

    name: str
    module: str
    arguments: tuple[str, ...] = ()
    peers: tuple[str, ...] = ()

    @property
    def ours(self) -> bool:
        """Whether it runs nobody else's library."""
        return not self.peers

    @property
    def there(self) -> bool:
        """Whether its peers are installed."""
        return all((PEERS / name).is_dir() for name in self.peers)


def told(job: Job, *more: str) -> dict[str, Any]:
    """What the process says. Raises Failed when it ends with an error, Wrong when it says that something was wrong."""
    done = subprocess.run(
        [sys.executable, "-m", job.module, *job.arguments, *more],
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        cwd=ROOT,
        env=dict(surroundings(*job.peers)),
    )
    if done.returncode:
        error = done.stderr.strip() or str(done.returncode)
        kind = error.splitlines()[-1].split(":")[0].split(".")[-1]
        raise (Wrong if kind in WRONG else Failed)(f"{job.name}: {error}")
    said: dict[str, Any] = json.loads(done.stdout)
    return said


def rounds(
    jobs: Sequence[Job],
    times: int,
    say: Callable[[str], None],
    run: Callable[[Job], dict[str, Any]] = told,
    seed: int = 3,
) -> Mapping[str, list[dict[str, Any]]]:
    """What each said in each round, by name, in the order of the rounds; one spoiled process is run once more.

    Raises Failed when it fails twice, or ours was wrong.
    """
    shuffler = random.Random(seed)
    found: dict[str, list[dict[str, Any]]] = {job.name: [] for job in jobs}
    for number in range(times):
        for job in shuffler.sample(jobs, len(jobs)):
            say(f"round {number + 1} of {times}: {job.name}")
            try:
                found[job.name].append(run(job))
            except Failed as failure:
                if isinstance(failure, Wrong) and job.ours:
                    raise
                repeated[f"{job.module.removeprefix('bench.rows.')}: {job.name}"] += 1
                say(f"once more, because: {str(failure).splitlines()[-1]}\n")
                found[job.name].append(run(job))
    return found
