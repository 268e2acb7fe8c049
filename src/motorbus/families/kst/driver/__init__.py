"""Driver functions: requests and procedures of KST servos. They send nothing themselves; a bus runs them.

A function of one servo takes a `Node` (a `Servo` is one), a function of all servos the `BusSettings`.
"""
