"""Results on stdout, everything else on stderr, and nothing that a program cannot read with --json."""

from __future__ import annotations

import io
import json
import re
import sys

import pytest

from motorbus import errors
from motorbus.cli.exits import NeedsConsent
from motorbus.cli.output import Output
from motorbus.errors import LinkLost


class Terminal(io.StringIO):
    """A stream that a person watches."""

    def isatty(self) -> bool:
        return True


def watched(monkeypatch: pytest.MonkeyPatch, typed: str = "") -> Terminal:
    """From here on a person sits at all three streams, and has typed this already."""
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "100")
    stream = Terminal()
    monkeypatch.setattr(sys, "stdin", Terminal(typed))
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


def test_json_is_one_document_with_its_schema(capsys: pytest.CaptureFixture[str]) -> None:
    Output(json=True).document("motorbus.x/1", {"value": 1.5})
    assert json.loads(capsys.readouterr().out) == {"schema": "motorbus.x/1", "value": 1.5}


def test_json_says_when_it_is_simulated(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output(json=True)
    output.simulated = True
    output.document("motorbus.x/1", {})
    assert json.loads(capsys.readouterr().out)["simulated"] is True


def test_json_prints_no_table_and_no_prose(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output(json=True)
    output.table("t", ["a"], [[1]])
    output.text("words")
    assert capsys.readouterr().out == ""


def test_without_json_no_document_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    Output().document("motorbus.x/1", {})
    assert capsys.readouterr().out == ""


def test_a_number_that_is_none_is_no_json() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        Output(json=True).document("motorbus.x/1", {"value": float("nan")})


def test_a_piped_table_is_one_line_per_row_without_colour(capsys: pytest.CaptureFixture[str]) -> None:
    Output().table("title", ["name", ">n"], [["x" * 300, 7], ["[red]y[/red]", None]])
    title, head, long, markup = capsys.readouterr().out.splitlines()
    assert title == "title"
    assert head.split() == ["name", "n"]
    assert long.split() == ["x" * 300, "7"]
    assert markup.split() == ["[red]y[/red]"]


def test_a_terminal_gets_a_title_that_says_simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = watched(monkeypatch)
    output = Output()
    output.simulated = True
    output.table("Devices", ["a"], [[1]])
    assert "Devices (simulated)" in terminal.getvalue()
    assert "\x1b[" in terminal.getvalue()


def test_what_is_simulated_says_so_once_and_first(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output()
    output.simulated = True
    output.table("", ["a"], [[1]])
    output.text("words")
    output.table("Devices", ["a"], [[1]])
    assert capsys.readouterr().out == "simulated\na\n1\nwords\nDevices (simulated)\na\n1\n"


@pytest.mark.parametrize("simulated", [True, False])
def test_what_says_it_by_itself_is_not_marked_again(
    simulated: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    output = Output()
    output.simulated = simulated
    output.text("two simulated devices")
    output.text("words")
    assert capsys.readouterr().out == "two simulated devices\nwords\n"


def test_no_color_is_obeyed(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = watched(monkeypatch)
    monkeypatch.setenv("NO_COLOR", "1")
    Output().error(errors.NoReply("nobody"))
    assert "error: " in terminal.getvalue()
    assert re.search("\x1b\\[[0-9;]*3[0-7]", terminal.getvalue()) is None, "a colour"


def test_an_error_is_red_where_colour_is_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = watched(monkeypatch)
    Output().error(errors.NoReply("nobody"))
    assert terminal.getvalue().startswith("\x1b[1;31merror: ")


def test_notes_and_errors_go_to_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output()
    output.note("by the way")
    output.error(errors.NoReply("nobody", sent=b"\xff\x01", cause="no power", advice="look"))
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        "by the way\nerror: nobody\n  sent: FF 01\n  likely cause: no power\n  what to do: look\n"
    )


def test_an_error_is_one_json_object_with_its_parts(capsys: pytest.CaptureFixture[str]) -> None:
    refusal = errors.DeviceError("no", code=3, register="id", sent=b"\xff", node=7)
    Output(json=True).error(refusal)
    assert json.loads(capsys.readouterr().err) == {
        "schema": "motorbus.error/1",
        "error": "DeviceError",
        "exit": 7,
        "summary": "no",
        "sent": "FF",
        "node": 7,
        "register": "id",
        "code": 3,
    }


def test_an_error_of_another_make_is_told_too(capsys: pytest.CaptureFixture[str]) -> None:
    Output(json=True).error(KeyboardInterrupt())
    told = json.loads(capsys.readouterr().err)
    assert (told["error"], told["summary"], told["exit"]) == ("KeyboardInterrupt", "cancelled", 10)


def test_consent_needs_yes_where_nobody_can_be_asked(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(NeedsConsent, match="--yes"):
        Output().consent("move far?", yes=False)
    Output().consent("move far?", yes=True)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("answer", ["y\n", "YES\n"])
def test_a_person_is_asked_and_may_agree(monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    watched(monkeypatch, answer)
    Output().consent("move far?", yes=False)


@pytest.mark.parametrize("answer", ["\n", "n\n", ""])
def test_a_person_is_asked_and_may_refuse(monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    watched(monkeypatch, answer)
    with pytest.raises(NeedsConsent):
        Output().consent("move far?", yes=False)


def test_progress_is_silent_where_nobody_watches(capsys: pytest.CaptureFixture[str]) -> None:
    with Output().progress("work") as bar:
        bar.advance(1, 2, "half")
        bar.say("found one")
    assert capsys.readouterr() == ("", "")


def test_progress_and_early_results_are_shown_to_a_person(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = watched(monkeypatch)
    with Output().progress("work") as bar:
        bar.advance(1, 2, "half")
        bar.say("found [one]")
    assert "found [one]" in terminal.getvalue()
    assert "half" in terminal.getvalue()


def test_a_table_redraws_itself_only_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    watched(monkeypatch)
    assert Output().live
    assert not Output(json=True).live


@pytest.mark.parametrize("error", [KeyboardInterrupt(), errors.NoReply("node 3 did not answer")])
def test_what_was_added_to_an_error_on_its_way_is_told(
    error: BaseException, capsys: pytest.CaptureFixture[str]
) -> None:
    error.add_note("the servo is 3, and locked")
    Output().error(error)
    assert capsys.readouterr().err.endswith("\n  note: the servo is 3, and locked\n")
    Output(json=True).error(error)
    facts = json.loads(capsys.readouterr().err)
    assert facts["notes"] == ["the servo is 3, and locked"]
    assert "\n" not in facts["summary"]


def test_a_cause_that_several_have_in_common_is_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    gone = LinkLost("the port is gone", cause="it was unplugged", advice="see to it")
    for name in ("a1", "a2", "a2"):
        gone.add_note(f"{name} did not accept the stop: {LinkLost('it is gone', cause='it was unplugged')}")
    gone.add_note(f"leaving failed: {LinkLost('x', cause='another', advice='see to it')}")
    Output().error(gone)
    assert capsys.readouterr().err.splitlines() == [
        "error: the port is gone",
        "  likely cause: it was unplugged",
        "  what to do: see to it",
        "  note: a1 did not accept the stop: it is gone",
        "  note: a2 did not accept the stop: it is gone",
        "  note: leaving failed: x",
        "  likely cause: another",
    ]
