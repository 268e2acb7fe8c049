"""Steps of a guided procedure, which a face shows: the shell, the page, the LeRobot plugin.

A guided procedure is a generator. It yields `Prompt`, `Live` and `Note`; the face sends back the text of the user for a
prompt, None or the text for a live table, None for a note. Closing the generator ends the procedure at that step.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol, TypeAlias, TypeVar

from msgspec import Struct

T = TypeVar("T")


class Prompt(Struct, frozen=True, tag="prompt"):
    """A question; the procedure waits. Without choices, Enter is the answer."""

    text: str
    choices: tuple[str, ...] = ()


class Row(Struct, frozen=True):
    """A joint in a live table: its values as text, and what is to be seen in it."""

    name: str
    values: tuple[str, ...]
    mark: str = ""


class Live(Struct, frozen=True, tag="live"):
    """A table that changes until the user presses Enter."""

    text: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]


class Note(Struct, frozen=True, tag="note"):
    """What was found or done."""

    text: str
    warning: bool = False


Step: TypeAlias = Prompt | Live | Note
Steps: TypeAlias = Generator[Step, str | None, T]


class Face(Protocol):
    """What shows steps to a user."""

    def show(self, step: Step) -> str | None:
        """Show a step: the answer of a prompt, the answer of a live table if there is one yet, None for a note."""


def run(steps: Steps[T], face: Face) -> T:
    """Run a guided procedure with this face."""
    answer: str | None = None
    try:
        while True:
            step = steps.send(answer)
            answer = face.show(step)
    except StopIteration as end:
        value: T = end.value
        return value
    finally:
        steps.close()


def ask(text: str, *choices: str) -> Steps[str]:
    """The choice of the user; the first choice for Enter."""
    while True:
        answer = ((yield Prompt(text, choices)) or "").strip().lower()
        if not choices:
            return answer
        if not answer:
            return choices[0]
        if (found := [choice for choice in choices if choice.startswith(answer)]) and len(found) == 1:
            return found[0]
