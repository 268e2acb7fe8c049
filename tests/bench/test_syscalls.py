"""The table of strace is read whether or not a call ever failed, and what the measuring itself calls is left out."""

from __future__ import annotations

from bench.syscalls import difference, parse

TABLE = """% time     seconds  usecs/call     calls    errors syscall
------ ----------- ----------- --------- --------- ----------------
 61.20    0.012345           4      3000           write
 38.80    0.007000           3      2001        12 read
  0.00    0.000000           0         1         1 access
------ ----------- ----------- --------- --------- ----------------
100.00    0.019345           3      5002        13 total
"""


def test_every_call_is_counted_and_the_total_is_none() -> None:
    assert parse(TABLE) == {"write": 3000, "read": 2001, "access": 1}


def test_a_table_of_nothing_is_empty() -> None:
    assert parse("") == {}


def test_what_belongs_to_exchanges_is_what_the_longer_run_has_more() -> None:
    short = {"read": 510, "write": 500, "openat": 80, "brk": 3, "getrusage": 20}
    long = {"read": 1510, "write": 1505, "openat": 80, "brk": 13, "getrusage": 20, "futex": 1000}
    assert difference(short, long) == {"read": 1.0, "write": 1.005, "futex": 1.0}


def test_what_the_measuring_needs_for_its_readings_is_none_of_the_exchanges() -> None:
    assert difference({}, dict.fromkeys(("brk", "mmap", "munmap", "madvise", "getrusage"), 1000)) == {}
