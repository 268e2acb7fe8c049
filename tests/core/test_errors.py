"""Every error carries what was sent, received and expected, the cause and the advice, also in a copy."""

from __future__ import annotations

import copy
import inspect
import pickle

import pytest

from motorbus import errors

CLASSES = [
    kind for _, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, errors.MotorbusError)
]


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_every_class_carries_the_parts_of_its_message(kind: type[errors.MotorbusError]) -> None:
    error = kind(
        "it failed", sent=b"\x01\x02", received=b"", expected="6 bytes", cause="a cable", advice="look"
    )
    assert str(error).splitlines() == [
        "it failed",
        "  sent: 01 02",
        "  expected: 6 bytes",
        "  likely cause: a cable",
        "  what to do: look",
    ]
    assert error.summary == "it failed"
    assert (error.sent, error.advice, error.node) == (b"\x01\x02", "look", None)


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [(errors.LinkError, OSError), (errors.NoReply, TimeoutError), (errors.RequestError, ValueError)],
)
def test_errors_that_python_knows_are_those_too(kind: type[Exception], builtin: type[Exception]) -> None:
    assert issubclass(kind, builtin)


def test_only_what_was_refused_before_anything_was_sent_says_by_itself_that_nothing_moved() -> None:
    said = {kind.__name__ for kind in CLASSES if kind.unmoved}
    assert said == {"RequestError", "Refused", "LimitExceeded"}


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_a_changed_summary_is_the_argument_of_every_copy(kind: type[errors.MotorbusError]) -> None:
    """A traceback, a copy and another process show what Python keeps of an error, which is its arguments."""
    error = kind("no answer", advice="ask again")
    error.summary = f"arm.toml: {error.summary}"
    for copied in (error, copy.copy(error), pickle.loads(pickle.dumps(error))):
        assert copied.args == ("arm.toml: no answer",)
        assert str(copied) == "arm.toml: no answer\n  what to do: ask again"
