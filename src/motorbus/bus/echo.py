"""Echo: some adapters return every byte that is sent.

The echo of a FEETECH READ is a valid status frame, and the echo of a PING is a PING reply with an alarm. So a request
whose reply differs in length from its echo shows whether there is one: at open, and in every probe. From then on
exactly the bytes sent are removed from what comes in.

The stepper controller acknowledges some commands by their first six bytes. Until an echo is excluded, such a reply
waits for the rest of an echo. An echo of these six bytes alone cannot be distinguished from the reply.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from motorbus.core.request import Request


class Echo:
    """`present` is None while unknown. `strip` removes the expected echo.

    `recent` is what was sent last, `test` the request that shows at open whether there is an echo. `broken` is set when
    an expected echo did not come as a whole, `returned` when an unexpected one came.
    """

    def __init__(self) -> None:
        self.present: bool | None = None
        self.broken = False
        self.returned = False
        self.recent: deque[bytes] = deque(maxlen=8)
        self.test: Request[Any] | None = None
        self._expected = b""
        self._matched = b""
        self._since = b""

    def sent(self, data: bytes, testing: bool) -> None:
        """These bytes are sent; `testing`: the reply to them shows whether there is an echo."""
        self.recent.append(data)
        self._since = b""
        if self.present or (self.present is None and testing):
            self._expected += data

    @property
    def _last(self) -> bytes:
        return self.recent[-1] if self.recent else b""

    @property
    def is_out(self) -> bool:
        """There is no echo, and no byte is held back."""
        return self.present is False and not (self._expected or self._matched)

    @property
    def disproved(self) -> bool:
        """The bytes that came since the last request are not its beginning: there is no echo."""
        return bool(self._since) and not self._last.startswith(self._since)

    def may_be(self, reply: bytes) -> bool:
        """Echo is unknown, and the last request begins with this reply."""
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
        """Return the bytes held back as the beginning of an echo; nothing more is coming."""
        if self._matched and self.present:
            self.broken = True
            self.present = None
        held, self._matched, self._expected = self._matched, b"", b""
        return held

    def exclude(self) -> None:
        """A reply came that no echo preceded."""
        self.present = False

    def suspect(self) -> None:
        """A request came back unexpectedly: echo is unknown again."""
        self.present = None

    def reset(self) -> None:
        """The adapter was replugged: echo is unknown, and nothing sent before comes back."""
        self.present = None
        self.broken = self.returned = False
        self._expected = self._matched = self._since = b""
        self.recent.clear()
