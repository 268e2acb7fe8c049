"""Recordings of a bus: packets in captured bytes and CAN frames, and the text formats of captures."""

from __future__ import annotations

from motorbus.recorder.decoder import Decoder, Packet

__all__ = ["Decoder", "Packet"]
