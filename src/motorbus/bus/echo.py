"""Echo: some adapters return every byte that is sent.

The first reply to a request of a bus that is opened, or open again, shows whether there is an echo; later that is
constant. Before it is known, bytes that may be an echo are held back until the deadline: the echo of a FEETECH PING is
a PING reply with an alarm, and the stepper controller acknowledges some commands by their first six bytes.
"""

from __future__ import annotations

from typing import Any

from motorbus.core.request import Request


class Echo:
    """`present` is None while unknown. `broken` is set where an echo did not come as it was sent.

    `test` is a request whose reply differs in length from its echo. `possible`: the link carries bytes.
    """

    def __init__(self, *, possible: bool) -> None:
        self._unknown = None if possible else False
        self.present: bool | None = self._unknown
        self.broken = False
        self.test: Request[Any] | None = None
        self._expected = b""
        self._matched = b""
        self._came = self._differs = False

    def sent(self, data: bytes) -> None:
        """These bytes are sent."""
        if self.present is not False:
            self._expected += data
            self._came = self._differs = False

    def strip(self, data: bytes) -> bytes:
        """What remains of incoming bytes without the echo."""
        expected = self._expected
        if not expected:
            return data
        count = min(len(expected), len(data))
        if data[:count] != expected[:count]:
            self._differs = True
            return self.give_up(data)
        self._expected, self._matched = expected[count:], self._matched + data[:count]
        if not self._expected:
            self._matched, self._came = b"", True
        return data[count:]

    def give_up(self, data: bytes = b"") -> bytes:
        """The rest of an echo does not come: the bytes held back and these, which are no echo if that is unknown."""
        held, lacks = self._matched + data, bool(self._expected)
        self._matched = self._expected = b""
        if not self.present:
            return held
        self.broken = self.broken or lacks
        return b""

    def conclude(self, *, is_test: bool) -> None:
        """A reply was accepted: behind a whole echo, or without one. A reply that may be an echo proves nothing."""
        if self.present is None and (self._came or self._differs or is_test):
            self.present = self._came

    def reset(self) -> None:
        """The adapter was replugged: nothing sent before comes back."""
        self.present, self.broken = self._unknown, False
        self._expected = self._matched = b""
