"""A host on a simulated KST bus. Frames are text as candump prints them: identifier, `#`, data."""

from __future__ import annotations

from motorbus.core.can_frame import CanFrame
from motorbus.families.kst.simulator import KstBus, Servo, simulate

ERROR = "20000088#0000000000000000"
"""What the adapter of the host reports of a broken frame."""
READ_POSITION = "4002600000000000"
READ_ID = "4000300000000000"
MOVE = "2203600084030000"
"""Set the position 90°, raw 900."""
SET_ID = "2200300026000000"
"""Set the node id 0x26."""
SAVE = "2210100173617665"


def frame(text: str) -> CanFrame:
    """A frame from its text; an identifier of 8 digits has 29 bits."""
    identifier, _, data = text.partition("#")
    return CanFrame(int(identifier, 16), bytes.fromhex(data), len(identifier) == 8)


class Host:
    """Sends frames to simulated servos, by default one with id 0x25. The clock starts at 1 s.

    A frame without an identifier is a request to node 0x25.
    """

    def __init__(self, *ids: int, rate: int = 500_000, **options: object) -> None:
        self.bus: KstBus = simulate(ids or (0x25,), **options)
        self.bus.tune(rate)
        self.now = 1.0
        self.bus.advance(self.now)

    def __getitem__(self, node: int) -> Servo:
        return self.bus.nodes[node]

    def timed(self, *texts: str, within: float = 0.01) -> list[tuple[float, str]]:
        """Send these now; return the frames that start `within` s, each with its delay (s)."""
        start = self.now
        for text in texts:
            self.bus.receive(frame(text if "#" in text else f"625#{text}"), start)
        self.now += within
        return [(round(at - start, 9), str(data)) for at, data in self.bus.advance(self.now)]

    def send(self, *texts: str) -> list[str]:
        """Send these now; return the frames that start within 10 ms."""
        return [text for _, text in self.timed(*texts)]

    def wait(self, seconds: float) -> list[str]:
        """Let time pass; return the frames that start meanwhile."""
        return [text for _, text in self.timed(within=seconds)]

    def ask(self, *requests: str) -> list[str]:
        """Send these requests to node 0x25; return the data of its replies."""
        replies = self.send(*requests)
        assert all(reply.startswith("5A5#") for reply in replies), replies
        return [reply.removeprefix("5A5#") for reply in replies]

    def write(self, index: int, raw: int) -> str:
        """Write a word to an object of node 0x25; return the data of its reply."""
        data = raw.to_bytes(2, "little", signed=True).hex()
        (reply,) = self.ask(f"22{index & 255:02X}{index >> 8:02X}00{data}0000")
        return reply

    def read(self, index: int) -> int:
        """Read a word of an object of node 0x25."""
        (reply,) = self.ask(f"40{index & 255:02X}{index >> 8:02X}0000000000")
        return int.from_bytes(bytes.fromhex(reply)[4:6], "little", signed=True)

    def restart(self, *, save: bool = False) -> None:
        """Take the supply of all servos away and give it back, after a save on request."""
        if save:
            self.send(SAVE)
            self.wait(0.2)
        for servo in self.bus.servos:
            servo.power_cycle()
