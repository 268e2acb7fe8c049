"""Driver functions: requests and procedures of the stepper controller. They send nothing themselves; a bus runs them.

Each takes a `Node`, as a `Controller` is one.
"""
