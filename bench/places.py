"""Where things lie, and the surroundings in which a measured process runs."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
BUILD = ROOT / "build"
PEERS = ROOT / ".peers"


def surroundings(*peers: str) -> Mapping[str, str]:
    """Environment of a measured process: this tree, these peers and nothing that changes between machines.

    Compiled modules and locks are kept in the build folder: start-up is measured with the former, and the latter
    are nobody else's business.
    """
    kept = {name: os.environ[name] for name in ("PATH", "HOME", "LANG", "TMPDIR") if name in os.environ}
    folders = [ROOT, ROOT / "src", *(PEERS / name for name in peers)]
    return {
        **kept,
        "PYTHONPATH": os.pathsep.join(map(str, folders)),
        "PYTHONPYCACHEPREFIX": str(BUILD / "pycache"),
        "PYTHONHASHSEED": "0",
        "XDG_STATE_HOME": str(BUILD / "state"),
    }
