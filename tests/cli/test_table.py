"""Every command of the shell under the same conditions: one row for a command, one test for a condition."""

from __future__ import annotations

import json
import os
import pty
import re
import shlex
import signal
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

import motorbus
from motorbus.link.memory import MemoryLink
from tests.cli.rows import KST, NAMES, ROWS, Row
from tests.cli.shell import Shell, check_error, check_json_error, shell

__all__ = ["shell"]

MISSING = "feetech:/dev/motorbus-no-such-port"
PORTS = [row for row in ROWS if row.port]
SENDING = [row for row in PORTS if row.name != "recover"]  # without an unfinished change it sends nothing
OTHERS = {"setup", "web"}  # with tests of their own
CONSENT = [row for row in (*ROWS, *KST) if row.consent]


def named(row: Row) -> str:
    return row.name


class Buses:
    """Simulated buses for the words of a row."""

    def __init__(self, stack: ExitStack, faults: str = "") -> None:
        self._feetech = stack.enter_context(motorbus.simulate("feetech", ids="1-3", faults=faults))
        kst = {"ids": "0x25", "profile": "kst-ext"}
        self._kst = stack.enter_context(motorbus.simulate("kst", faults=faults, **kst))
        self._stepper = stack.enter_context(motorbus.simulate("stepper", home_switch="wired", faults=faults))

    def fill(self, words: str) -> str:
        """The words with the addresses of these buses."""
        return words.format(bus=self._feetech.url, stepper=self._stepper.url, kst=self._kst.url)


@pytest.fixture
def buses() -> Iterator[Buses]:
    with ExitStack() as stack:
        yield Buses(stack)


def prepare(row: Row, shell: Shell, buses: Buses) -> None:
    """Give `restore` a file that differs from the device."""
    if row.name == "restore":
        assert shell(buses.fill("backup {bus}#1 saved.json")).code == 0
        assert shell(buses.fill("write {bus}#1 max_temperature=55°C --yes")).code == 0


def test_every_command_is_in_the_table() -> None:
    from motorbus.cli.program import build

    app = build()
    found = set()
    for name in app:
        if name.startswith("-") or name in OTHERS:
            continue
        children = [child for child in app[name] if not child.startswith("-")]
        found |= {f"{name} {child}" for child in children} or {name}
    assert found == set(NAMES)


# -- words ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", ROWS, ids=named)
def test_help_is_short_and_has_examples(row: Row, shell: Shell) -> None:
    ran = shell(f"{row.name} --help")
    lines = ran.out.splitlines()
    assert (ran.code, ran.err) == (0, "")
    assert len(lines) <= 25, len(lines)
    examples = [line for line in lines if re.match(rf"\s+\$? ?motorbus {row.name}\b", line)]
    assert len(examples) >= 3


@pytest.mark.parametrize("row", [row for row in ROWS if row.name != "demo"], ids=named)
def test_without_arguments(row: Row, shell: Shell) -> None:
    ran = shell(row.name)
    assert ran.code == row.bare, ran.err
    if row.bare:
        check_error(ran)


@pytest.mark.parametrize("row", ROWS, ids=named)
def test_an_unknown_option_is_refused(row: Row, shell: Shell, buses: Buses) -> None:
    ran = shell(buses.fill(f"{row.name} {row.good} --no-such-option"))
    assert ran.code == 2
    check_error(ran)
    assert shell.frames == []


@pytest.mark.parametrize("row", ROWS, ids=named)
def test_a_bad_value_is_refused(row: Row, shell: Shell, buses: Buses) -> None:
    ran = shell(buses.fill(f"{row.name} {row.bad}"))
    assert (ran.code, ran.out) == (row.bad_code, "")
    check_error(ran)
    assert shell.writes() == []


@pytest.mark.parametrize("row", ROWS, ids=named)
def test_a_json_error_is_one_object(row: Row, shell: Shell, buses: Buses) -> None:
    ran = shell(buses.fill(f"{row.name} {row.bad} --json"))
    assert ran.code == row.bad_code
    check_json_error(ran)


# -- devices -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", [row for row in ROWS if row.name not in ("simulate", "demo")], ids=named)
def test_it_succeeds_with_json(row: Row, shell: Shell, buses: Buses) -> None:
    prepare(row, shell, buses)
    ran = shell(buses.fill(f"{row.name} {row.good} --json") + " --yes" * row.consent)
    assert ran.code == 0, ran.err
    for line in ran.out.splitlines() if row.name == "monitor" else [ran.out]:
        assert json.loads(line) is not None


@pytest.mark.parametrize("row", CONSENT, ids=named)
def test_without_consent_nothing_is_written(row: Row, shell: Shell, buses: Buses) -> None:
    prepare(row, shell, buses)
    ran = shell(buses.fill(f"{row.name} {row.good}"))
    assert ran.code == 8, ran.err
    check_error(ran)
    assert "--yes" in ran.err
    assert shell.writes() == []


@pytest.mark.parametrize("row", CONSENT, ids=named)
def test_a_dry_run_writes_nothing(row: Row, shell: Shell, buses: Buses) -> None:
    prepare(row, shell, buses)
    ran = shell(buses.fill(f"{row.name} {row.good} --dry-run"))
    assert (ran.code, shell.writes()) == (0, []), ran.err
    assert ran.out


@pytest.mark.parametrize("row", PORTS, ids=named)
def test_a_missing_port_is_3(row: Row, shell: Shell, buses: Buses) -> None:
    prepare(row, shell, buses)
    missing = {"bus": MISSING, "stepper": MISSING.replace("feetech", "stepper")}
    ran = shell(f"{row.name} {row.good.format(**missing)}")
    assert ran.code == 3, ran.err
    check_error(ran)


@pytest.mark.parametrize("row", [row for row in PORTS if row.name != "estop"], ids=named)
def test_a_busy_port_is_4(row: Row, shell: Shell, buses: Buses) -> None:
    prepare(row, shell, buses)
    main_end, port_end = pty.openpty()
    port = os.ttyname(port_end)
    try:
        with motorbus.open(f"feetech:{port}"):
            ran = shell(f"{row.name} {row.good.format(bus=f'feetech:{port}', stepper=f'stepper:{port}')}")
    finally:
        os.close(main_end)
        os.close(port_end)
    assert ran.code == 4, ran.err
    check_error(ran)
    assert str(os.getpid()) in ran.err


@pytest.mark.parametrize("row", SENDING, ids=named)
def test_a_lost_bus_ends_the_command(row: Row, shell: Shell, buses: Buses) -> None:
    prepare(row, shell, buses)
    with ExitStack() as stack:
        lost = Buses(stack, faults="exchange 2: unplug 1000")
        ran = shell(lost.fill(f"{row.name} {row.good}") + " --yes" * row.consent)
    assert ran.code in (3, 5, 6), ran.err
    check_error(ran)


# -- process -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", SENDING, ids=named)
def test_ctrl_c_is_10(row: Row, shell: Shell, buses: Buses, monkeypatch: pytest.MonkeyPatch) -> None:
    prepare(row, shell, buses)
    write = MemoryLink.write
    count = 0

    def interrupt(link: MemoryLink, data: bytes) -> None:
        nonlocal count
        count += 1
        if count == 2:
            signal.raise_signal(signal.SIGINT)
        write(link, data)

    monkeypatch.setattr(MemoryLink, "write", interrupt)
    ran = shell(buses.fill(f"{row.name} {row.good}") + " --yes" * row.consent)
    assert ran.code == 10, ran.err
    check_error(ran)


@pytest.mark.parametrize("row", [row for row in PORTS if row.name not in ("init", "backup")], ids=named)
def test_a_closed_stdout_is_10(row: Row, shell: Shell, buses: Buses, monkeypatch: pytest.MonkeyPatch) -> None:
    prepare(row, shell, buses)
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as closed:
        monkeypatch.setattr("sys.stdout", closed)
        ran = shell(buses.fill(f"{row.name} {row.good}") + " --yes" * row.consent)
        monkeypatch.undo()
    assert ran.code == 10, ran.err
    assert "error" not in ran.err


def test_the_lines_of_the_table_parse() -> None:
    assert all(shlex.split(row.good) for row in ROWS)
