"""The table of strace is read whether or not a call ever failed."""

from __future__ import annotations

from bench.syscalls import parse

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
