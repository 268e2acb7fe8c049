"""The other end of the line, made by hand: it shares nothing with the product's wire. Answers are in hexadecimal."""

from __future__ import annotations

from motorbus.families.stepper.simulator import Controller, StepperBus, simulate


def frame(*body: int) -> bytes:
    """FF AA, up to eight bytes, zeros behind them, and the low byte of the sum."""
    data = bytes((0xFF, 0xAA, *body)).ljust(10, b"\0")
    return data + bytes((sum(data) % 256,))


def number(value: int, size: int) -> tuple[int, ...]:
    """The bytes of a number, low one first."""
    return tuple(value >> 8 * at & 255 for at in range(size))


SELECT, READ, SAVE, CLEAR, START = 0x6E, 0x3E, 0x2E, 0x1E, 0x4E
STOP_PROJECT = frame(0x5E)
FORWARD, REVERSE, ONCE, STOP, HOME = (frame(3, code) for code in (0x0A, 0x0B, 0x0C, 0x0D, 0x0F))
DONE = "EE DD"


def step(
    row: int, *, distance: int = 1600, direction: int = 0, rpm: int = 60, delay: int = 0, **more: int
) -> list[bytes]:
    """The seven frames of one step: a turn of 1600 units in a second, without a ramp, unless said otherwise."""

    def one(code: int, *values: int) -> bytes:
        return frame(3, code, *values, *([0] * (5 - len(values))), row)

    return [
        one(3, *number(distance, 3)),
        one(4, direction, *number(more.get("start", 1600), 2)),
        one(5, *number(more.get("acceleration", 0), 2), *number(rpm, 2)),
        one(6, more.get("output", 0)),
        one(7, *number(delay, 3)),
        one(8, more.get("wait", 0)),
        one(9, more.get("stop", 0)),
    ]


def written(
    project: int, *steps: list[bytes], loop: tuple[int, int, int] = (0, 0, 0), repeat: int = 0, stop: int = 1
) -> list[bytes]:
    """The frames that write a project of 1600 pulses a turn, in units of a pulse."""
    return [
        frame(SELECT, project, len(steps)),
        frame(3, 1, *number(8, 2), 180),
        frame(3, 2, *number(1600, 3)),
        frame(0x7E, *loop),
        frame(0x8E, repeat),
        frame(3, 0x0E, stop),
        *(one for group in steps for one in group),
    ]


class Host:
    """Says frames to a simulated controller, one after the other, and gives what comes back as hexadecimal."""

    def __init__(self, **options: object) -> None:
        self.bus: StepperBus = simulate((1,), **options)
        self.now = 0.0
        self.bus.advance(0.0)
        self.heard: list[tuple[float, str]] = []

    @property
    def device(self) -> Controller:
        return self.bus.nodes[1]

    def say(self, data: bytes | str, within: float = 0.2) -> str:
        """Send now and collect what begins within so long, in one string; the clock goes on by that."""
        return " ".join(text for _, text in self.timed(data, within))

    def timed(self, data: bytes | str, within: float = 0.2) -> list[tuple[float, str]]:
        """The same piece by piece, with how long after the request each began (s)."""
        began = self.now
        self.bus.receive(bytes.fromhex(data) if isinstance(data, str) else data, began)
        return [(round(at - began, 9), text) for at, text in self.wait(within)]

    def wait(self, seconds: float) -> list[tuple[float, str]]:
        """Let time pass; gives what is said meanwhile, each with its moment."""
        self.now += seconds
        said = []
        for at, data in self.bus.advance(self.now):
            assert isinstance(data, bytes)
            said.append((at, data.hex(" ").upper()))
        self.heard += said
        return said

    def write(self, frames: list[bytes], within: float = 0.05) -> None:
        """Say them all; each must be acknowledged by its own first bytes."""
        for data in frames:
            reply = bytes.fromhex(self.say(data, within))
            assert len(reply) == 6
            assert reply[:3] == data[:3], data.hex(" ")

    def dump(self, project: int) -> bytes:
        """The 226 bytes of a project."""
        return bytes.fromhex(self.say(frame(READ, project), 0.5))
