"""No error of a shell names what only a program can call, where there is a command for it."""

from __future__ import annotations

import re

import pytest

from motorbus import families
from motorbus.bus import failures
from motorbus.cli import faces, wording
from motorbus.errors import MotorbusError, RequestError
from motorbus.simulation.named import Simulation
from tests.cli.conftest import Run


@pytest.mark.parametrize(
    ("family", "said", "meant"),
    [
        (
            "kst",
            "use set_node_id(), or provision(), which",
            "use `motorbus kst node-id BUS#ID NEW`, or `motorbus kst",
        ),
        (
            "kst",
            "set_node_id(38) and save() put",
            "`motorbus kst node-id BUS#ID 38` and `motorbus kst save` put",
        ),
        ("kst", "set_reversed(False) first", "`motorbus kst reverse BUS#ID off` first"),
        ("kst", "say isolated=True; nothing", "say `motorbus scan BUS --bitrate all`; nothing"),
        ("feetech", "write(operating_mode=0) puts", "`motorbus write BUS#ID operating_mode=0` puts"),
        ("feetech", "set_mode('position') first", "`motorbus feetech mode BUS#ID position` first"),
        ("feetech", "still under way: stop() ends", "still under way: `motorbus stop` ends"),
        ("template", "use disable_torque()", "use `motorbus torque off`"),
        ("feetech", "see to it, then robot.clear_fault('a1')", "see to it, then give the order again"),
        (
            "kst",
            'see to it, then robot.clear_fault("a1"), or open the machine anew; nothing was sent',
            "see to it, then give the order again; nothing was sent",
        ),
    ],
)
def test_methods_become_commands(family: str, said: str, meant: str) -> None:
    error = MotorbusError("x", cause=said, advice=said)
    found = families.load("feetech" if family == "template" else family)
    wording.in_words_of_the_shell(error, found)
    assert meant in error.cause
    assert meant in error.advice
    assert meant in str(error)


@pytest.mark.parametrize(
    "text", ["a way (of 180 degrees)", "enable_torque(jump=0.5)", "2048 (raw)", "f(x)", "{}()"]
)
def test_everything_else_stays(text: str) -> None:
    error = RequestError(text, advice=text)
    wording.in_words_of_the_shell(error, families.load("kst"))
    assert (error.summary, error.advice) == (text, text)


@pytest.mark.parametrize("family", faces.names())
def test_every_command_that_is_named_exists(family: str, run: Run) -> None:
    said = {**wording.COMMANDS, **(faces.offer(family, "COMMANDS") or {})}
    for text in said.values():
        words = re.sub(r"[`{}|]|BUS.*|--.*", "", text).split()[1:]
        assert run(*[word for word in words if word not in ("on", "off")], "--help").code == 0


@pytest.mark.parametrize(
    "words", ["node_id=38", "bit_rate_code=7 --yes", "store=1", "function_enable=1", "mid_point=0"]
)
def test_a_protected_object_is_refused_in_the_words_of_a_shell(words: str, run: Run) -> None:
    ran = run("write", "kst:sim,profile=kst-ext#1", *words.split())
    assert (ran.code, ran.out) == (2, "")
    assert "use `motorbus kst " in ran.err
    assert "()" not in ran.err


def test_what_is_said_of_one_of_several_is_worded_too(run: Run, arm: Simulation) -> None:
    arm[1].memory["operating_mode"] = 3
    ran = run("stop", f"{arm.url}#1")
    assert ran.code == 2
    assert "use `motorbus torque off`, after which it is limp" in ran.err


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("recover() ends it", "`motorbus recover arm` ends it"),
        ("then recover(alone=True)", "then `motorbus recover arm --alone`"),
        ("`motorbus recover BUS --forget` gives", "`motorbus recover arm --forget` gives"),
        ("`motorbus scan BUS` lists, BUS", "`motorbus scan arm` lists, BUS"),
        ("set_mode('position') first", "`motorbus feetech mode BUS#ID position` first"),
        ("`motorbus estop [BUS]`", "`motorbus estop [BUS]`"),
    ],
)
def test_the_bus_of_a_command_that_is_named_is_the_one_at_hand(said: str, meant: str) -> None:
    error = MotorbusError("x", advice=said)
    error.add_note(said)
    wording.in_words_of_the_shell(error, families.load("feetech"), "arm")
    assert (error.advice, error.__notes__) == (meant, [meant])


def test_after_an_emergency_stop_a_shell_is_told_to_begin_again() -> None:
    error = failures.latched("in this process")
    wording.in_words_of_the_shell(error, families.load("stepper"))
    assert error.advice == "when it is safe, give the command again, for the stop has ended this one"


def test_notes_are_worded_too_those_of_an_interruption_as_well() -> None:
    error = KeyboardInterrupt()
    error.add_note("the change is unfinished, recover() ends it")
    wording.in_words_of_the_shell(error, families.load("feetech"))
    assert error.__notes__ == ["the change is unfinished, `motorbus recover BUS` ends it"]
