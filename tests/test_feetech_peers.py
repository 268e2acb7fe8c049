"""The page about other people's FEETECH libraries is the one that their sessions would make today."""

from __future__ import annotations

import re

import pytest

from scripts import feetech_peers
from tests.interop.feetech.notes import NOTES
from tests.interop.feetech.session import sessions

IN_ITS_OWN_TEST = {"error-above-0x7f"}
OF_UNITS = {"zero-is-middle", "turn-of-4095", "ten-bits", "whole-percent"}


def test_the_page_is_current(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["feetech_peers", "--check"])
    assert feetech_peers.main() == 0, "python -m scripts.feetech_peers makes it"


def test_what_is_not_current_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feetech_peers, "page", lambda: "")
    monkeypatch.setattr("sys.argv", ["feetech_peers", "--check"])
    assert feetech_peers.main() == 1


def test_every_difference_is_explained_and_every_explanation_is_needed() -> None:
    given = {
        name
        for session in sessions()
        for step in [*session.steps(feetech_peers.PORT), *session.generated()]
        for name in step.why.split()
    }
    assert given | IN_ITS_OWN_TEST | OF_UNITS == set(NOTES)


def test_what_is_linked_is_on_the_page() -> None:
    text = feetech_peers.page()
    linked = set(re.findall(r"\]\(#([^)]+)\)", text)) - {"differences"}
    assert linked - set(re.findall(r'<a id="([^"]+)"></a>', text)) == set()


def test_a_cell_never_breaks_a_table() -> None:
    tables = re.findall(r"(?:^\|.*\n)+", feetech_peers.page(), re.M)
    widths = [
        {line.count(" | ") for line in table.splitlines() if not line.startswith("|---")} for table in tables
    ]
    assert tables
    assert all(len(one) == 1 for one in widths)
