"""Every error has an exit code, and the documentation says the same as the code."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from motorbus import errors
from motorbus.cli import exits
from motorbus.cli.exits import Exit

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "exit-codes.md"


def kinds(base: type[BaseException]) -> Iterator[type[BaseException]]:
    yield base
    for kind in base.__subclasses__():
        yield from kinds(kind)


# What a family adds is a kind of one of these, and has its code.
OURS = sorted(
    (
        kind
        for kind in set(kinds(errors.MotorbusError))
        if re.match(r"motorbus\.(?!families\.)", kind.__module__)
    ),
    key=lambda kind: kind.__name__,
)


@pytest.mark.parametrize("kind", OURS)
def test_no_error_class_is_unmapped(kind: type[BaseException]) -> None:
    assert kind in exits.CODES, "add it to CODES and to docs/reference/exit-codes.md"


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (errors.PortNotFound("x"), 3),
        (errors.PortBusy("x"), 4),
        (errors.NoReply("x"), 5),
        (exits.Partial("x"), 6),
        (errors.DeviceError("x"), 7),
        (errors.LimitExceeded("x"), 8),
        (exits.NeedsConsent("x"), 8),
        (errors.VerificationFailed("x"), 9),
        (errors.Interrupted("x"), 10),
        (KeyboardInterrupt(), 10),
        (errors.RequestError("x"), 2),
        (errors.MotorbusError("x"), 1),
        (PermissionError("x"), 1),
    ],
)
def test_an_error_ends_with_its_code(error: BaseException, code: int) -> None:
    assert exits.exit_code(error) == code


def test_a_later_subclass_ends_as_its_base_does() -> None:
    class Later(errors.NoReply):
        pass

    try:
        assert exits.exit_code(Later("x")) is Exit.NO_REPLY
    finally:
        del Later


def test_a_defect_has_no_code_and_keeps_its_traceback() -> None:
    assert exits.exit_code(ZeroDivisionError()) is None


def test_every_code_has_a_meaning() -> None:
    assert list(exits.MEANINGS) == list(Exit)
    assert [code.value for code in Exit] == list(range(11))


def test_the_documented_table_is_the_table_of_the_code() -> None:
    assert exits.table() in PAGE.read_text(encoding="utf-8")
