"""A line with one fault at one byte, and nothing else wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.link.base import Delivery, Side

INSTANT: Final = 1e-6
"""s from the bytes before an unplugging to it."""


class ByteFault(NamedTuple):
    """A fault at a byte, counted from 0 in the direction `to` within an exchange, counted from 1.

    `action` is drop, duplicate, corrupt (`value`: the bits that change), insert (`value`: the byte in front) or delay
    (`seconds`: how much later this byte and all that follow in the exchange arrive), or unplug (bytes before it
    arrive).
    """

    exchange: int
    byte: int
    action: str
    to: Side = Side.HOST
    value: int = 0
    seconds: float = 0.0


class ByteFaultLine:
    """Carries data and lets one fault happen; `fired` lists it when it has.

    `unplug` is called with the moment (s) of the fault unplug, which also strikes at a data byte of a CAN frame.
    """

    def __init__(self, fault: ByteFault, unplug: Callable[[float], None] = lambda at: None) -> None:
        self.fault = fault
        self._unplug = unplug
        self.fired: list[ByteFault] = []
        self._exchange = 0
        self._passed = {Side.HOST: 0, Side.DEVICE: 0}
        self._later = 0.0

    def carry(self, sender: Side, data: Data, at: float) -> list[Delivery]:
        to = Side.DEVICE if sender is Side.HOST else Side.HOST
        if sender is Side.HOST:
            self._exchange += 1
            self._passed = {Side.HOST: 0, Side.DEVICE: 0}
            self._later = 0.0
        fault = self.fault
        later = self._later if to is fault.to else 0.0
        place = fault.byte - self._passed[to]
        size = len(data.data) if isinstance(data, CanFrame) else len(data)
        self._passed[to] += size
        is_here = 0 <= place < size + (fault.action == "insert")
        if self.fired or fault.to is not to or fault.exchange != self._exchange or not is_here:
            return [Delivery(at + later, to, data)]
        self.fired.append(fault)
        if fault.action == "unplug":
            self._unplug(at + INSTANT)
            return [] if isinstance(data, CanFrame) or not place else [Delivery(at, to, data[:place])]
        assert isinstance(data, bytes)
        before, byte, after = data[:place], data[place : place + 1], data[place + 1 :]
        pieces = [(later, before + self._changed(byte) + after)]
        if fault.action == "delay":
            self._later = fault.seconds
            pieces = [(0.0, before), (self._later, byte + after)]
        return [Delivery(at + shift, to, piece) for shift, piece in pieces if piece]

    def _changed(self, byte: bytes) -> bytes:
        match self.fault.action:
            case "drop":
                return b""
            case "duplicate":
                return byte * 2
            case "corrupt":
                return bytes([byte[0] ^ self.fault.value])
            case "insert":
                return bytes([self.fault.value]) + byte
        return byte
