"""What a change of id or baud rate is about, and where the servo may be while it is under way.

Both change one cell of the EEPROM by which the servo is found at all. All that is needed to finish the change or to
take it back is kept as plain data, so that another process can do it after a crash.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from motorbus.core.family import IdChanged
from motorbus.core.register import RegisterMap
from motorbus.core.request import Effect
from motorbus.core.steps import OUTCOME, REACHED, Emit, JournalEntry
from motorbus.errors import RequestError
from motorbus.families.feetech.driver.exchanges import Block
from motorbus.families.feetech.driver.identity import identity_of
from motorbus.families.feetech.driver.node import IMAGE, checked_id
from motorbus.families.feetech.table import BAUD_CODES, TABLES

SET_ID: Final = "set_id"
SET_BAUD: Final = "set_baud"
ID: Final = 5
BAUD: Final = 6
WRITING: Final = "writing"
WRITTEN: Final = "written"
SECOND: Final = "second"
"""The second id is about to be written, see `Job.second`."""
AGAIN: Final = "again"
"""A recovery is about to open a lock that it has met closed, so an open one proves nothing from now on."""
SHIPPED_ID: Final = 1
SHIPPED_RATES: Final = (1_000_000, 115_200, 500_000)
"""bit/s as shipped: STS and HLS, SMS, some SCS. Source: vendor memory tables."""
_HEAD: Final = 5


class Place(NamedTuple):
    """Where a servo answers: under which id, at which rate in bit/s."""

    id: int
    rate: int


class Job(NamedTuple):
    """A change by this verb of the servo that is at `old`, to be at `new`.

    `image` is its registers 0 to 39 as they were before, `others` the ids that other servos answered to.
    """

    verb: str
    old: Place
    new: Place
    image: bytes
    others: tuple[int, ...] = ()

    @property
    def cell(self) -> int:
        """The register it changes."""
        return ID if self.verb == SET_ID else BAUD

    @property
    def table(self) -> RegisterMap:
        """The register map of the servo."""
        return TABLES[identity_of(self.old.id, self.image[:_HEAD]).table]

    @property
    def lock(self) -> int:
        """The address of the EEPROM lock in its map."""
        return self.table["lock"].address

    @property
    def second(self) -> int | None:
        """The address of a second id that goes along with the id, for it is the old id; None when nothing goes along.

        An HLS servo that kept it would go on obeying every write to the id that the next new servo has.
        """
        if self.verb != SET_ID or "second_id" not in self.table:
            return None
        address = self.table["second_id"].address
        return address if self.image[address] == self.old.id else None

    def value(self, place: Place) -> int:
        """What the cell holds of a servo that is there."""
        return place.id if self.cell == ID else CODES[place.rate]

    def expected(self, place: Place) -> bytes:
        """Registers 0 to 39 of the servo when it is there."""
        image = bytearray(self.image)
        image[self.cell] = self.value(place)
        return bytes(image)

    def block(self, place: Place) -> Block:
        """The write that brings it there."""
        return Block(self.cell, bytes((self.value(place),)), Effect.IDENTITY, repeatable=False)

    def is_it(self, image: bytes, met: bytes = b"") -> bool:
        """Are these the registers of this very servo, wherever it is? Model, firmware and all settings are the same as
        before the change; or, where it has been met since, the same as then."""
        return self._lasting(image) == self._lasting(met or self.image)

    def is_at(self, place: Place, image: bytes, met: bytes = b"") -> bool:
        """Are these the registers of this very servo when it is there?"""
        there = self.expected(place)
        return image == there or (self.is_it(image, met) and image[ID : BAUD + 1] == there[ID : BAUD + 1])

    def is_like_it(self, image: bytes) -> bool:
        """Model and firmware are the same: it, with settings changed since, or another one of its kind.

        Settings that were written while the lock was closed are gone after a power cycle, so it may have others itself.
        """
        return image[:_HEAD] == self.image[:_HEAD]

    def facts(self) -> dict[str, object]:
        """All of it as plain data."""
        return {
            **self.name(),
            "rate": self.old.rate,
            "registers": self.image.hex(),
            "others": list(self.others),
        }

    def name(self) -> dict[str, object]:
        """Which change of this verb it is, among its facts."""
        return {"node": self.old.id, "new": self.new.id, "new_rate": self.new.rate}

    def _lasting(self, image: bytes) -> bytes:
        """What of its registers a change leaves as it is."""
        changing = (ID, BAUD, self.second)
        return bytes(value for address, value in enumerate(image) if address not in changing)


CODES: Final = {rate: code for code, rate in BAUD_CODES.items()}
"""bit/s -> value of the baud rate register."""


def job_of(verb: str, facts: Mapping[str, Any]) -> Job:
    """The change that these facts tell of. Raises RequestError when they tell of none that this driver makes."""
    try:
        old = Place(checked_id(facts["node"]), facts["rate"])
        new = Place(checked_id(facts["new"]), facts["new_rate"])
        job = Job(verb, old, new, bytes.fromhex(facts["registers"]), tuple(facts["others"]))
        if verb not in (SET_ID, SET_BAUD) or len(job.image) != IMAGE:
            raise ValueError(verb)
        job.value(old), job.value(new), job.lock
    except (KeyError, TypeError, ValueError) as error:
        raise RequestError(
            f"these are not the facts of a change that can be recovered: {error!r}",
            expected="what the journal of the bus holds of a set_id() or set_baud()",
            advice="nothing was sent",
        ) from error
    return job


class Course:
    """How far a job has come, in the journal and here; `reached` are its states in order.

    A state is kept here before it is recorded: whatever interrupts the recording must find that something has begun.
    One that stands here and not in the journal costs a look at the servo, or a write of what it has, and no more.
    """

    def __init__(self, job: Job, reached: Sequence[str] = ()) -> None:
        self.job = job
        self.reached = list(reached)

    async def reach(self, state: str, place: Place | None = None) -> None:
        """Record that this state is reached; with a place, of which of both the value is meant."""
        word = state if place is None else f"{state} {self.job.value(place)}"
        facts = {} if self.reached else self.job.facts()
        if not self.reached:
            await self._readdressed()
        self.reached.append(word)
        await Emit(JournalEntry(self.job.verb, word, facts))

    async def resume(self, state: str) -> None:
        """The same for whoever takes it up again, maybe on a bus whose journal knows nothing of it: all is told."""
        facts = {**self.job.facts(), REACHED: list(self.reached)}
        await self._readdressed()
        self.reached.append(state)
        await Emit(JournalEntry(self.job.verb, state, facts))

    async def _readdressed(self) -> None:
        if self.job.new.id != self.job.old.id:
            await Emit(IdChanged(self.job.old.id, self.job.new.id))

    async def end(self, outcome: str) -> None:
        """Record how it ended: "new" or "old"."""
        self.reached.append(OUTCOME)
        await Emit(JournalEntry(self.job.verb, OUTCOME, {"outcome": outcome, **self.job.name()}))

    @property
    def following(self) -> bool:
        """The second id may have been written, with the lock open or not; once an outcome is told, it has been seen."""
        return OUTCOME not in self.reached and any(state.startswith(SECOND) for state in self.reached)

    def doubtful(self, place: Place) -> bool:
        """A servo that is at this place and has its lock closed may not be there after the next power-off.

        Either the value of this place was being written last, and nobody has seen that the lock was open then; or
        another value was, and this one is what a servo has that finds neither in its torn cell: as shipped.
        """
        written = [state for state in self.reached if state.startswith((WRITING, WRITTEN))]
        if not written or written[-1].startswith(WRITTEN):
            return False
        shipped = place.id == SHIPPED_ID if self.job.cell == ID else place.rate in SHIPPED_RATES
        return shipped or written[-1] == f"{WRITING} {self.job.value(place)}"


def elsewhere(job: Job, ids: Sequence[int], rates: Sequence[int]) -> Iterator[Place]:
    """Every place of these ids and rates, rate by rate, but the two where it ought to be."""
    for rate in dict.fromkeys(rates):
        for id in dict.fromkeys(ids):
            if (id, rate) not in (job.old, job.new):
                yield Place(id, rate)
