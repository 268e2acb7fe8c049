"""Measured code in processes of its own, in shuffled rounds; each prints one line of JSON.

A process has no memory of what was measured before it, meets no other library's modules, and what it costs to start is
not measured. A ratio is taken within its round, so a machine that gets slower meanwhile hurts both sides alike.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from bench.places import PEERS, ROOT, surroundings
from bench.rounds import Failed

TIMEOUT = 120.0


class Job(NamedTuple):
    """What a process is to do: a name, a module of this tree, its arguments, and the folders of `.peers` it needs."""

    name: str
    module: str
    arguments: tuple[str, ...] = ()
    peers: tuple[str, ...] = ()

    @property
    def there(self) -> bool:
        """Whether its peers are installed."""
        return all((PEERS / name).is_dir() for name in self.peers)


def told(job: Job, *more: str) -> dict[str, Any]:
    """What the process says. Raises Failed when it ends with an error."""
    done = subprocess.run(
        [sys.executable, "-m", job.module, *job.arguments, *more],
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        cwd=ROOT,
        env=dict(surroundings(*job.peers)),
    )
    if done.returncode:
        raise Failed(f"{job.name}: {done.stderr.strip() or done.returncode}")
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

    Raises Failed when it fails twice.
    """
    shuffler = random.Random(seed)
    found: dict[str, list[dict[str, Any]]] = {job.name: [] for job in jobs}
    for number in range(times):
        for job in shuffler.sample(jobs, len(jobs)):
            say(f"round {number + 1} of {times}: {job.name}")
            try:
                found[job.name].append(run(job))
            except Failed as failure:
                say(f"once more, because: {str(failure).splitlines()[-1]}\n")
                found[job.name].append(run(job))
    return found
