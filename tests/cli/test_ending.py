"""Work that ends when somebody says so: by Ctrl-C, which only asks the first time, or by Enter."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading

import pytest

from motorbus.cli.ending import END, asked_to_end


def test_ctrl_c_asks_once_and_then_interrupts() -> None:
    with asked_to_end() as ended:
        assert not ended()
        signal.raise_signal(signal.SIGINT)
        assert ended()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_afterwards_ctrl_c_is_what_it_was() -> None:
    before = signal.getsignal(signal.SIGINT)
    with asked_to_end():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before


def test_enter_asks_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = os.openpty()
    with os.fdopen(slave, encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        with asked_to_end() as ended:
            assert not ended()
            os.write(master, b"\n")
            assert ended()
            assert ended()
    os.close(master)


def test_what_is_piped_in_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n"))
    with asked_to_end() as ended:
        assert not ended()


def test_in_another_thread_there_is_no_handler_to_set() -> None:
    said: list[bool] = []

    def work() -> None:
        with asked_to_end() as ended:
            said.append(ended())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join(10)
    assert said == [False]


def test_being_told_to_end_can_ask_too_and_is_kept() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with asked_to_end(also=END) as ended:
        signal.raise_signal(signal.SIGTERM)
        assert ended()
        assert ended.told
        assert signal.getsignal(signal.SIGTERM) is before
    with asked_to_end() as ended:
        signal.raise_signal(signal.SIGINT)
        assert not ended.told
