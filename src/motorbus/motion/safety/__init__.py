"""What keeps motion within bounds, in parts that know no bus, no clock and no family: time and samples come in.

    gate        the one gate that every motion command passes
    guard       what bounds one device beyond its own limits
    fence       the bounds of a machine file, set over its devices at the gate of each bus
    track       which readings of a position can be believed, and for how long
    lease       who may move, until when, and whether somebody attends
    standstill  what proves that something rests
    strain      when a motor pushes too hard for too long, or is too hot

None of this is a safety function in the sense of a machinery standard: it runs on the host.
"""

from __future__ import annotations

from motorbus.motion.safety.gate import Gate

__all__ = ["Gate"]
