"""Fetch the libraries of the page into src/motorbus/web/static/vendor, by npm; each package has a pinned checksum.

`import … from "preact"` of a library becomes the name of the file beside it, so the page needs no build step and no
import map.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

VENDOR = Path(__file__).parents[1] / "src/motorbus/web/static/vendor"
PACKAGES = {
    "preact@11.2.0": (
        "3c4456766bd32b6b534d52bf4e9c2a29b33e7eedf6e96ed479300ba1a7888ebf",
        {"dist/preact.mjs": "preact.mjs", "hooks/dist/hooks.mjs": "hooks.mjs", "LICENSE": "preact.LICENSE"},
    ),
    "htm@3.1.1": (
        "2425b9bee11409177bcabc7f32e319926fc6690c1701c0b257c88bdff2d5ba90",
        {"dist/htm.module.js": "htm.mjs", "LICENSE": "htm.LICENSE"},
    ),
    "uplot@1.6.32": (
        "4b8a8191e425658e3ea8c8c1314b0fc679c861ee3a1af2b20c7b16ba50b5133d",
        {
            "dist/uPlot.iife.min.js": "uPlot.mjs",
            "dist/uPlot.min.css": "uPlot.css",
            "LICENSE": "uPlot.LICENSE",
        },
    ),
}


def main() -> int:
    """Fetch, check and unpack each package."""
    npm = shutil.which("npm")
    if npm is None:
        print("npm is missing; on Debian and Ubuntu: apt-get install npm", file=sys.stderr)
        return 1
    VENDOR.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for package, (checksum, files) in PACKAGES.items():
            command = [npm, "pack", package, "--silent", "--pack-destination", folder]
            name = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()[-1]
            archive = Path(folder) / name
            found = hashlib.sha256(archive.read_bytes()).hexdigest()
            if found != checksum:
                print(f"{package}: sha256 {found}, expected {checksum}", file=sys.stderr)
                return 1
            with tarfile.open(archive) as contents:
                for source, target in files.items():
                    stream = contents.extractfile(f"package/{source}")
                    assert stream is not None
                    (VENDOR / target).write_text(_as_module(target, stream.read().decode()))
    return 0


def _as_module(name: str, text: str) -> str:
    """A library as a module that imports its neighbours by file name."""
    text = "\n".join(line for line in text.split("\n") if not line.startswith("//# sourceMappingURL="))
    if name == "uPlot.mjs":
        return f"{text}\nexport default uPlot;\n"
    return text.replace('from"preact"', 'from"./preact.mjs"')


if __name__ == "__main__":
    sys.exit(main())
