"""The program `motorbus`: commands that parse words, call the library and show the result."""

import sys

from motorbus import __version__

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(argv: "Sequence[str] | None" = None) -> int:
    """Run one command line, without the name of the program; return its exit code.

    Without `argv` it is the command line of the process: later signals are ignored, output that cannot be written is
    dropped, and the exit code is that of the process.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    if words == ["--version"]:
        sys.stdout.write(f"motorbus {__version__}\n")
        return 0
    from motorbus.cli.program import run

    return run(words, last=argv is None)
