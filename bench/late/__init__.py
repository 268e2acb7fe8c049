"""Late replies and echo, the same for everybody: the device that misbehaves, and one file for each who is asked.

Like the contenders, a library of others only ever runs in a process of its own; `device.py` is all of ours it meets.
"""
