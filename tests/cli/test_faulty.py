"""The flag `--faults`: a script, a file, a question; and nowhere but before a simulator."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from motorbus.cli import faulty
from motorbus.cli.exits import Exit
from motorbus.cli.faulty import MOST, from_option
from motorbus.errors import RequestError
from motorbus.simulation.faults import WORDS, parse
from tests.cli.conftest import Run


def test_a_script_a_file_or_nothing(tmp_path: Path) -> None:
    file = tmp_path / "noise"
    file.write_text("seed 3\n1%: drop  # now and then\n")
    assert from_option(str(file)) == from_option("seed 3; 1%: drop") == parse("seed 3; 1%: drop")
    assert len(from_option(None)) == 0
    for empty in ("", " \n"):  # as of a variable of a shell that is not set
        with pytest.raises(RequestError, match="^--faults: the text is empty"):
            from_option(empty)
    for nothing in ("seed 1", "# exchange 1 drop", ";"):
        with pytest.raises(RequestError, match="there is no fault in it"):
            from_option(nothing)
    with pytest.raises(RequestError, match="neither a file nor a script"):
        from_option(str(tmp_path / "nothing"))
    for nothing in ("", "# nothing yet\n", "seed 3\n"):
        file.write_text(nothing)
        with pytest.raises(RequestError, match="there is no fault in it") as caught:
            from_option(str(file))
        assert str(file) in caught.value.summary
    file.write_text("seed 3\nexchange 1: drp\n")
    with pytest.raises(RequestError) as caught:
        from_option(str(file))
    assert caught.value.summary.startswith(f"--faults {file}: line 2: 'exchange 1: drp' is not a fault")
    assert caught.value.expected == "perhaps drop"
    file.write_bytes(b"\xef\xbb\xbfexchange 1: drop\r\n")  # as some editors write it
    assert from_option(str(file)) == parse("exchange 1: drop")
    long = "; ".join(f"exchange {number}: drop" for number in range(1000))
    assert len(from_option(long)) == 1000
    with pytest.raises(RequestError, match="neither a file nor a script"):
        from_option("\0")


@pytest.mark.parametrize(
    "contents", [bytes(range(256)), "exchange 1: drop\n".encode("utf-16"), b"\0", b"\xff"]
)
def test_a_file_that_is_no_text_is_named(tmp_path: Path, contents: bytes) -> None:
    file = tmp_path / "noise"
    file.write_bytes(contents)
    with pytest.raises(RequestError, match="this is no text: line 1: ") as caught:
        from_option(str(file))
    assert str(file) in caught.value.summary
    file.write_bytes(b"exchange 1: drop  # r\xfcckw\xe4rts")  # a remark may be written as it likes
    assert from_option(str(file)) == parse("exchange 1: drop")


def test_a_file_without_end_is_not_read_to_its_end(tmp_path: Path) -> None:
    file = tmp_path / "noise"
    line = b"exchange 1: drop # " + b"x" * (MOST // 1000) + b"\n"
    whole = line * (MOST // len(line))
    file.write_bytes(whole + b"#" * (MOST - len(whole)))
    assert len(from_option(str(file))) == MOST // len(line)
    with file.open("ab") as script:
        script.truncate(1 << 40)  # a hole: it takes no room, and reading it all would take hours
    with pytest.raises(RequestError, match=r"at most 1,048,576 bytes"):
        from_option(str(file))


@contextmanager
def piped(pipe: Path, *pieces: bytes) -> Iterator[None]:
    """Somebody writes this into a pipe, and closes it."""

    def write() -> None:
        with suppress(BrokenPipeError), pipe.open("wb", buffering=0) as end:
            for piece in pieces:
                end.write(piece)

    os.mkfifo(pipe)
    writer = threading.Thread(target=write)
    writer.start()
    yield
    writer.join()


def test_a_pipe_is_as_good_as_a_file(tmp_path: Path) -> None:
    with piped(tmp_path / "pipe", b"seed 3; exchange 1: ", b"drop\n", b"exchange 2: drop"):
        assert from_option(str(tmp_path / "pipe")) == parse("seed 3; exchange 1: drop; exchange 2: drop")


def test_a_pipe_that_says_too_much_is_not_read_to_its_end(tmp_path: Path) -> None:
    with (
        piped(tmp_path / "pipe", b"#" * MOST, b"#"),
        pytest.raises(RequestError, match="at most 1,048,576 bytes"),
    ):
        from_option(str(tmp_path / "pipe"))


def test_a_pipe_that_nobody_writes_to_is_not_waited_for_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(faulty, "PATIENCE", 0.01)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RequestError, match=r"nothing has come out of this pipe for 0\.01 s"):
        from_option(str(tmp_path / "pipe"))
    holder = os.open(tmp_path / "pipe", os.O_RDWR)  # there is a writer, and it says nothing
    os.write(holder, b"exchange 1: drop")
    with pytest.raises(RequestError, match="nothing has come out of this pipe"):
        from_option(str(tmp_path / "pipe"))
    os.close(holder)


def test_a_device_is_not_opened_for_a_script() -> None:
    with pytest.raises(RequestError, match="neither a file nor a script"):
        from_option("/dev/zero")


def test_help_lists_every_word(run: Run) -> None:
    said = run("simulate", "feetech", "--faults", "help", "--json")
    facts = json.loads(said.out)
    assert [one["fault"] for one in facts["faults"]] == list(WORDS)
    assert all(one["packet"] for one in facts["faults"])
    assert run("simulate", "feetech", "--faults", "help").out.count("\n") > len(WORDS) + len(facts["places"])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--faults", "exchange 1: explode"), "line 1"),
        (("--faults", "exchange 1: power-cycle 9"), "no node 9"),
        (("--faults", "exchange 1: unplug 1"), "no port here that could be pulled"),
        (("--faults", "exchange 1 on adapter: drop"), "text of an adapter"),
        (("--faults", "nothing-there"), "neither a file nor a script"),
        (("--faults", ""), "the text is empty"),
        (("--faults", "seed 1"), "'seed 1': there is no fault in it"),
        (
            ("--faults", "exchange 17 byte 3; drop"),
            "'exchange 17 byte 3' is not a fault: it does not say what",
        ),
        (("--faults", "# no fault: yet"), "there is no fault in it"),
        (("--faults", "exchange 1: clock-step 1e308"), "a year at most"),
        (("--faults", "at 1e300 s: unplug 1"), "a year of them at most"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_served(
    run: Run, words: tuple[str, ...], says: str
) -> None:
    said = run("simulate", "feetech", *words)
    assert said.code == Exit.USAGE
    assert says in said.err
    assert said.out == ""


@pytest.mark.parametrize(
    "words",
    [
        ("read", "feetech:/dev/nothing#1", "present_position", "--faults", "exchange 1: drop"),
        ("ping", "feetech:/dev/nothing#1", "--faults", "exchange 1: drop"),
        ("stop", "feetech:socket://127.0.0.1:1#1", "--faults", "exchange 1: drop"),
        ("move", "feetech:/dev/nothing,faults=x#1=90deg", "--yes"),
    ],
)
def test_faults_are_refused_on_every_other_port(run: Run, words: tuple[str, ...]) -> None:
    said = run(*words)
    assert said.code == Exit.USAGE
    assert "faults cannot be put in front of a port" in said.err
    assert "motorbus simulate FAMILY --faults" in said.err
