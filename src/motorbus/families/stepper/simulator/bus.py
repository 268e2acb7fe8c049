"""The simulated line: requests that arrive, replies and notices in order."""

from __future__ import annotations

from math import inf
from typing import Final

from motorbus.core.framing import FrameParser
from motorbus.core.request import Data
from motorbus.core.simulated import SerialLine
from motorbus.families.stepper.protocol import HEADER, NOTICE, ONLY, RATE, REQUEST_LENGTH, is_request
from motorbus.families.stepper.simulator.controller import Controller

GAP: Final = 0.1  # s after which the begin of a request is dropped # assumption


def _parser() -> FrameParser:
    return FrameParser((HEADER,), lambda data: REQUEST_LENGTH, is_request)


class StepperBus(SerialLine[Controller]):
    """A `core.family.Simulator` of one controller.

    A request is carried out when it arrives. The controller sends one thing after the other: a notice waits for the
    reply to the request before it.
    """

    def __init__(self, controller: Controller) -> None:
        super().__init__({ONLY: controller}, RATE, _parser())
        self.controller = controller
        self._busy_until = -inf
        self._last_byte = -inf
        controller.on_power_off = self._power_off

    def receive(self, data: Data, at: float) -> None:
        """Take bytes of the host whose last bit arrives at this moment (s)."""
        self.controller.advance(max(at, self.now))
        self._send_notices()
        if at - self._last_byte > GAP:
            self._parser = _parser()
        self._last_byte = at
        if self.controller.quirks.echo and isinstance(data, bytes):
            self.send(at, data)
        if self.controller.plugged:
            super().receive(data, at)

    def carry_out(self, frame: bytes, at: float) -> None:
        """Carry out a request; the next reply is not ready before it."""
        reply, ready = self.controller.reply(frame, at)
        if reply:
            self._busy_until = max(self._busy_until, ready)
            self.send(self._busy_until, reply)
        self._send_notices()

    def advance(self, to: float) -> list[tuple[float, Data]]:
        """Return what the controller begins to send up to this moment (s), in order."""
        self.controller.advance(to)
        self._send_notices()
        return super().advance(to)

    def due(self) -> float | None:
        """The next moment (s) at which the controller does something by itself, or None."""
        self._send_notices()
        moment = min([self.controller.due(), *(at for at, _ in self._replies)])
        return None if moment == inf else moment

    def _send_notices(self) -> None:
        for at in self.controller.notices:
            self.send(max(at, self._busy_until), NOTICE)
        self.controller.notices.clear()

    def _power_off(self) -> None:
        """Replies that were not sent are lost."""
        self._replies.clear()
        self._busy_until = -inf
        self._parser = _parser()
