"""Simulated KST servos for the measurements on CAN, in a process of their own: each reading finds a servo elsewhere.

    python -m bench.can_servos FIRST COUNT

A contender that mixes up two nodes, gives a reading twice or leaves one out would not be seen where all stand still at
the same place. So each servo stands where the rule of `bench.can_loop` says after so many readings. Prints the path of
its pseudo-terminal, which speaks slcan, as one line; ends when standard input does.
"""

from __future__ import annotations

import sys
from contextlib import closing

from bench.can_loop import BITRATE, POSITION, position
from motorbus.core.can_frame import CanFrame
from motorbus.core.request import Data
from motorbus.families.kst.profiles import PROFILES
from motorbus.families.kst.sdo import decode_request
from motorbus.families.kst.simulator import KstBus
from motorbus.families.kst.simulator.quirks import Quirks
from motorbus.simulation.clients import CanClient
from motorbus.simulation.mount import Mount
from motorbus.simulation.pty import PtyMaster
from motorbus.simulation.slcan import SlcanAdapter


class Turning(KstBus):
    """Servos that somebody turns a little whenever they are asked where they are; `reads` by node."""

    def __init__(self, nodes: range) -> None:
        super().__init__(nodes, PROFILES["kst"], Quirks())
        self.reads = dict.fromkeys(nodes, 0)
        self._turned = {servo.node: servo for servo in self.servos}

    def receive(self, data: Data, at: float) -> None:
        """A frame of the host."""
        asked = decode_request(data) if isinstance(data, CanFrame) else None
        if (
            asked is not None
            and (asked.kind, asked.index) == ("upload", POSITION)
            and asked.node in self.reads
        ):
            self.now = max(self.now, at)
            self._turned[asked.node].raw_position = position(asked.node, self.reads[asked.node])
            self.reads[asked.node] += 1
        super().receive(data, at)


def serve(first: int, count: int) -> None:
    """Until standard input ends."""
    servos = Turning(range(first, first + count))
    with closing(PtyMaster()) as terminal:
        print(terminal.slave_name, flush=True)
        Mount(servos, CanClient(terminal, SlcanAdapter()), rate=BITRATE).serve(sys.stdin.fileno())


if __name__ == "__main__":
    serve(*map(int, sys.argv[1:]))
