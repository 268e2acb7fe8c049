"""Simulated buses: by name in this process, and on real ports for any program.

What a device does is in the `simulator` of its family. Here are the clock, the wire, faults, ports and the control
socket.
"""

from motorbus.simulation.named import Simulation, find

__all__ = ["Simulation", "find"]
