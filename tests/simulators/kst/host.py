"""The other end of the bus for the tests of the simulator, made by hand: it shares no line with the product's wire.

Frames are text, as candump writes them: identifier (3 digits, or 8 for 29 bits), `#`, data.
"""

from __future__ import annotations

from motorbus.core.can_frame import CanFrame
from motorbus.families.kst.simulator import KstBus, Servo, simulate

SAVE = "2210100173617665"
ERROR = "20000088#0000000000000000"
"""What the host gets where a frame was broken."""


def frame(text: str) -> CanFrame:
    """A frame from its text."""
    identifier, _, data = text.partition("#")
    return CanFrame(int(identifier, 16), bytes.fromhex(data), len(identifier) == 8)


class Host:
    """Says frames to a simulated bus, one after the other in time, and gives what comes back, as text."""

    def __init__(self, *ids: int, rate: int = 500_000, **options: object) -> None:
        self.bus: KstBus = simulate(ids or (0x25,), **options)
        self.bus.tune(rate)
        self.now = 1.0
        self.bus.advance(self.now)

    def say(self, *texts: str) -> list[str]:
        """Send these at this moment and give what comes of them within 10 ms; the clock stands there then."""
        return [reply for _, reply in self.timed(*texts)]

    def timed(self, *texts: str, within: float = 0.01) -> list[tuple[float, str]]:
        """The same with how long after the requests each frame began (s)."""
        began = self.now
        for text in texts:
            self.bus.receive(frame(text), began)
        return [(round(at - began, 9), text) for at, text in self.wait(within)]

    def wait(self, seconds: float) -> list[tuple[float, str]]:
        """Let time pass; gives what was said meanwhile, and when."""
        self.now += seconds
        heard = self.bus.advance(self.now)
        return [(at, str(data)) for at, data in heard]

    def heard(self, seconds: float) -> list[str]:
        """What is said while time passes."""
        return [text for _, text in self.wait(seconds)]

    def __getitem__(self, node: int) -> Servo:
        return self.bus.nodes[node]
