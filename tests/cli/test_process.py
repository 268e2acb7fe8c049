"""The program as a process: signals, closed streams, a terminal, a full disk, an emergency stop of another process."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.processes import Simulator, simulator

LIMIT = 60.0  # s


def start(*words: str, **streams: object) -> subprocess.Popen[str]:
    given: dict[str, object] = {
        "stdin": subprocess.DEVNULL,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
    }
    return subprocess.Popen([sys.executable, "-m", "motorbus", *words], text=True, **{**given, **streams})  # type: ignore[call-overload, no-any-return]


def run(*words: str, **streams: object) -> tuple[int, str, str]:
    with start(*words, **streams) as process:
        out, err = process.communicate(timeout=LIMIT)
    return process.returncode, out, err


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulator]:
    """Three simulated servos on a pseudo-terminal."""
    folder = tmp_path_factory.mktemp("served")
    old = os.environ.get("XDG_STATE_HOME")
    os.environ["XDG_STATE_HOME"] = str(folder / "state")
    with simulator(folder / "arm", "feetech", "--ids", "1-3") as simulated:
        yield simulated
    if old is None:
        del os.environ["XDG_STATE_HOME"]
    else:
        os.environ["XDG_STATE_HOME"] = old


def test_scan_finds_three(served: Simulator) -> None:
    code, out, err = run("scan", served.address, "--ids", "1-6", "--json")
    assert code == 0, err
    assert out.count("STS3215") == 3
    assert json.loads(out)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_a_jog(served: Simulator, number: signal.Signals) -> None:
    with start("jog", f"{served.address}#1", "20deg/s", "--for", "30s", "--yes") as process:
        until_moving(served)
        process.send_signal(number)
        _, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 10, err
    assert err.count("error: ") == 1
    assert not moving(served)


def moving(served: Simulator) -> bool:
    return '"moving": true' in served.command("status")


def until_running(controller: Simulator) -> None:
    end = time.monotonic() + LIMIT
    while '"project": 2' not in controller.command("status"):
        assert time.monotonic() < end, controller.command("status")


def until_moving(served: Simulator) -> None:
    end = time.monotonic() + LIMIT
    while time.monotonic() < end:
        if moving(served):
            return
    raise AssertionError("the servo does not move")


def test_estop_stops_a_process_that_holds_the_port(served: Simulator) -> None:
    with start("jog", f"{served.address}#1", "20deg/s", "--for", "30s", "--yes") as process:
        until_moving(served)
        code, out, err = run("estop", served.address)
        _, stopped = process.communicate(timeout=LIMIT)
    assert code == 0, err
    assert out
    assert process.returncode not in (0, 1), stopped
    assert "emergency stop" in stopped


def test_estop_ends_the_run_of_a_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with simulator(tmp_path / "step", "stepper") as controller:
        code, _, err = run("stepper", "write", "examples/pick_and_place.toml", controller.address, "--yes")
        assert code == 0, err
        with start("stepper", "run", controller.address, "2", "--yes") as process:
            until_running(controller)
            code, _, refused = run("stop", controller.address)
            assert (code, "motorbus estop" in refused) == (4, True)
            code, _, err = run("estop", controller.address)
            _, stopped = process.communicate(timeout=LIMIT)
        assert (code, process.returncode) == (0, 10), err + stopped
        code, _, err = run("stepper", "write", "examples/pick_and_place.toml", controller.address, "--yes")
        assert code == 0, err  # the journal has no unfinished run


def test_a_second_command_names_the_owner(served: Simulator) -> None:
    with start("monitor", f"{served.address}#1-3", "--json") as owner:
        assert owner.stdout is not None
        assert json.loads(owner.stdout.readline())
        code, _, err = run("read", f"{served.address}#1")
        owner.send_signal(signal.SIGINT)
        owner.communicate(timeout=LIMIT)
    assert code == 4
    assert str(owner.pid) in err
    assert owner.returncode == 0  # Ctrl-C is its usual end


def test_a_full_disk_is_one_line(served: Simulator) -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        code, _, err = run("read", f"{served.address}#1", stdout=full)
    assert code == 1
    assert len(err.splitlines()) == 1


def test_closed_streams(served: Simulator) -> None:
    command = f"{sys.executable} -m motorbus read '{served.address}#1' >&- 2>&- <&-"
    assert subprocess.run(["sh", "-c", command], timeout=LIMIT, check=False).returncode in (0, 1)


def test_a_pipe_that_closes(served: Simulator) -> None:
    command = f"{sys.executable} -m motorbus monitor '{served.address}#1-3' --json | head -1"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert json.loads(done.stdout)
    assert done.stderr == ""


def test_a_terminal_is_asked_and_may_refuse(served: Simulator) -> None:
    main_end, port_end = pty.openpty()
    words = ("write", f"{served.address}#1", "max_temperature=66°C")
    with start(*words, stdin=port_end, stdout=port_end, stderr=port_end) as process:
        os.close(port_end)
        shown = read_until(main_end, "?")
        os.write(main_end, b"n\n")
        shown += read_until(main_end, "--yes")
        process.wait(timeout=LIMIT)
    os.close(main_end)
    assert process.returncode == 8, shown
    code, out, _ = run("read", f"{served.address}#1", "max_temperature", "--raw", "--json")
    assert code == 0
    assert "66" not in out


def read_until(terminal: int, text: str) -> str:
    """What a terminal shows, up to this text or its end."""
    shown = b""
    while text.encode() not in shown and select.select([terminal], [], [], LIMIT)[0]:
        try:
            shown += os.read(terminal, 4096)
        except OSError:  # the other end is closed
            break
    return shown.decode()


def test_jog_ends_with_enter(served: Simulator) -> None:
    main_end, port_end = pty.openpty()
    words = ("jog", f"{served.address}#2", "10deg/s", "--yes")
    with start(*words, stdin=port_end, stdout=port_end, stderr=port_end) as process:
        os.close(port_end)
        until_moving(served)
        os.write(main_end, b"\n")
        read_until(main_end, "\0")
        process.wait(timeout=LIMIT)
    os.close(main_end)
    assert process.returncode == 0
    assert not moving(served)


def test_version_imports_no_part_of_motorbus(tmp_path: Path) -> None:
    code = (
        "import sys; from motorbus.cli import main; main(['--version']); "
        "print(*sorted(n for n in sys.modules if n.startswith('motorbus')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True
    )
    version, modules = done.stdout.splitlines()
    assert version.startswith("motorbus ")
    assert set(modules.split()) <= {"motorbus", "motorbus.errors", "motorbus.cli", "motorbus.cli.program"}


def test_read_imports_a_part_of_motorbus(served: Simulator) -> None:
    words = ["read", f"{served.address}#1", "present_position"]
    count = "print(sum(name.startswith('motorbus') for name in sys.modules))"
    code = f"import sys; from motorbus.cli import main; main({words!r}); {count}"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True
    )
    assert int(done.stdout.splitlines()[-1]) <= 120
