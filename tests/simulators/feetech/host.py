"""A host for the tests of the simulator; it shares no code with the encoders and decoders of the product."""

from __future__ import annotations

from typing import Literal

from motorbus.families.feetech.simulator import FeetechBus, Servo, simulate

PING, READ, WRITE, REG_WRITE, ACTION, RESTORE = range(1, 7)
BOOTLOADER, UNKNOWN, CLEAR_TURNS, CALIBRATE, SYNC_READ, SYNC_WRITE = 0x08, 0x09, 0x0A, 0x0B, 0x82, 0x83
ALL = 254
ACK = ["FF FF 01 02 00 FC"]
MODELS = {
    "sts": "sts3215",
    "smbl": "sm85blhv",
    "smcl": "sm80-360m",
    "scs": "scs0009",
    "scs2": "scs215-2",
    "hls": "hls3925",
}
"""Register map -> a model that has it."""
LOCK = {"sts": 55, "smbl": 55, "hls": 55, "smcl": 48, "scs": 48, "scs2": 48}


def packet(id: int, instruction: int, *parameters: int) -> bytes:
    """FF FF, id, parameters + 2, instruction, parameters, and the complement of the sum."""
    body = [id, len(parameters) + 2, instruction, *parameters]
    return bytes([0xFF, 0xFF, *body, 255 - sum(body) % 256])


def word(value: int, sign_bit: int = 15) -> tuple[int, int]:
    """Two bytes, low one first; a negative number has its sign bit set."""
    code = value if value >= 0 else -value | 1 << sign_bit
    return code & 255, code >> 8


def big(value: int, sign_bit: int = 15) -> tuple[int, int]:
    """The same, high byte first, as SCS servos have it."""
    low, high = word(value, sign_bit)
    return high, low


class Host:
    """A host on a simulated bus; replies are in hexadecimal."""

    def __init__(self, ids: tuple[int, ...] = (1,), model: str = "", /, **options: object) -> None:
        self.bus: FeetechBus = simulate(ids, MODELS.get(model, model), **options)
        self.now = 1.0

    @property
    def servo(self) -> Servo:
        """The first servo."""
        return self.bus.servos[0]

    def say(self, data: bytes | str) -> list[str]:
        """Send now; the replies, however late. The clock of the host stands still."""
        return [reply for _, reply in self.timed(data)]

    def timed(self, data: bytes | str) -> list[tuple[float, str]]:
        """The same, each with the time (s) from the request to its start."""
        self.bus.receive(bytes.fromhex(data) if isinstance(data, str) else data, self.now)
        replies = []
        while (due := self.bus.due()) is not None:
            for at, reply in self.bus.advance(due):
                assert isinstance(reply, bytes)
                replies.append((round(at - self.now, 9), reply.hex(" ").upper()))
        return replies

    def wait(self, seconds: float) -> Host:
        """Let time pass."""
        self.now += seconds
        self.bus.advance(self.now)
        return self

    def read(self, id: int, address: int, count: int = 2, order: Literal["little", "big"] = "little") -> int:
        """The number in these registers; a sign bit is part of it."""
        (reply,) = self.say(packet(id, READ, address, count))
        return int.from_bytes(bytes.fromhex(reply)[5:-1], order)

    def write(self, id: int, address: int, *data: int) -> list[str]:
        """Write bytes; the replies."""
        return self.say(packet(id, WRITE, address, *data))
