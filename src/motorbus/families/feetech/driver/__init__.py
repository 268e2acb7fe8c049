"""Driver functions for FEETECH servos.

Functions of one servo take a `Node` (a `Servo` is one), functions of several take nodes or ids. Each returns a
`Request`, or is a procedure; a bus carries it out.
"""
