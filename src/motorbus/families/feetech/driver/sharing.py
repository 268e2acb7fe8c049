"""Do two servos share an id? Found out by listening to how they answer, again and again.

Two that answer at once pull the line low together, and what arrives is neither's answer; two that answer one after the
other are heard twice. So an id is read many times in long pieces, which overlap most, alternately with the line kept
open for a second answer. Measured on two STS3215 with one id: about 4 of 10 reads of 15 bytes were garbled or doubled,
on one alone 0 of 120 (servolab). Two servos with the same contents and the same timing cannot be told from one by
listening: their answers are one answer. Nothing but connecting one at a time rules that out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from motorbus.core.request import Expected, Request, Response, TimeoutClass
from motorbus.core.steps import Emit, Progress, SetBitrate, catch
from motorbus.errors import MotorbusError, NoReply, RequestError, WireError
from motorbus.families.feetech import wire
from motorbus.families.feetech.driver.exchanges import PRESENT, read_block
from motorbus.families.feetech.driver.node import IMAGE, Node

POLLS: Final = 200
FEEDBACK: Final = 15
"""Bytes from the present position on: everything a servo measures, in every map."""
BLOCKS: Final = ((PRESENT, FEEDBACK), (0, IMAGE))
"""What is read in turn: the feedback, which moves, and the EEPROM, which cannot differ from one read to the next."""
SIGNS: Final = 4
"""Garbled answers that make a suspicion; fewer may be noise. Where few questions are asked, half as many do."""
FEW: Final = 20
MOST: Final = 100_000
"""Polls at most: some minutes at 1 Mbit/s, and nothing that more of them could show."""
ENOUGH: Final = 10
"""Signs after which nobody need look any further."""
_ID: Final = 5


class ScanWarning(NamedTuple):
    """What `polls` questions to one id at one rate (bit/s) have shown.

    That nothing was seen proves nothing: two servos with equal contents and equal timing answer as one.

    `garbled`  answers in which bytes were wrong, missing or too many
    `doubled`  questions that were answered twice
    `changed`  reads of the EEPROM that brought something else than the first
    `silent`   questions without an answer, which say nothing about a second servo
    """

    node: int
    rate: int
    polls: int
    garbled: int = 0
    doubled: int = 0
    changed: int = 0
    silent: int = 0

    @property
    def signs(self) -> int:
        """How often something was seen that one servo alone does not do."""
        return self.garbled + self.doubled + self.changed

    @property
    def suspected(self) -> bool:
        """Two servos probably have this id, or the line is so bad that it looks like it."""
        weight = self.garbled + 2 * (self.doubled + self.changed)
        return weight >= (SIGNS if self.polls > FEW else SIGNS // 2)

    @property
    def evidence(self) -> str:
        """What was seen, in words."""
        seen = {
            "garbled": self.garbled,
            "doubled": self.doubled,
            "with other EEPROM contents": self.changed,
            "silent": self.silent,
        }
        told = ", ".join(f"{count} {what}" for what, count in seen.items() if count)
        return f"of {self.polls} answers {told or 'none was garbled, doubled or different'}"


async def duplicates(node: Node, polls: int = POLLS, *, quiet: bool = False) -> ScanWarning:
    """Does more than one servo answer to this id? Asks at most `polls` times, fewer when it is plain; writes nothing.

    Reports `Progress` unless `quiet`. Raises NoReply when there was no answer at all, RequestError for fewer polls
    than one or more than `MOST`.
    """
    if not 1 <= polls <= MOST:
        raise RequestError(
            f"{polls} polls", expected=f"1 to {MOST}", advice="nothing was sent", node=node.node
        )
    seen = ScanWarning(node.node, await SetBitrate(0), 0)
    first = b""
    silence: MotorbusError | None = None
    for number in range(polls):
        block = BLOCKS[number // 2 % len(BLOCKS)]
        answers = await catch((_alone if number % 2 == 0 else read_twice)(node, *block))
        if isinstance(answers, NoReply):
            silence = silence or answers  # the first one says what may be the cause, too
        if block[0] == 0 and not first and not isinstance(answers, MotorbusError):
            first = answers[0]
        told = _told(answers, first if block[0] == 0 else None)
        if told:
            told = await _in_step(node) or told
            seen = seen._replace(**{told: getattr(seen, told) + 1})
        seen = seen._replace(polls=number + 1)
        if not quiet:
            await Emit(Progress(number + 1, polls, f"does one servo answer as {node.node}?"))
        if seen.signs >= ENOUGH:
            break
    if silence is not None and seen.silent == seen.polls:
        raise silence
    return seen


def _told(answers: Sequence[bytes] | MotorbusError, first: bytes | None) -> str:
    """Which count of a `ScanWarning` this is, "" for what one servo does; `first` is what it cannot differ from."""
    if isinstance(answers, WireError):
        return "garbled"
    if isinstance(answers, NoReply):
        return "silent"
    if isinstance(answers, MotorbusError):
        raise answers
    if len(answers) > 1:
        return "doubled"
    return "changed" if first is not None and answers[0] != first else ""


async def _in_step(node: Node) -> str:
    """Ask something that no late answer can be taken for, so that none is heard twice; "garbled" when that is."""
    found = await catch(read_block(node, _ID, 1, bytes))
    return "garbled" if isinstance(found, WireError) else ""


async def refuse_duplicates(node: Node, polls: int = POLLS) -> None:
    """Raise RequestError when two servos are suspected to have this id: a write to it would reach both."""
    seen = await duplicates(node, polls)
    if seen.suspected:
        raise RequestError(
            f"two servos seem to have the id {node.node}: {seen.evidence}",
            expected="one servo",
            cause="new servos all have the id 1; noise on the line, or a loose cable, looks alike",
            advice="connect one servo at a time; nothing was written",
            node=node.node,
        )


def _alone(node: Node, address: int, count: int) -> Request[tuple[bytes, ...]]:
    """One read, tried once; surplus bytes and wrong ones make it fail."""
    return read_block(node, address, count, lambda data: (data,), timeout=TimeoutClass.SCAN)


async def read_twice(node: Node, address: int, count: int) -> tuple[bytes, ...]:
    """The same with the line kept open as long as a second answer could take."""
    due = Expected(node.node, node.node, wire.OVERHEAD + count)

    def read(answer: Response) -> tuple[bytes, ...]:
        for reply in answer.replies:
            node.heard(reply.data[4], answer.at)
        return tuple(reply.data[5 : 5 + count] for reply in answer.replies)

    answers = await Request(
        wire.read(node.node, address, count),
        (due, due),
        read,
        reply_within=TimeoutClass.SCAN,
        repeatable=True,
    )
    if not answers:
        raise NoReply(f"node {node.node} did not answer", node=node.node)
    return answers
