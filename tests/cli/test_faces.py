"""The faces of families are found by name, and offer what common commands can use."""

from __future__ import annotations

import pytest

from motorbus import families
from motorbus.cli import faces


def test_a_face_is_a_module_of_the_familys_name() -> None:
    assert faces.names() == ["feetech", "kst", "stepper"]


def test_what_a_face_offers() -> None:
    assert callable(faces.offer("feetech", "move_together"))
    assert callable(faces.offer("kst", "budget_frames"))
    assert faces.offer("feetech", "budget_frames") is None
    assert faces.offer("feetech", "make_coffee") is None
    assert faces.offer("nobody", "move_together") is None


def test_what_is_installed_is_not_looked_through_again_at_every_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert callable(faces.offer("kst", "budget_frames"))

    def again() -> list[str]:
        raise AssertionError("it was looked through again")

    monkeypatch.setattr(families, "names", again)
    assert callable(faces.offer("kst", "budget_frames"))
