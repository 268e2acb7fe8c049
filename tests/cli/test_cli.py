"""The program as a whole: what it loads, what it says when it is called wrongly, and that its examples are true."""

from __future__ import annotations

import json
import logging
import re
import shlex
import signal
import subprocess
import sys
from inspect import signature

import pytest

from motorbus import __version__
from motorbus.cli import build, main, parse
from tests.cli.conftest import Run

APP = build()
COMMANDS = [name for name in APP if not name.startswith("-")]
OF_ONE_FAMILY = ("feetech", "kst", "stepper")
FAMILY_COMMANDS = [
    (family, name) for family in OF_ONE_FAMILY for name in APP[family] if not name.startswith("-")
]
ALL = [*((name,) for name in COMMANDS), *FAMILY_COMMANDS]


def examples(words: tuple[str, ...]) -> list[str]:
    """The calls that the help shows; one that is too long for a line goes on in the next."""
    text = re.sub(r" \\\n\s+", " ", shown(words))
    return [line.strip() for line in text.splitlines() if line.strip().startswith("motorbus ")]


def shown(words: tuple[str, ...]) -> str:
    """The part of the help that has examples."""
    app = APP
    for word in words:
        app = app[word]
    return (app.help_epilogue or "").partition("Examples:")[2]


EXAMPLES = sorted({line for words in ALL for line in examples(words)})
SIMULATED = [line for line in EXAMPLES if re.search(r"(feetech|kst|stepper):sim", line) and " > " not in line]


def arguments(line: str) -> list[str]:
    """The words of an example, without the program's name and without what the shell takes."""
    return shlex.split(line.partition(" < ")[0].partition(" > ")[0])[1:]


RULE = "Only read; show the frames that it would send."
BOX = "\N{BOX DRAWINGS LIGHT VERTICAL}\N{BOX DRAWINGS LIGHT ARC DOWN AND RIGHT}\N{BOX DRAWINGS LIGHT ARC UP AND RIGHT}"


@pytest.mark.parametrize("words", [(), *ALL], ids=" ".join)
def test_help_of_a_command(words: tuple[str, ...], run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """It fits 80 columns, has the common flags and own examples, and says what --dry-run means."""
    monkeypatch.setenv("COLUMNS", "80")
    ran = run(*words, "--help")
    assert ran.code == 0
    lines = ran.out.splitlines()
    assert [line for line in lines if len(line.rstrip()) > 79 + line.startswith(tuple(BOX))] == []
    assert " ".join(("Usage: motorbus", *words)) in ran.out
    assert words[:1] != ("kst",) or len(lines) <= 25
    if not words or words in {(family,) for family in OF_ONE_FAMILY}:
        return
    assert "--json" in ran.out
    assert "--verbose" in ran.out
    assert examples(words)
    assert all(line.startswith(f"motorbus {' '.join(words)}") for line in examples(words))
    if "--dry-run" in ran.out:
        assert RULE in " ".join(ran.out.replace("│", " ").split())
        return
    refused = run(*words, "kst:sim#1", "--dry-run", "-vv")
    assert (refused.code, refused.out) == (2, "")
    assert f"`motorbus {' '.join(words)}` has no --dry-run" in refused.err
    assert " tx " not in refused.err


@pytest.mark.parametrize("line", EXAMPLES)
def test_an_example_can_be_said(line: str) -> None:
    words = [word for word in arguments(line) if word not in {"--json", "-v"}]
    command, _, _ = parse(APP, words)
    assert command.__module__.startswith(("motorbus.cli.", "motorbus.families."))


@pytest.mark.parametrize("line", SIMULATED[::3])
def test_an_example_with_simulated_devices_works(line: str, run: Run) -> None:
    ran = run(*arguments(line))
    assert (ran.code, ran.err) == (0, "")
    assert ran.out


def test_everything_that_needs_consent_or_moves_has_a_dry_run() -> None:
    def takes(words: tuple[str, ...], option: str) -> bool:
        app = APP
        for word in words:
            app = app[word]
        return app.default_command is not None and option in signature(app.default_command).parameters

    assert [words for words in ALL if takes(words, "yes") and not takes(words, "dry_run")] == []
    assert all(takes((name,), "dry_run") for name in ("write", "move", "torque", "stop"))


def test_version(run: Run) -> None:
    assert run("--version") == (0, f"motorbus {__version__}\n", "")


@pytest.mark.parametrize("words", [["--help"], ["--version"]])
def test_what_needs_no_bus_loads_no_family_and_no_heavy_library(words: list[str]) -> None:
    code = (
        "import sys; from motorbus.cli import main; main(sys.argv[1:]);"
        "print(*(name for name in sys.modules if name.startswith(('motorbus.families.', 'motorbus.session',"
        " 'serialx', 'can.', 'matplotlib', 'numpy', 'asyncio.'))), file=sys.stderr)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=60, check=True
    )
    assert ended.stderr.strip() == ""


def test_a_command_imports_no_other_family() -> None:
    code = (
        "import sys; from motorbus.cli import main; assert main(['ping', 'feetech:sim,ids=1#1']) == 0;"
        "print([name for name in sys.modules if 'families.kst' in name or 'families.stepper' in name])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert ended.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    "words",
    [["mvoe"], ["scan"], ["scan", "--ids"], ["torque", "sideways", "feetech:sim"], ["ports", "--sideways"]],
    ids=" ".join,
)
def test_a_call_that_cannot_be_understood_ends_with_2(words: list[str], run: Run) -> None:
    ran = run(*words)
    assert ran.code == 2
    assert ran.out == ""
    assert ran.err.startswith("error: ")
    assert "--help" in ran.err


def test_a_mistyped_command_gets_a_suggestion(run: Run) -> None:
    assert 'Did you mean "monitor"' in run("monitr").err


def test_a_wrong_call_is_told_in_json_too(run: Run) -> None:
    ran = run("scan", "--json")
    assert (ran.code, ran.out) == (2, "")
    assert json.loads(ran.err)["exit"] == 2


@pytest.mark.parametrize(
    "words",
    [
        ["--json", "ports"],
        ["ports", "--json"],
        ["ping", "--json", "feetech:sim#1"],
        ["ping", "feetech:sim#1", "--json", "--baud", "1000000"],
        ["ping", "-v", "feetech:sim#1", "--json"],
    ],
)
def test_common_flags_may_stand_anywhere(words: list[str], run: Run) -> None:
    assert run(*words).document["schema"] in {"motorbus.ports/1", "motorbus.ping/1"}


def test_no_words_at_all_show_the_help(run: Run) -> None:
    ran = run()
    assert ran.code == 0
    assert "Usage: motorbus" in ran.out


def test_a_defect_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> list[object]:
        raise ZeroDivisionError

    monkeypatch.setattr("motorbus.link.serial.ports", broken)
    with pytest.raises(ZeroDivisionError):
        main(["ports"])


def test_verbose_says_what_happens_on_stderr_and_only_then(run: Run) -> None:
    quiet = run("ping", "feetech:sim,ids=1#1")
    chatty = run("ping", "feetech:sim,ids=1#1", "-vv")
    assert quiet.err == ""
    assert "tx FF FF 01 02 01 FB" in chatty.err
    assert "#1: sent" in chatty.err
    assert "tx" not in run("ping", "feetech:sim,ids=1#1", "-v").err
    assert logging.getLogger("motorbus").level == logging.NOTSET


def test_a_reader_that_goes_away_ends_it_quietly() -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "motorbus", "monitor", "feetech:sim#1", "--rate", "1000", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.readline()
    process.stdout.close()
    with process:
        assert process.stderr.read() == ""
        assert process.wait(timeout=30) == 10


@pytest.mark.parametrize("closed", [">&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize(("words", "code"), [("ping feetech:sim,ids=1#1", 0), ("nonsense", 2)])
def test_a_stream_that_is_closed_is_no_trouble(closed: str, words: str, code: int) -> None:
    line = f'exec "$0" -m motorbus {words} {closed}'
    ended = subprocess.run(
        ["/bin/sh", "-c", line, sys.executable], capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == code, ended.stderr
    assert "Traceback" not in ended.stderr


def _as_in_a_terminal() -> None:
    """Whoever runs these tests in the background may ignore these signals, which a child would inherit."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_being_told_to_end_cleans_up(number: signal.Signals) -> None:
    code = "import sys; from motorbus.cli import main; print(main(sys.argv[1:]), file=sys.stderr)"
    words = ["monitor", "feetech:sim#1", "--rate", "50", "--json"]
    with subprocess.Popen(
        [sys.executable, "-c", code, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=_as_in_a_terminal,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        process.send_signal(number)
        _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (0, "0\n")
