"""What is loaded when: importing motorbus costs nothing, help costs a parser, a port costs its library.

Each check is a process of its own, because what this one has loaded is the tests' doing.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest

import motorbus

pytestmark = pytest.mark.quick

LOADED = "import sys; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
HARDWARE_AND_NUMBERS = {"serialx", "serial", "can", "canopen", "wrapt", "matplotlib", "numpy", "starlette"}
FILES = {"msgspec", "tomlkit"}
POSIX_ONLY = "import sys; sys.modules.update(dict.fromkeys(['termios', 'fcntl', 'pty', 'tty'])); "
OPEN_A_SOCKET = """
from motorbus.link.url import open_link
link = open_link(sys.argv[1], rate=1_000_000)
link.write(b"\\xff\\xff\\x01\\x02\\x01\\xfb")
print(b"".join(link.read(link.now() + 30)).hex())
link.close()
"""


def run(code: str, *arguments: str) -> str:
    """Standard output of a fresh Python that treats warnings as errors."""
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_importing_motorbus_loads_no_library() -> None:
    loaded = set(run(f"import motorbus; {LOADED}").split())
    assert "motorbus" in loaded
    assert loaded & (HARDWARE_AND_NUMBERS | FILES | {"cyclopts", "rich", "asyncio"}) == set()


def test_help_loads_neither_hardware_nor_numbers() -> None:
    code = f"from motorbus.cli import main; main(['--help']); {LOADED}"
    printed = run(code)
    assert "Usage: motorbus" in printed
    assert set(printed.splitlines()[-1].split()) & (HARDWARE_AND_NUMBERS | {"tomlkit"}) == set()


def test_reading_a_machine_loads_no_editor_of_files() -> None:
    code = f"from motorbus.motion.machine import MachineConfig; MachineConfig.parse('format = 1'); {LOADED}"
    loaded = set(run(code).split())
    assert loaded & (HARDWARE_AND_NUMBERS | FILES) == {"msgspec"}


def test_what_is_promised_is_there() -> None:
    missing = [name for name in motorbus.__all__ if not hasattr(motorbus, name)]
    assert missing == []


def test_a_name_that_does_not_exist_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'no_such_family'"):
        _ = motorbus.no_such_family


def test_the_version_is_the_one_that_is_installed() -> None:
    assert f'version = "{motorbus.__version__}"' in Path("pyproject.toml").read_text(encoding="utf-8")


def test_logging_is_silent_until_asked_for() -> None:
    code = "import logging, motorbus.session; logging.getLogger('motorbus').error('nobody asked')"
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, capture_output=True, text=True, timeout=60).stderr == ""


@pytest.mark.parametrize("module", ["motorbus", "motorbus.session", "motorbus.cli", "motorbus.link.url"])
def test_it_imports_where_posix_is_absent(module: str) -> None:
    assert run(f"{POSIX_ONLY}import {module}; print('imported')") == "imported\n"


def test_a_socket_opens_where_posix_is_absent() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        command = [
            sys.executable,
            "-c",
            POSIX_ONLY + OPEN_A_SOCKET,
            f"socket://127.0.0.1:{server.getsockname()[1]}",
        ]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            server.settimeout(30)
            connection, _ = server.accept()
            with connection:
                assert connection.recv(64) == bytes.fromhex("ff ff 01 02 01 fb")
                connection.sendall(bytes.fromhex("ff ff 01 02 00 fc"))
                printed, complaint = process.communicate(timeout=30)
    assert (printed.strip(), complaint) == ("ffff010200fc", "")
