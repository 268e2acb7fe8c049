"""What was said on a line and kept: taken apart again, packet by packet or all at once.

Decoder             as it comes, cut anywhere                    Decoder("feetech").feed(data)
decode              a whole recording at once, with numpy        decode("feetech", data)
Packets, Packet     what both give
"""

from __future__ import annotations

from motorbus.core.capture import Packet
from motorbus.recorder.bulk import decode
from motorbus.recorder.decoder import Decoder
from motorbus.recorder.packets import Packets

__all__ = ["Decoder", "Packet", "Packets", "decode"]
