"""What a project would read like after commands that were withheld: a dry run goes on where a read-back would follow.

By the same assumptions as everything else: edits go to a copy of the project that was selected last, and saving keeps
this copy. What was selected before is not known, so edits without a selection leave it open what comes of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from motorbus.families.stepper import wire
from motorbus.families.stepper.table import (
    BLANK,
    EDITS,
    PROJECTS,
    Order,
    decode_image,
    edited,
    encode_image,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from motorbus.core.family import BusDriver
    from motorbus.core.request import Data


def as_written(
    driver: BusDriver, read: Mapping[Data, Any], withheld: Iterable[bytes], request: Data
) -> bytes | None:
    """The reply to a request after what was withheld; b"" where that makes no difference, None where nobody can say.

    `read` is what was read before, by its request.
    """
    asked = wire.decode_request(request) if isinstance(request, bytes) else None
    if asked is None or asked.command.name != "read_project":
        return None
    desk = _Desk(getattr(driver, "order", "little"), read)
    for frame in withheld:
        desk.take(frame)
    return desk.dump(asked.values["project"])


class _Desk:
    """The stored images as far as they were read, and the copy that is edited."""

    def __init__(self, order: Order, read: Mapping[Data, Any]) -> None:
        asked = {number: wire.encode("read_project", project=number) for number in range(1, PROJECTS + 1)}
        self._order = order
        self._stored: dict[int, bytes | None] = {
            number: read[request][wire.REPLY_LENGTH :] for number, request in asked.items() if request in read
        }
        self._selected = 0
        self._working: bytes | None = None
        self._known = True

    def dump(self, number: int) -> bytes | None:
        """What reading this project would bring; b"" where nothing was said that touches it, None if not known."""
        image = self._working if number == self._selected else self._stored.get(number, b"")
        if not self._known or image is None:
            return None
        return wire.encode_dump(number, image) if image else b""

    def take(self, frame: bytes) -> None:
        """A command that was withheld."""
        said = wire.decode_request(frame)
        if said is None:
            return
        name, number = said.command.name, said.values.get("project", 0)
        if name == "select_project":
            self._selected, self._working = number, self._stored.get(number)
        if name in EDITS:
            self._edit(name, said.values)
        elif name == "save_project":
            self._stored[number] = self._working
        elif name == "clear_project":
            self._stored[number] = BLANK
            self._working = BLANK if number == self._selected else self._working

    def _edit(self, name: str, values: Mapping[str, int]) -> None:
        if self._working is None:
            self._known = False
            return
        project = edited(decode_image(self._working, self._order), name, values)
        numbered = replace(project, number=self._selected)
        self._working = encode_image(numbered, self._order, over=self._working)
