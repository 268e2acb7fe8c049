"""Some adapters hand back every byte that is sent. An echo can be a perfect forgery of an answer.

The echo of a FEETECH READ is a valid status frame, the echo of a PING is a PING reply with an alarm. So echo is
found out by an exchange whose answer differs in length (at open, and again by every probe after a doubt), and from
then on exactly the bytes sent are taken off what comes in.

Where a reply carries nothing of its own, the beginning of the echo is a whole acknowledgement: the stepper controller
answers "stop" by the first six bytes of "stop". Until an echo is excluded such a reply waits for what an echo would
still bring. An echo of which no more ever comes than that cannot be told from the reply by anybody.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from motorbus.core.operation import Exchange


class Echo:
    """`present` is None while unknown. `strip` takes off what is expected back.

    `recent` is what was sent lately, `test` the exchange that shows, when the bus is opened, whether there is an echo.
    `broken` is set when an echo was due and did not come, or not all of it, `returned` when one came that was not due.
    """

    def __init__(self) -> None:
        self.present: bool | None = None
        self.broken = False
        self.returned = False
        self.recent: deque[bytes] = deque(maxlen=8)
        self.test: Exchange[Any] | None = None
        self._expected = b""
        self._matched = b""
        self._since = b""

    def sent(self, data: bytes, testing: bool) -> None:
        """These bytes leave; `testing` when their answer can tell whether they come back."""
        self.recent.append(data)
        self._since = b""
        if self.present or (self.present is None and testing):
            self._expected += data

    @property
    def _last(self) -> bytes:
        return self.recent[-1] if self.recent else b""

    def left(self) -> None:
        """What was sent last has gone the straight way, and nothing has come since."""
        self._since = b""

    @property
    def is_out(self) -> bool:
        """It is known that nothing comes back, and nothing is held back to find out."""
        return self.present is False and not (self._expected or self._matched)

    @property
    def disproved(self) -> bool:
        """Since something was sent last bytes came that it does not begin with: no echo came first."""
        return bool(self._since) and not self._last.startswith(self._since)

    def may_be(self, reply: bytes) -> bool:
        """Nobody knows yet whether there is an echo, and what was sent last begins with this reply."""
        return self.present is None and self._last.startswith(reply)

    def strip(self, data: bytes) -> bytes:
        """What remains of incoming bytes without the echo; sets `broken` and `returned`."""
        lacking = len(self._last) - len(self._since)
        self._since += data[: max(0, lacking)]
        rest = self._without(data)
        self.returned = 0 < lacking <= len(data) and self._since == self._last and not self.present
        return rest

    def _without(self, data: bytes) -> bytes:
        expected = self._expected
        if not expected:
            return data
        count = min(len(expected), len(data))
        if data[:count] != expected[:count]:
            return self._differs(data)
        self._expected = expected[count:]
        self._matched += data[:count]
        if not self._expected:
            self.present = True
            self._matched = b""
        return data[count:]

    def _differs(self, data: bytes) -> bytes:
        data = self._matched + data
        if self.present:
            self.broken = True
            self.present = None
        self.give_up()
        return data

    def give_up(self) -> bytes:
        """Nothing more is coming: the bytes held back as the beginning of an echo, which is broken if one was due."""
        if self._matched and self.present:
            self.broken = True
            self.present = None
        held, self._matched, self._expected = self._matched, b"", b""
        return held

    def excluded(self) -> None:
        """An answer came that no echo preceded."""
        self.present = False

    def doubted(self) -> None:
        """The bytes sent came back where none were expected: find out again."""
        self.present = None

    def doubt_anew(self) -> None:
        """The adapter was gone and is there again: nothing that was sent before comes back, and nobody knows more."""
        self.present = None
        self.broken = self.returned = False
        self._expected = self._matched = self._since = b""
        self.recent.clear()
