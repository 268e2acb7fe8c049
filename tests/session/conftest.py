"""Runs the tests of addresses, buses and journals against both sessions until the switch."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from types import ModuleType

import pytest

import motorbus

BOTH = ("test_address", "test_journal", "test_session")
MOVED = {
    "motorbus.journal": "motorbus.journal_new",
    "motorbus.session": "motorbus.session_new",
    "motorbus.session.address": "motorbus.session_new.address",
    "motorbus.session.keeping": "motorbus.session_new.journals",
}


@pytest.fixture(autouse=True)
def session_under_test(request: pytest.FixtureRequest) -> Iterator[None]:
    """With the parameter "new", let the names of the module under test be those of the new session."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        if getattr(request, "param", "old") == "new":
            _exchange(request, monkeypatch)
        yield


def _exchange(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in vars(request.module).copy().items():
        if isinstance(value, ModuleType):
            if value.__name__ in MOVED:
                monkeypatch.setattr(request.module, name, import_module(MOVED[value.__name__]))
        elif getattr(value, "__module__", "") in MOVED:
            monkeypatch.setattr(request.module, name, getattr(import_module(MOVED[value.__module__]), name))
    for name in ("open", "open_async", "simulate"):
        monkeypatch.setitem(motorbus._LAZY, name, "motorbus.session_new")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if metafunc.module.__name__.rpartition(".")[2] in BOTH:
        metafunc.parametrize("session_under_test", ["old", "new"], indirect=True)
