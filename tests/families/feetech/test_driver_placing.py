"""The steps of a change, byte by byte: nothing is believed that was not seen, and the lock is the last word."""

from __future__ import annotations

import pytest

from motorbus.core.operation import Effect
from motorbus.errors import ChecksumError, OutcomeUnknown, RequestError, VerificationFailed
from motorbus.families.feetech.driver.jobs import SET_BAUD, SET_ID, Course, Job, Place
from motorbus.families.feetech.driver.placing import (
    COMMIT,
    NOISE,
    called,
    like,
    locked,
    look,
    met,
    refuse_taken,
    rewritten,
    seen,
    whoever,
)
from tests.families.feetech.driver_script import (
    Line,
    Played,
    image,
    play,
    prepared,
    reads,
    unheard,
    watch,
    writes,
)

ID = Job(SET_ID, Place(3, 1_000_000), Place(7, 1_000_000), image(3))
BAUD = Job(SET_BAUD, Place(3, 1_000_000), Place(3, 500_000), image(3))
OFF, UNLOCK = writes(3, 40, 0), writes(3, 55, 0)
THERE, OPEN = reads(7, 0, *image(7)), reads(7, 55, 0)


def course() -> Course:
    return Course(ID, ["intent"])


def test_a_cell_is_written_without_awaiting_anything_and_seen_at_the_new_place() -> None:
    reached = course()
    played = watch(
        rewritten(ID, prepared(), ID.new, reached), UNLOCK, OFF, unheard(writes(3, 5, 7)), THERE, OPEN
    )
    assert played.exchanges[2].replies == ()
    assert played.exchanges[2].effect is Effect.IDENTITY
    assert played.now > 100 + COMMIT
    assert reached.reached == ["intent", "writing 7", "written 7"]


def test_a_rate_is_tuned_to_before_it_is_looked_for() -> None:
    lines = (UNLOCK, OFF, unheard(writes(3, 6, 1)), reads(3, 0, *image(3, at_6=1)), reads(3, 55, 0))
    assert watch(rewritten(BAUD, prepared(), BAUD.new, Course(BAUD, ["intent"])), *lines).rates == [500_000]


@pytest.mark.parametrize("there", [reads(7, 0, *image(7, at_13=60)), reads(7, 0, *image(3))])
def test_somebody_else_at_the_new_place_is_no_proof(there: Line) -> None:
    with pytest.raises(OutcomeUnknown, match="is not seen there"):
        play(rewritten(ID, prepared(), ID.new, course()), UNLOCK, OFF, unheard(writes(3, 5, 7)), there)


def test_one_that_is_still_starting_is_awaited() -> None:
    silent = unheard(THERE)
    lines = (UNLOCK, OFF, unheard(writes(3, 5, 7)), silent, silent, THERE, OPEN)
    assert play(rewritten(ID, prepared(), ID.new, course()), *lines).node == 7
    with pytest.raises(OutcomeUnknown, match="was told to become 7"):
        play(rewritten(ID, prepared(), ID.new, course()), *lines[:3], silent, silent, silent)


def test_a_lock_that_has_closed_by_itself_tells_of_a_lost_supply() -> None:
    with pytest.raises(OutcomeUnknown, match="has lost its supply"):
        play(
            rewritten(ID, prepared(), ID.new, course()),
            *(UNLOCK, OFF, unheard(writes(3, 5, 7)), THERE, reads(7, 55, 1)),
        )


def test_the_lock_is_closed_and_read_back() -> None:
    play(locked(ID, like(prepared(), 7)), writes(7, 55, 1), reads(7, 55, 1))
    with pytest.raises(VerificationFailed):
        play(locked(ID, like(prepared(), 7)), writes(7, 55, 1), reads(7, 55, 0))


def test_looking() -> None:
    assert play(look(7), THERE) == image(7)
    assert play(look(7), unheard(THERE)) == b""
    garbled = Line(THERE.sent, ChecksumError("c"))
    with pytest.raises(ChecksumError):
        play(look(7), garbled)
    assert play(whoever(7), garbled) == NOISE
    assert play(seen(7), unheard(THERE), THERE) == image(7)


@pytest.mark.parametrize(("found", "told"), [(image(7), "a servo answers"), (NOISE, "no answer came")])
def test_a_place_that_is_taken_is_refused(found: bytes, told: str) -> None:
    refuse_taken(ID.new, b"")
    with pytest.raises(RequestError, match=told):
        refuse_taken(ID.new, found)


def test_a_servo_that_was_found_can_be_written_to() -> None:
    node = met(7, image(7, at_8=0))
    assert node.writable
    assert node.settings is not None
    assert not node.settings.answers_writes
    assert like(node, 9).node == 9


def test_a_place_is_called_by_what_changes() -> None:
    assert (called(ID, ID.new), called(BAUD, BAUD.new)) == ("7", "one at 500000 bit/s")


def test_the_record_of_the_writing_stands_before_the_write() -> None:
    played = Played([UNLOCK, OFF], interrupt_at=2)
    reached = course()
    with pytest.raises(KeyboardInterrupt):
        played.run(rewritten(ID, prepared(), ID.new, reached))
    assert reached.reached[-1] == "writing 7"
