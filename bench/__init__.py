"""Side by side with other libraries, on a wire that costs nothing.

`python -m bench` runs every contender in a process of its own against a responder in C, in shuffled rounds, and
checks every value. What is compared is processor time, system calls and the cost inside the process; wall time on
a pseudo-terminal is mostly the kernel waking processes and is shown, not judged.
"""
