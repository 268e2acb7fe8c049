"""Echo: some adapters return every byte that is sent.

The echo of a FEETECH READ is a valid status frame. So the bus looks for an echo at open and after a reconnect only, by
a request whose reply cannot be its echo, and from then on removes exactly the bytes that it sent.
"""

from __future__ import annotations

from typing import Any

from motorbus.core.request import Request


class Echo:
    """`present`: the adapter echoes. `testing`: the reply to the next probe or `test` shows whether it does.

    `broken` is set where an echo of an adapter that echoes did not come as it was sent.
    """

    def __init__(self) -> None:
        self.present = False
        self.testing = True
        self.broken = False
        self.test: Request[Any] | None = None
        self._expected = b""
        self._matched = b""

    def sent(self, data: bytes, testing: bool) -> None:
        """These bytes are sent; `testing`: the reply to them shows whether there is an echo."""
        if self.present or (self.testing and testing):
            self._expected += data

    def strip(self, data: bytes) -> bytes:
        """What remains of incoming bytes without the echo; where that is broken, without what may belong to it."""
        expected = self._expected
        if not expected:
            return data
        count = min(len(expected), len(data))
        if data[:count] != expected[:count]:
            return self.give_up(data)
        self._expected, self._matched = expected[count:], self._matched + data[:count]
        if not self._expected:
            self._matched, self.present = b"", True
        return data[count:]

    def give_up(self, data: bytes = b"") -> bytes:
        """The rest of an echo does not come: the bytes held back and these, if there is no echo at all."""
        held, waited = self._matched + data, bool(self._expected)
        self._matched = self._expected = b""
        if self.testing:
            self.present = False
            return held
        self.broken = self.broken or waited
        return b""

    def end_test(self) -> None:
        """The test was answered: after its echo, or without one."""
        self.testing = False

    def reset(self) -> None:
        """The adapter was replugged: the next probe is a test, and nothing sent before comes back."""
        self.testing, self.broken = True, False
        self._expected = self._matched = b""
