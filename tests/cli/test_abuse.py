"""Commands on a server that is no bus: it closes at once, sends junk for ever, or never answers."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

JUNK = bytes(range(256)) * 4


@contextlib.contextmanager
def server(kind: str) -> Iterator[str]:
    """HOST:PORT of a server of this kind."""
    with socket.create_server(("127.0.0.1", 0)) as listener, contextlib.ExitStack() as held:

        def chatter(connection: socket.socket) -> None:
            with contextlib.suppress(OSError):
                while kind == "junk":
                    connection.sendall(JUNK)
                    time.sleep(0.002)

        def accept() -> None:
            with contextlib.suppress(OSError):
                while True:
                    connection = listener.accept()[0]
                    if kind == "close":
                        connection.close()
                        continue
                    held.enter_context(connection)
                    threading.Thread(target=chatter, args=(connection,), daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()
        yield f"127.0.0.1:{listener.getsockname()[1]}"


@pytest.mark.parametrize(
    ("kind", "words", "codes"),
    [
        ("close", "scan feetech:socket://AT", (3,)),
        ("close", "scan feetech:socket://AT --baud all", (3,)),
        ("close", "monitor feetech:socket://AT#1 --count 2", (3, 5)),
        ("close", "read stepper:socket://AT#1", (3,)),
        ("close", "scan kst:can://slcan/socket://AT", (3,)),
        ("junk", "scan feetech:socket://AT", (1,)),
        ("junk", "ping feetech:socket://AT#1", (1, 5)),
        ("junk", "read stepper:socket://AT#1", (1,)),
        ("junk", "scan kst:can://slcan/socket://AT", (1,)),
        ("mute", "ping feetech:socket://AT#1", (5,)),
        ("mute", "scan kst:can://slcan/socket://AT --ids 1-3", (5,)),
    ],
)
def test_a_server_that_is_no_bus_costs_one_error(kind: str, words: str, codes: tuple[int, ...]) -> None:
    with server(kind) as at:
        command = [sys.executable, "-m", "motorbus", *words.replace("AT", at).split()]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode in codes, ran.stderr
    assert "Traceback" not in ran.stderr
    assert "RuntimeWarning" not in ran.stderr
    assert ran.stderr.count("error: ") == 1
