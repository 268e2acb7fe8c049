"""Which tests run: all but the long ones, the long ones (`--soak`), or a quick few (`--quick`).

A test that counts asks the fixture `rounds` how often: 3,000 times in `make test`, its full count in `make soak`, a
hundred times on other interpreters.
"""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import pytest
from hypothesis import settings

from motorbus.link import usb_adapters

HERE = Path(__file__).parent
USUAL_ROUNDS = 3_000
QUICK_ROUNDS = 100
LONG_RUN = 3_600
"""s; limit of a long run."""
QUICK_FOLDERS = ("core", "bus", "golden")

settings.register_profile("test", deadline=None, derandomize=True, max_examples=50, print_blob=True)
settings.register_profile("quick", settings.get_profile("test"), max_examples=10)
settings.register_profile("soak", deadline=None, max_examples=5_000, print_blob=True)


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("motorbus")
    group.addoption("--soak", action="store_true", help="only the long runs, with their full counts")
    group.addoption("--quick", action="store_true", help="only a small subset, with small counts")


def _profile(config: pytest.Config) -> str:
    if config.getoption("--soak") or config.getoption("-m") == "soak":
        return "soak"
    return "quick" if config.getoption("--quick") else "test"


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    if _profile(config) == "soak" and config.option.timeout is None:
        config.option.timeout = LONG_RUN
    settings.load_profile(_profile(config))
    # A shell lets what runs in the background ignore SIGINT, and nohup SIGHUP. Children inherit that, unless it is
    # a handler of Python's that does nothing.
    for number in (signal.SIGINT, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, lambda *_: None)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    wanted = {"soak": _is_soak, "quick": _is_quick, "test": _is_usual}[_profile(config)]
    for item in items:
        if "rounds" in getattr(item, "fixturenames", ()) and _profile(config) == "soak":
            item.add_marker("soak")
    config.hook.pytest_deselected(items=[item for item in items if not wanted(item)])
    items[:] = [item for item in items if wanted(item)]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """`-n auto`: two for each core; tests of real ports and processes mostly wait."""
    return 2 * (os.cpu_count() or 1)


def pytest_collection_finish(session: pytest.Session) -> None:
    """The tests stay until the end; the collector need not visit them."""
    gc.collect()
    gc.freeze()


def _is_soak(item: pytest.Item) -> bool:
    return item.get_closest_marker("soak") is not None


def _is_usual(item: pytest.Item) -> bool:
    return not _is_soak(item)


def _is_quick(item: pytest.Item) -> bool:
    inside = item.path.is_relative_to(HERE) and item.path.relative_to(HERE).parts[0] in QUICK_FOLDERS
    return _is_usual(item) and (inside or item.get_closest_marker("quick") is not None)


@pytest.fixture(scope="session", autouse=True)
def user_folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Redirect state, configuration and cache of this process and its children away from the user's own.

    Without this, `motorbus estop` in a test would stop real buses of the user who runs the tests.
    """
    root = tmp_path_factory.mktemp("xdg")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("STATE", "CONFIG", "CACHE"):
            patch.setenv(f"XDG_{name}_HOME", str(root / name.lower()))
        yield root


class Rounds(Protocol):
    """How often to repeat: the full count in the long runs, else at most as often as is usual."""

    def __call__(self, full: int, usual: int = USUAL_ROUNDS) -> int: ...


@pytest.fixture(scope="session")
def rounds(pytestconfig: pytest.Config) -> Rounds:
    """`rounds(100_000)`: how often to repeat here; the full count only in `make soak`, 3 000 at most in `make test`.

    What takes long may say that fewer are usual: `rounds(100_000, 2_500)`.
    """
    few = _profile(pytestconfig) == "quick"

    def count(full: int, usual: int = USUAL_ROUNDS) -> int:
        most = full if _profile(pytestconfig) == "soak" else usual
        return min(full, most, QUICK_ROUNDS if few else most)

    return count


class Figures(Protocol):
    """Prints the figures of a run: what it was, then numbers and short words by name."""

    def __call__(self, what: str, *, family: str = "", **figures: int | float | str) -> None: ...


@pytest.fixture
def unhurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give a simulator in another process 1 s for its reply; it may wait for a processor."""
    monkeypatch.setattr(usb_adapters, "TERMINAL_LATENCY", 1.0)


@pytest.fixture
def figures() -> Figures:
    """`figures("L7 late replies", family="kst", reads=n, wrong=count)`: print the counts of a long run."""

    def show(what: str, *, family: str = "", **figures: int | float | str) -> None:
        shown = ", ".join(f"{name} {value}" for name, value in figures.items())
        print(f"\n{what}{f' ({family})' if family else ''}: {shown}")

    return show
