"""Simulated buses where others can reach them: on a pseudo-terminal or TCP port, or by name in this process.

What a device does lives in its family's `simulator`; here is only how it is served: the clock, the pace of the wire,
faults between, a control socket, and the names of those that are alive.
"""
