"""A dry run sees what it would have written: the same frames as the real run, as far as inputs do not matter."""

from __future__ import annotations

import pytest

from motorbus.cli.stepper.rehearsal import as_written
from motorbus.core.request import Data
from motorbus.families.stepper import FAMILY, wire
from motorbus.families.stepper.table import decode_image
from tests.cli.conftest import Run
from tests.cli.stepper.conftest import EXAMPLE, Line
from tests.protocol.stepper.vectors import DUMP_A, DUMP_B

READ = {1: wire.encode("read_project", project=1), 2: wire.encode("read_project", project=2)}
KNOWN: dict[Data, bytes] = {READ[1]: DUMP_A, READ[2]: DUMP_B}
SELECT = wire.encode("select_project", project=2, total_steps=3)
DELAY = wire.encode("set_step_delay", step=1, delay=7)


def seen(withheld: list[bytes], project: int = 2) -> int | None:
    """The delay of step 1 as it would be read, None where nobody can say, -1 where nothing has touched it."""
    found = as_written(FAMILY.open(), KNOWN, withheld, READ[project])
    if found is None:
        return None
    return decode_image(found[6:]).step(1).delay if found else -1


def test_edits_show_in_the_project_that_was_selected() -> None:
    assert seen([SELECT, DELAY]) == 7
    assert seen([SELECT, DELAY], project=1) == 1000
    saved = wire.encode("save_project", project=1)
    assert seen([SELECT, DELAY, saved], project=1) == 7
    cleared = wire.encode("clear_project", project=2)
    assert seen([SELECT, DELAY, cleared]) == 0
    assert seen([SELECT, DELAY, SELECT]) == 500, "selecting loads what is stored"


def test_what_cannot_be_said_is_not() -> None:
    assert seen([DELAY]) is None, "nobody knows what was selected"
    assert seen([DELAY], project=1) is None
    assert as_written(FAMILY.open(), {}, [SELECT, DELAY], READ[2]) is None, "it was never read"
    assert as_written(FAMILY.open(), KNOWN, [SELECT], wire.encode("read_input", port=1)) is None
    assert as_written(FAMILY.open(), {}, [wire.encode("stop_motor")], READ[1]) == b"", "a stop edits nothing"


@pytest.mark.parametrize(
    "words",
    [
        "move BUS#1+=90deg",
        "move BUS#1-=1turn --velocity 60rpm --yes",
        "jog BUS#1=60rpm --seconds 1 --yes",
        "stepper write EXAMPLE BUS --yes",
        "write BUS#1 step_1_delay=500ms step_1_speed=60rpm --yes",
        "stepper run BUS --project 1 --stop-first --yes",
        "stop BUS#1",
    ],
)
@pytest.mark.usefixtures("state_folder")
def test_it_shows_the_very_frames_that_are_sent_afterwards(words: str, run: Run, line: Line) -> None:
    said = words.replace("BUS", line.url).replace("EXAMPLE", EXAMPLE).split()
    shown = run(*said, "--dry-run", "--json")
    assert shown.code == 0, shown.err
    assert shown.err == ""
    assert line.orders() == []
    line.heard.clear()
    assert run(*said).code == 0
    sent = [data.hex(" ").upper() for data in line.heard if data[2] != 0x3E]
    assert [one["data"] for one in shown.document["withheld"]] == sent
